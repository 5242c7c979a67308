//! Learning on a device against its twin on the processor.

use std::{ops::ControlFlow, sync::Arc};

use glam::Vec3;
use rand::{SeedableRng as _, rngs::StdRng};

use super::{
    super::{GpuError, GpuGradients, kernels::Tile, learner::LearnKernels},
    gpu,
};
use crate::sdf::{
    SirenConfig, SirenField,
    batch::{FieldFrame, FieldGradients, tests::example},
    loss::{LossConfig, LossPoint},
};

/// Length of the difference over that of the twin.
fn off(ours: &[f32], twin: &[f32]) -> f32 {
    let length = |of: &mut dyn Iterator<Item = f32>| of.map(|x| x * x).sum::<f32>().sqrt();
    length(&mut ours.iter().zip(twin).map(|(a, b)| a - b)) / length(&mut twin.iter().copied())
}

/// Three fields, with as many points as a tile does not divide, fewer, and two.
struct Three {
    fields: Vec<SirenField>,
    points: Vec<Vec3>,
    known: Vec<LossPoint>,
}

impl Three {
    fn of(config: SirenConfig) -> Self {
        let (field, points, known) = example(config);
        let other = |seed| SirenField::init(config, &mut StdRng::seed_from_u64(seed));
        Self { fields: vec![field, other(8), other(9)], points, known }
    }

    fn frames(&self) -> Vec<FieldFrame<'_>> {
        let counts = [self.points.len(), 77, 2];
        self.fields
            .iter()
            .zip(counts)
            .map(|(field, count)| FieldFrame {
                parameters: field.parameters(),
                points: &self.points[..count],
                known: &self.known[..count],
            })
            .collect()
    }
}

fn assert_same(ours: &GpuGradients, twin: &FieldGradients, config: SirenConfig) {
    for frame in 0..3 {
        for layer in 0..config.layers {
            let of = |all| {
                let (weight, bias) = config.split(all, layer);
                [weight.to_vec(), bias.to_vec()]
            };
            let pairs = of(ours.frame(frame)).into_iter().zip(of(twin.frame(frame)));
            for (what, (ours, twin)) in ["weight", "bias"].into_iter().zip(pairs) {
                let off = off(&ours, &twin);
                println!("{config:?}, frame {frame}, layer {layer}, {what}: {off:.1e} off");
                // Summed in another order, through layers that multiply rounding by up to thirty.
                assert!(off < 1e-3, "frame {frame}, layer {layer}, {what}: {off}");
            }
        }
    }
}

#[test]
fn gradients_on_a_device_are_the_processors() {
    let Some(gpu) = gpu() else {
        return;
    };
    for config in [
        SirenConfig { hidden: 16, layers: 2 },
        SirenConfig { hidden: 48, layers: 3 },
        SirenConfig { hidden: 32, layers: 5 },
        SirenConfig::LIVE,
        SirenConfig::PAPER,
    ] {
        let three = Three::of(config);
        let loss = LossConfig::default();
        let mut twin = FieldGradients::new(config);
        let of_twin = twin.compute(&three.frames(), &loss).total();
        let mut ours = GpuGradients::new(&gpu, config).unwrap();
        for tile in [Tile::Of16, Tile::Of8] {
            let kernels = LearnKernels::with_tile(&gpu, config.hidden, tile).unwrap();
            ours.kernels = Arc::new(kernels);
            let terms = ours.compute(&three.frames(), &loss).unwrap().total();
            println!("{tile:?}");
            assert!((terms / of_twin - 1.0).abs() < 1e-5, "{terms} {of_twin}");
            assert_same(&ours, &twin, config);
        }
    }
}

#[test]
fn frames_whose_tapes_do_not_fit_together_are_taken_in_turn() {
    let Some(gpu) = gpu() else {
        return;
    };
    let config = SirenConfig { hidden: 32, layers: 4 };
    let three = Three::of(config);
    let loss = LossConfig::default();
    let gradients = |most_tape_bytes: Option<usize>| {
        let mut ours = GpuGradients::new(&gpu, config).unwrap();
        ours.most_tape_bytes = most_tape_bytes.unwrap_or(ours.most_tape_bytes);
        // Twice, as two steps are taken.
        ours.compute(&three.frames()[..2], &loss).unwrap();
        let terms = ours.compute(&three.frames(), &loss).unwrap();
        let frames: Vec<Vec<f32>> = (0..3).map(|frame| ours.frame(frame).to_vec()).collect();
        (terms, frames)
    };
    let of_a_frame = 160 * 3 * 5 * 32 * size_of::<f32>();
    let together = gradients(None);
    assert_eq!(gradients(Some(2 * of_a_frame)), together);
    assert_eq!(gradients(Some(1)), together);
}

#[test]
fn shapes_that_the_kernels_do_not_know_are_refused() {
    let Some(gpu) = gpu() else {
        return;
    };
    let config = SirenConfig { hidden: 40, layers: 4 };
    let refused = GpuGradients::new(&gpu, config).err();
    assert_eq!(refused, Some(GpuError::FieldShape { config }));
}

#[test]
fn a_lost_device_is_an_error_and_fine_tuning_goes_on_without_it() {
    use crate::fine_tune::{FineTuner, tests as tuning};
    let Some(gpu) = gpu() else {
        return;
    };
    let config = tuning::config();
    let made = || FineTuner::new(tuning::network(), &tuning::keyframes(), 1.0, &config).unwrap();
    let mut on_cpu = made();
    on_cpu
        .run(&|| 0.0, &mut |_, _| ControlFlow::Continue(()))
        .unwrap();
    let cpu_m = on_cpu.held_out_residual_m();

    let mut whole = made();
    whole.lend(&gpu);
    assert_eq!(whole.device(), gpu.name());
    whole
        .run(&|| 0.0, &mut |_, _| ControlFlow::Continue(()))
        .unwrap();
    assert_eq!((whole.device(), whole.gave_up()), (gpu.name(), None));
    let whole_m = whole.held_out_residual_m();

    let mut broken = made();
    broken.lend(&gpu);
    broken
        .run(&|| 0.0, &mut |now, _| {
            if now.step == config.steps / 2 {
                gpu.device.destroy();
            }
            ControlFlow::Continue(())
        })
        .unwrap();
    assert_eq!(broken.device(), "CPU");
    let reason = broken.gave_up().expect("it was lost");
    let broken_m = broken.held_out_residual_m();
    println!("{reason}; held out {cpu_m} m, {whole_m} on the device, {broken_m} with half of it");
    assert!(reason.contains("lost"), "{reason}");
    // Gradients are compared above; single precision takes other ways over a hundred steps. This says that it learned.
    for ours_m in [whole_m, broken_m] {
        assert!((ours_m / cpu_m - 1.0).abs() < 0.2, "{ours_m} {cpu_m}");
    }

    let mut never = made();
    never.lend(&gpu);
    assert_eq!(never.device(), "CPU");
    assert!(never.gave_up().is_some());
}

#[test]
fn a_device_on_trial_computes_only_if_it_is_faster() {
    use crate::fine_tune::{FineTuner, tests as tuning};
    let Some(gpu) = gpu() else {
        return;
    };
    let config = tuning::config();
    let tried = |cpu_secs: f64| {
        let mut tuner =
            FineTuner::new(tuning::network(), &tuning::keyframes(), 1.0, &config).unwrap();
        tuner.lend(&gpu);
        // Processor and device are timed in turn; the device takes a second each time.
        let (now, readings) = (std::cell::Cell::new(0.0), std::cell::Cell::new(0));
        let clock = || {
            let passed = match readings.replace(readings.get() + 1) % 3 {
                0 => 0.0,
                1 => cpu_secs,
                _ => 1.0,
            };
            now.set(now.get() + passed);
            now.get()
        };
        tuner.try_out(&clock);
        let given_up = tuner.gave_up().map(str::to_owned);
        (given_up, tuner.step().unwrap())
    };
    let (slow, with_cpu) = tried(0.5);
    let reason = slow.expect("it took a second for half of one");
    assert!(
        reason.contains("1000.0 ms a step, the processor 500.0"),
        "{reason}"
    );
    let (fast, with_gpu) = tried(2.0);
    assert_eq!(fast, None);
    // A trial draws nothing from the sequence of steps.
    let mut untried =
        FineTuner::new(tuning::network(), &tuning::keyframes(), 1.0, &config).unwrap();
    assert_eq!(untried.step().unwrap(), with_cpu);
    assert!((with_gpu.total() / with_cpu.total() - 1.0).abs() < 1e-5);
}

#[test]
fn two_threads_get_their_own_from_one_device() {
    let Some(gpu) = gpu() else {
        return;
    };
    let config = SirenConfig { hidden: 16, layers: 3 };
    let three = Three::of(config);
    let loss = LossConfig::default();
    let mut ours = [(); 2].map(|()| GpuGradients::new(&gpu, config).unwrap());
    let once = ours[0].compute(&three.frames(), &loss).unwrap();
    std::thread::scope(|scope| {
        for ours in &mut ours {
            scope.spawn(|| {
                for _ in 0..50 {
                    assert_eq!(ours.compute(&three.frames(), &loss), Ok(once));
                }
            });
        }
    });
}
