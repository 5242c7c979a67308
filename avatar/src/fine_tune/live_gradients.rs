//! What a step's arithmetic runs on: a graphics card as long as one was lent and is well, the processor otherwise.

#[cfg(feature = "gpu")]
use std::sync::Arc;

#[cfg(feature = "gpu")]
use crate::gpu::{Gpu, GpuGradients};
use crate::sdf::{
    SirenConfig,
    batch::{FieldFrame, FieldGradients},
    loss::{LossConfig, LossTerms},
};

/// Loss and gradients of a step, which do not stop because a device does.
pub(super) struct LiveGradients {
    cpu: FieldGradients,
    #[cfg(feature = "gpu")]
    gpu: Option<GpuGradients>,
    /// "CPU", "AMD Radeon RX 7600".
    device: String,
    gave_up: Option<String>,
}

const CPU: &str = "CPU";

impl LiveGradients {
    pub(super) fn on_cpu(config: SirenConfig) -> Self {
        Self {
            cpu: FieldGradients::new(config),
            #[cfg(feature = "gpu")]
            gpu: None,
            device: CPU.to_owned(),
            gave_up: None,
        }
    }

    /// From now on on the device, if it can do it.
    #[cfg(feature = "gpu")]
    pub(super) fn lend(&mut self, gpu: &Arc<Gpu>, config: SirenConfig) {
        match GpuGradients::new(gpu, config) {
            Ok(made) => {
                gpu.name().clone_into(&mut self.device);
                self.gpu = Some(made);
            }
            Err(reason) => self.give_up(reason.to_string()),
        }
    }

    /// As [`FieldGradients::compute`]. When the device fails it is given up for good, and the processor does this step too.
    pub(super) fn compute(&mut self, frames: &[FieldFrame<'_>], loss: &LossConfig) -> LossTerms {
        #[cfg(feature = "gpu")]
        if let Some(gpu) = &mut self.gpu {
            match gpu.compute(frames, loss) {
                Ok(terms) => return terms,
                Err(reason) => self.give_up(reason.to_string()),
            }
        }
        self.cpu.compute(frames, loss)
    }

    /// The loss's gradient by a frame's parameters, after [`Self::compute`].
    pub(super) fn frame(&self, frame: usize) -> &[f32] {
        #[cfg(feature = "gpu")]
        if let Some(gpu) = &self.gpu {
            return gpu.frame(frame);
        }
        self.cpu.frame(frame)
    }

    /// Gives the device up unless its gradients are the processor's and it has them sooner: `clock` gives seconds.
    #[cfg(feature = "gpu")]
    pub(super) fn try_out(
        &mut self,
        frames: &[FieldFrame<'_>],
        loss: &LossConfig,
        clock: &dyn Fn() -> f64,
    ) {
        let Some(gpu) = &mut self.gpu else {
            return;
        };
        // The first time buffers are made on both sides, and some drivers finish compiling.
        let (mut cpu_secs, mut gpu_secs) = (f64::INFINITY, f64::INFINITY);
        for _ in 0..2 {
            let started = clock();
            self.cpu.compute(frames, loss);
            let between = clock();
            if let Err(reason) = gpu.compute(frames, loss) {
                self.give_up(reason.to_string());
                return;
            }
            cpu_secs = cpu_secs.min(between - started);
            gpu_secs = gpu_secs.min(clock() - between);
        }
        let pairs = (0..frames.len()).map(|frame| (gpu.frame(frame), self.cpu.frame(frame)));
        let off = relative_difference(pairs);
        if let Some(objection) = objection(off, gpu_secs, cpu_secs) {
            self.give_up(format!("{} {objection}", self.device));
        }
    }

    /// What computes: "CPU", "AMD Radeon RX 7600".
    pub(super) fn device(&self) -> &str {
        &self.device
    }

    /// Why a device that was lent computes no more, or never did.
    pub(super) fn gave_up(&self) -> Option<&str> {
        self.gave_up.as_deref()
    }

    #[cfg(feature = "gpu")]
    fn give_up(&mut self, reason: String) {
        tracing::warn!(%reason, "the processor learns");
        self.gpu = None;
        CPU.clone_into(&mut self.device);
        self.gave_up = Some(reason);
    }
}

/// What there is to say against a device whose gradients are `off` the processor's by that share.
#[cfg(feature = "gpu")]
fn objection(off: f64, gpu_secs: f64, cpu_secs: f64) -> Option<String> {
    // What is no number is not within anything.
    let is_same = off <= MOST_OFF;
    if !is_same {
        return Some(format!(
            "has gradients {:.1} % off the processor's",
            off * 100.0
        ));
    }
    let [gpu_ms, cpu_ms] = [gpu_secs, cpu_secs].map(|secs| secs * 1e3);
    (gpu_secs > cpu_secs).then(|| format!("takes {gpu_ms:.1} ms a step, the processor {cpu_ms:.1}"))
}

/// Single precision, summed in another order, comes to a thousandth of that.
#[cfg(feature = "gpu")]
const MOST_OFF: f64 = 0.01;

/// Length of the difference over the length of the twin, each in all frames.
#[cfg(feature = "gpu")]
fn relative_difference<'a>(pairs: impl Iterator<Item = (&'a [f32], &'a [f32])>) -> f64 {
    let (mut difference, mut length) = (0.0, 0.0);
    for (ours, twin) in pairs.flat_map(|(ours, twin)| ours.iter().zip(twin)) {
        difference += f64::from(ours - twin).powi(2);
        length += f64::from(*twin).powi(2);
    }
    // Where nothing weighs anything both are zero, and the same.
    if difference == 0.0 {
        return 0.0;
    }
    (difference / length).sqrt()
}

#[cfg(all(test, feature = "gpu"))]
mod tests {
    use super::*;

    #[test]
    fn a_device_is_objected_to_where_it_is_wrong_or_slow() {
        assert_eq!(objection(1e-5, 0.01, 0.04), None);
        for (off, says) in [(0.02, "2.0 % off"), (f64::NAN, "NaN % off")] {
            let reason = objection(off, 0.01, 0.04).unwrap();
            assert!(reason.contains(says), "{reason}");
        }
        let reason = objection(1e-5, 0.05, 0.04).unwrap();
        assert!(
            reason.contains("50.0 ms a step, the processor 40.0"),
            "{reason}"
        );
    }

    #[test]
    fn a_difference_is_measured_by_the_twins_length_over_all_frames() {
        let off = |pairs: &[(&[f32], &[f32])]| relative_difference(pairs.iter().copied());
        assert_eq!(off(&[(&[3.0, 1.0], &[3.0, 0.0]), (&[4.0], &[4.0])]), 0.2);
        assert_eq!(off(&[(&[0.0], &[0.0])]), 0.0);
        assert!(off(&[(&[f32::NAN], &[1.0])]).is_nan());
        assert_eq!(off(&[(&[1.0], &[0.0])]), f64::INFINITY);
    }
}
