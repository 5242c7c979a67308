//! `effigy train`: how the shipped prior is made.

use std::{fs, ops::ControlFlow, path::PathBuf, sync::Arc};

use anyhow::bail;
use effigy_avatar::{
    Subject,
    hyper::{Precision, Provenance},
    meta::{Person, PersonFrame, PriorConfig, PriorProgress, train_prior},
};
use effigy_fusion::mesh::sample::sample_surface;
use effigy_registration::{BodyModel, smpl::builtin};
use effigy_sim_sensor::population;

use crate::{
    cli::{TrainArgs, TrainPriorArgs, TrainWhat},
    files, interrupt,
    progress::Progress,
};

/// Points kept of each simulated surface.
const POINTS_PER_FRAME: usize = 4000;

pub(crate) fn run(args: &TrainArgs) -> anyhow::Result<()> {
    match &args.what {
        TrainWhat::Prior(args) => prior(args),
    }
}

fn prior(args: &TrainPriorArgs) -> anyhow::Result<()> {
    let body = builtin::body();
    let config = PriorConfig { seed: args.seed, ..PriorConfig::default() };
    let checkpoint = checkpoint_path(args);
    if checkpoint.exists() && !args.resume {
        bail!(
            "{}: a checkpoint is there; go on from it with --resume, or delete it",
            checkpoint.display()
        );
    }
    let source = |number: u64, frames: usize| person(&body, args.seed, number, frames);
    let mut bar: Option<(effigy_avatar::meta::Stage, Progress)> = None;
    let mut on_progress = |now: &PriorProgress| {
        if bar.as_ref().is_none_or(|(stage, _)| *stage != now.stage) {
            bar = Some((now.stage, Progress::new("training", Some(now.steps.into()))));
        }
        if let Some((_, bar)) = &bar {
            bar.say(format!("{:?}, loss {:.2}", now.stage, now.loss));
            bar.advance(now.step.into());
        }
        if interrupt::requested() {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    };
    let trained = train_prior(&source, &config, Some(&checkpoint), &mut on_progress)?;
    let Some(mut network) = trained else {
        println!("stopped; `--resume` goes on from {}", checkpoint.display());
        return Ok(());
    };
    network.provenance = Provenance {
        body: Some(body.identity),
        training: format!("effigy train prior --seed {}", args.seed),
        is_placeholder: false,
    };
    let bytes = network.to_bytes(Precision::F16)?;
    files::write(&args.out, &bytes)?;
    fs::remove_file(&checkpoint).ok();
    println!("{}: {} bytes", args.out.display(), bytes.len());
    Ok(())
}

fn checkpoint_path(args: &TrainPriorArgs) -> PathBuf {
    args.out.with_extension("checkpoint")
}

/// A simulated person's clothed surfaces in some poses, in unit space.
fn person(body: &Arc<BodyModel>, seed: u64, number: u64, frames: usize) -> Person {
    let simulated = population::person(Arc::clone(body), seed, number as usize, frames);
    let subject = Subject::new(body, &simulated.person.betas)
        .expect("the built-in body has vertices in every shape");
    let frame = |(index, sample): (usize, &population::PopulationSample)| {
        let points_seed = number * 1000 + index as u64;
        let points = sample_surface(&sample.clothed_canonical, POINTS_PER_FRAME, points_seed);
        PersonFrame {
            pose: subject.pose_input(&sample.theta),
            points_in_unit: points
                .iter()
                .map(|sample| subject.unit_box.unit_from_canonical(sample.point))
                .collect(),
            normals: points.iter().map(|sample| sample.normal).collect(),
        }
    };
    Person { frames: simulated.samples.iter().enumerate().map(frame).collect() }
}
