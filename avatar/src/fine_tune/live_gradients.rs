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
        let started = clock();
        self.cpu.compute(frames, loss);
        let cpu_secs = clock() - started;
        // The first time buffers are made, and some drivers finish compiling.
        let mut gpu_secs = f64::INFINITY;
        for _ in 0..2 {
            let started = clock();
            self.compute(frames, loss);
            gpu_secs = clock() - started;
        }
        let Some(gpu) = &self.gpu else {
            return;
        };
        let name = gpu.gpu().name();
        let pairs = (0..frames.len()).map(|frame| (gpu.frame(frame), self.cpu.frame(frame)));
        let off = relative_difference(pairs);
        // Not a number is no good either.
        let is_same = off <= MOST_OFF;
        if !is_same {
            let percent = off * 100.0;
            let reason = format!("{name} has gradients {percent:.1} % off the processor's");
            self.give_up(reason);
        } else if gpu_secs > cpu_secs {
            let [gpu_ms, cpu_ms] = [gpu_secs, cpu_secs].map(|secs| secs * 1e3);
            let reason = format!("{name} takes {gpu_ms:.1} ms a step, the processor {cpu_ms:.1}");
            self.give_up(reason);
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
    (difference / length).sqrt()
}
