//! `effigy train skinning`: how the shipped skinning networks are made.

use std::{fmt::Write as _, fs, ops::ControlFlow, path::Path};

use anyhow::{Context as _, bail};
use effigy_avatar::skinning::network::{
    NetworkConfig, SkinningNetwork,
    train::{Look, SkinningProgress, SkinningTrainConfig, train_skinning, training_flops},
};
use effigy_registration::smpl::builtin;
use effigy_sim_sensor::dataset::Dataset;

use super::clouds::Clouds;
use crate::{
    cli::{TrainPreset, TrainSkinningArgs},
    files,
    interrupt::{self, Stopped},
    pipeline::clock::Clock,
    progress::Progress,
    say::say,
};

/// What our kernels reach in this training on one core (an Intel Xeon with AVX-512), data included; for the estimate
/// that is printed before it starts.
const FLOPS_A_SECOND: f64 = 20e9;

pub(crate) fn run(args: &TrainSkinningArgs) -> anyhow::Result<()> {
    if args.preset == TrainPreset::Paper {
        let each = SkinningNetwork::count_parameters(NetworkConfig::PAPER);
        bail!(
            "the paper's networks have {each} parameters each: they are counted here, not trained; use --preset live"
        );
    }
    let body = builtin::body();
    let mut config = match &args.config {
        Some(path) => files::read_toml(path)?,
        None => SkinningTrainConfig::default(),
    };
    config.seed = args.seed.unwrap_or(config.seed);
    if let Some(steps) = args.steps {
        config.steps = steps;
    }
    let checkpoint = args.out.with_extension("checkpoint");
    if checkpoint.exists() && !args.resume {
        bail!(
            "{}: a checkpoint is there; go on from it with --resume, or delete it",
            checkpoint.display()
        );
    }
    files::check_writable(&args.out)?;
    let dataset = Dataset::open(&args.data, &body)?;
    let clouds = Clouds::load(&dataset, config.points, config.seed)?;
    let flops = training_flops(&config);
    say!(
        "{} training and {} held-out sequences; {} steps of {} clouds, {:.0} TFLOP, about {:.0} processor minutes",
        clouds.training_count(),
        clouds.held_out_count(),
        config.steps,
        config.clouds,
        flops / 1e12,
        flops / FLOPS_A_SECOND / 60.0,
    );
    let clock = Clock::start();
    let bar = Progress::new("training", Some(config.steps.into()));
    let mut looked = 0;
    let mut on_progress = |now: &SkinningProgress<'_>| {
        for look in &now.looks[looked.min(now.looks.len())..] {
            say!("{}", line(look));
        }
        looked = now.looks.len();
        let [inverse, forward, labels] = now.losses;
        bar.say(format!("loss {inverse:.3}, {forward:.3}, {labels:.3}"));
        bar.advance(now.step.into());
        if interrupt::requested() {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    };
    let trained = train_skinning(&body, &clouds, &config, Some(&checkpoint), &mut on_progress)?;
    let Some((mut networks, looks)) = trained else {
        return Err(Stopped::at_checkpoint(&checkpoint).into());
    };
    networks.provenance.training = format!(
        "effigy train skinning --preset live --seed {} ({} steps), data set of seed {}",
        config.seed,
        config.steps,
        dataset.manifest().seed
    );
    let bytes = networks.to_bytes()?;
    files::write(&args.out, &bytes)?;
    write_curve(&args.out.with_extension("curve.csv"), &looks)?;
    fs::remove_file(&checkpoint).ok();
    say!(
        "{}: {} bytes, {:.0} s",
        args.out.display(),
        bytes.len(),
        clock.secs()
    );
    Ok(())
}

fn line(look: &Look) -> String {
    format!(
        "step {}: losses {:.3} {:.3} {:.3}; held out, mm: inverse {:.2} (closest body point {:.2}), forward {:.2}, cloud only {:.2}",
        look.step,
        look.losses[0],
        look.losses[1],
        look.losses[2],
        look.inverse_m * 1e3,
        look.closest_m * 1e3,
        look.forward_m * 1e3,
        look.labels_m * 1e3,
    )
}

/// The course of the training, a line a look.
fn write_curve(path: &Path, looks: &[Look]) -> anyhow::Result<()> {
    let mut text = String::from(
        "step,loss_inverse,loss_forward,loss_labels,inverse_mm,forward_mm,labels_mm,closest_mm\n",
    );
    for look in looks {
        let [a, b, c] = look.losses;
        let _written = writeln!(
            text,
            "{},{a:.5},{b:.5},{c:.5},{:.4},{:.4},{:.4},{:.4}",
            look.step,
            look.inverse_m * 1e3,
            look.forward_m * 1e3,
            look.labels_m * 1e3,
            look.closest_m * 1e3,
        );
    }
    files::write(path, text).context("the curve")
}
