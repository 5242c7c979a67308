//! `effigy train`: how the shipped networks are made.

mod clouds;
mod curve;
mod estimate;
mod held_out;
mod people;
mod report;
mod skinning;

use std::{fs, path::Path, sync::Arc};

use anyhow::{Context as _, bail, ensure};
use effigy_avatar::{
    AvatarError,
    hyper::{HyperConfig, HyperNetwork, Precision, Provenance},
    meta::{PersonSource, PriorConfig, Training, Validation, train_field, train_hyper},
};
use effigy_registration::{BodyModel, smpl::builtin};
use effigy_sim_sensor::dataset::{Dataset, Split};

use self::{
    held_out::{Judge, is_held_out},
    people::{ClothPeople, OffsetPeople, People},
    report::Reporter,
};
use crate::{
    cli::{TrainArgs, TrainHyperArgs, TrainPreset, TrainShared, TrainWhat},
    files,
    interrupt::Stopped,
    pipeline::settings::{Settings, check_sampling},
    say::say,
};

/// The field alone learns from some 500 surfaces, and bringing one to canonical space takes longer than a step:
/// these are plenty.
const FIELD_LOOKS_AT_EVERY: usize = 12;

pub(crate) fn run(args: &TrainArgs) -> anyhow::Result<()> {
    match &args.what {
        TrainWhat::Sdf(args) => field(args),
        TrainWhat::Hyper(args) => hyper(args),
        TrainWhat::Skinning(args) => skinning::run(args),
    }
}

fn field(args: &TrainShared) -> anyhow::Result<()> {
    let job = Job::new(args, FIELD_LOOKS_AT_EVERY)?;
    estimate::say_field(&job.config);
    let trained = job.run(|training| Ok(train_field(training)?))?;
    job.finish(trained, "sdf", Precision::F32)
}

fn hyper(args: &TrainHyperArgs) -> anyhow::Result<()> {
    let job = Job::new(&args.shared, 1)?;
    let start = read_start(&args.start, &job)?;
    estimate::say_hyper(&job.config);
    let trained = job.run(|training| Ok(train_hyper(&start, training)?))?;
    job.finish(trained, "sdf and hyper", Precision::F16)
}

/// The field to start from.
fn read_start(path: &Path, job: &Job<'_>) -> anyhow::Result<HyperNetwork> {
    let start = HyperNetwork::load(path)
        .context("cannot read the field to start from; make it with `effigy train sdf`")?;
    if start.config() != job.config.network {
        bail!(
            "{}: its networks are {:?}, expected {:?}; make it with the same --preset",
            path.display(),
            start.config(),
            job.config.network
        );
    }
    if start.provenance.body != Some(job.body.identity) {
        bail!(
            "{}: it belongs to another body model; make it again",
            path.display()
        );
    }
    Ok(start)
}

/// What both trainings need.
struct Job<'a> {
    args: &'a TrainShared,
    body: Arc<BodyModel>,
    config: PriorConfig,
    people: People,
    judges: Vec<Judge>,
}

impl<'a> Job<'a> {
    /// Learns from every `every`th frame of the data set.
    fn new(args: &'a TrainShared, every: usize) -> anyhow::Result<Self> {
        let checkpoint = args.checkpoint();
        if checkpoint.exists() && !args.resume {
            bail!(
                "{}: a checkpoint is there; go on from it with --resume, or delete it",
                checkpoint.display()
            );
        }
        files::check_writable(&checkpoint.with_extension("partial"))?;
        let mut config = config(args)?;
        let body = builtin::body();
        let (people, judges) = people(args, (every, config.seed), &body)?;
        say!(
            "{} people to learn from in cloth, mirror images included; {} to judge; seed {}",
            people.cloth.as_ref().map_or(0, ClothPeople::count),
            judges.len(),
            config.seed
        );
        if config.joint.people == 0 {
            config.joint.people = people.count();
        }
        Ok(Self { args, body, config, people, judges })
    }

    fn run(
        &self,
        train: impl FnOnce(Training<'_>) -> anyhow::Result<Option<HyperNetwork>>,
    ) -> anyhow::Result<Option<HyperNetwork>> {
        let people = self.judges.iter().map(|judge| judge.held_out.clone());
        let validation = Validation::new(people.collect());
        let checkpoint = self.args.checkpoint();
        let mut reporter = Reporter::new(&self.args.out, &self.judges);
        let source: &dyn PersonSource = &self.people;
        let trained = train(Training {
            source,
            config: &self.config,
            validation: (!self.judges.is_empty()).then_some(&validation),
            checkpoint: Some(&checkpoint),
            on_event: &mut |event| reporter.take(event),
        })
        .map_err(|error| match error.downcast_ref() {
            // It says itself what is wrong with the checkpoint.
            Some(AvatarError::Checkpoint { .. }) => error,
            _ => error.context(format!(
                "training stopped; {} holds the last good state",
                checkpoint.display()
            )),
        })?;
        reporter.finish()?;
        Ok(trained)
    }

    fn finish(
        &self,
        trained: Option<HyperNetwork>,
        what: &str,
        precision: Precision,
    ) -> anyhow::Result<()> {
        let checkpoint = self.args.checkpoint();
        let Some(mut network) = trained else {
            return Err(Stopped::at_checkpoint(&checkpoint).into());
        };
        let data = &self.people.described;
        network.provenance = Provenance {
            body: Some(self.body.identity),
            training: format!("effigy train {what}, --seed {}, {data}", self.config.seed),
            is_placeholder: false,
        };
        let bytes = network.to_bytes(precision)?;
        files::write(&self.args.out, &bytes)?;
        fs::remove_file(&checkpoint).ok();
        say!("{}: {} bytes", self.args.out.display(), bytes.len());
        Ok(())
    }
}

/// Those who teach, and those who judge.
fn people(
    args: &TrainShared,
    (every, seed): (usize, u64),
    body: &Arc<BodyModel>,
) -> anyhow::Result<(People, Vec<Judge>)> {
    let offsets = OffsetPeople { body: Arc::clone(body), seed };
    let Some(path) = &args.data else {
        let described = "people in offset clothes".to_owned();
        return Ok((
            People { cloth: None, offsets, one_in: 1, described },
            Vec::new(),
        ));
    };
    let dataset = Dataset::open(path, body)?;
    let settings = Settings::default();
    let training = dataset.manifest().wearers(Split::Train);
    let (mut teachers, mut judges) = (Vec::new(), Vec::new());
    for (index, entries) in training.into_iter().enumerate() {
        if is_held_out(index) {
            let sequences = entries.into_iter().map(|entry| dataset.load(entry));
            let sequences = sequences.collect::<Result<Vec<_>, _>>()?;
            judges.push(Judge::new(&sequences, body, &settings)?);
        } else {
            teachers.push(entries);
        }
    }
    if teachers.is_empty() {
        bail!(
            "{}: nobody in it is there to learn from; make one with `effigy dataset make --preset prior`",
            path.display()
        );
    }
    let cloth = ClothPeople::load(&dataset, &teachers, body, &settings.canonicalise, every)?;
    let manifest = dataset.manifest();
    let described = format!("data set {:?} of seed {}", manifest.preset, manifest.seed);
    Ok((
        People { cloth: Some(cloth), offsets, one_in: args.offset_people, described },
        judges,
    ))
}

fn config(args: &TrainShared) -> anyhow::Result<PriorConfig> {
    let mut config = match &args.config {
        Some(path) => files::read_toml(path)?,
        None => PriorConfig::default(),
    };
    config.seed = args.seed.unwrap_or(config.seed);
    if args.preset == TrainPreset::Paper {
        config.network = HyperConfig::PAPER;
    }
    check(&config)?;
    Ok(config)
}

/// Refuses what cannot be trained.
fn check(config: &PriorConfig) -> anyhow::Result<()> {
    let PriorConfig { reptile, joint, adapt, .. } = config;
    let counts = [
        ("reptile.people", reptile.people),
        ("joint.frames", joint.frames),
        ("joint.people_per_step", joint.people_per_step),
        ("joint.frames_per_person", joint.frames_per_person),
        ("adapt.people", adapt.people),
        ("adapt.frames", adapt.frames),
    ];
    for (name, count) in counts {
        ensure!(count >= 1, "{name} is 0, expected at least 1");
    }
    check_sampling(&config.sampling)
}
