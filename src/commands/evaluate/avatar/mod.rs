//! MetaAvatar's protocol on our test people: eight single views in true poses, then frames nobody has seen; with more
//! frames, through other sensors, and beside other methods.

mod bars;
mod fitted;
mod judge;
mod method;
mod moment;
mod plan;
mod pretrain;
mod rows;
mod split;
mod strangers;
mod subject;
mod views;

use std::path::Path;

use anyhow::bail;
use effigy_avatar::hyper::HyperNetwork;
use effigy_registration::smpl::builtin;
use effigy_sim_sensor::dataset::{Dataset, Split};
use sha2::{Digest as _, Sha256};

pub(super) use self::views::{protocol_calibration, protocol_frame};
use self::{
    judge::judge,
    method::{Given, fit},
    plan::{Job, jobs},
    pretrain::School,
    rows::{Circumstances, Row, earlier, markdown},
    subject::{Entries, Subject, chosen},
};
pub(crate) use self::{
    plan::{Camera, HEADLINE_SEEDS, Method, Table},
    subject::Lesson,
    views::Views,
};
use crate::{
    cli::EvaluateAvatarArgs,
    files, interrupt,
    pipeline::{clock::Clock, settings::Settings},
    progress::Progress,
    say::say,
};

/// Of a quick look.
const QUICK_TEST_FRAMES: usize = 2;

pub(super) fn run(args: &EvaluateAvatarArgs, data: &Path) -> anyhow::Result<()> {
    for file in args.json.iter().chain(&args.md) {
        files::check_writable(file)?;
    }
    let body = builtin::body();
    let dataset = Dataset::open(data, &body)?;
    let settings = Settings::load(args.config.as_deref())?;
    let prior = settings.prior_network(body.identity)?;
    split::check(dataset.manifest(), &prior.provenance)?;
    let mut people = chosen(&dataset, args.all);
    let names: Vec<String> = people
        .iter()
        .map(|entries| subject::name(entries))
        .collect();
    people.retain(|entries| args.wants(&subject::name(entries)));
    if people.is_empty() && !names.is_empty() {
        bail!(
            "nobody in {} is called so; choose among {} (with --all there may be more)",
            data.display(),
            names.join(", ")
        );
    }
    if args.quick {
        people.truncate(1);
    }
    let test_frames = if args.quick {
        QUICK_TEST_FRAMES
    } else {
        args.test_frames
    };
    let circumstances = Circumstances {
        quick: args.quick,
        test_frames,
        dataset: format!("{:?}", dataset.manifest().preset),
        dataset_seed: dataset.manifest().seed,
        inputs: hash_of_inputs(&settings, &dataset, &prior)?,
        prior: prior.provenance.training,
    };
    let found = args.json.as_deref().filter(|_| args.resume);
    let mut evaluation = Evaluation {
        args,
        rows: match found {
            Some(path) => earlier(path, &circumstances)?,
            None => Vec::new(),
        },
        circumstances,
        dataset,
        settings,
        school: School::default(),
        clock: Clock::start(),
    };
    evaluation.people(&people)?;
    if args.tables().contains(&Table::Strangers) && !interrupt::requested() {
        evaluation.strangers()?;
    }
    evaluation.finish()
}

/// What else rows depend on, in one number.
fn hash_of_inputs(
    settings: &Settings,
    dataset: &Dataset,
    prior: &HyperNetwork,
) -> anyhow::Result<String> {
    let mut hash = Sha256::new();
    hash.update(serde_json::to_vec(settings)?);
    hash.update(serde_json::to_vec(dataset.manifest())?);
    hash.update(prior.parameter_bytes());
    Ok(format!("{:x}", hash.finalize()))
}

/// Everything that an evaluation holds from its first row to its last.
struct Evaluation<'a> {
    args: &'a EvaluateAvatarArgs,
    circumstances: Circumstances,
    dataset: Dataset,
    settings: Settings,
    rows: Vec<Row>,
    school: School,
    clock: Clock,
}

impl Evaluation<'_> {
    fn people(&mut self, people: &[Entries]) -> anyhow::Result<()> {
        let args = self.args;
        let mut jobs = jobs(args.tables(), args.quick);
        let methods = &args.methods;
        jobs.retain(|job| methods.is_empty() || methods.contains(&job.method));
        jobs.retain(|job| job.seed <= args.seeds);
        if jobs.iter().any(Job::learns_people_first) && !self.has_training_people() {
            say!(
                "occupancy and the ablation are left out: they learn a data set's training people first, and this one has none"
            );
            jobs.retain(|job| !job.learns_people_first());
        }
        let progress = Progress::new("evaluating", Some((people.len() * jobs.len()) as u64));
        let mut done = 0;
        for entries in people {
            let name = subject::name(entries);
            let open: Vec<Job> = jobs
                .iter()
                .filter(|job| !self.rows.iter().any(|row| row.is_of(job, &name)))
                .copied()
                .collect();
            done += (jobs.len() - open.len()) as u64;
            progress.advance(done);
            if open.is_empty() {
                continue;
            }
            let subject = Subject::load(&self.dataset, entries, self.circumstances.test_frames)?;
            for job in open {
                progress.say(format!(
                    "{name}: {}, {}",
                    job.table.name(),
                    job.method.name()
                ));
                let rows = self.row(&job, &subject)?;
                if interrupt::requested() {
                    return Ok(());
                }
                self.rows.extend(rows);
                self.keep()?;
                done += 1;
                progress.advance(done);
            }
        }
        progress.finish();
        Ok(())
    }

    fn has_training_people(&self) -> bool {
        let sequences = &self.dataset.manifest().sequences;
        sequences
            .iter()
            .any(|entry| entry.plan.split == Split::Train)
    }

    /// Makes an avatar and judges it: a row for each task that has frames.
    fn row(&mut self, job: &Job, subject: &Subject) -> anyhow::Result<Vec<Row>> {
        let body = builtin::body();
        let pretrained = if job.learns_people_first() {
            let how = (&self.settings, self.clock);
            Some(self.school.taught(job.method, &self.dataset, &body, how)?)
        } else {
            None
        };
        let Self { settings, clock, .. } = self;
        let given = Given { subject, body: &body, settings, pretrained, clock: *clock };
        let outcome = fit(job, &given)?;
        if interrupt::requested() {
            return Ok(Vec::new());
        }
        judge(job, &outcome, subject)
    }

    /// Characters of other makers through the whole chain.
    fn strangers(&mut self) -> anyhow::Result<()> {
        let methods = &self.args.methods;
        // They have these two rows and no others.
        let asked = [Method::BareBody, Method::Effigy];
        if !methods.is_empty() && !asked.iter().any(|method| methods.contains(method)) {
            return Ok(());
        }
        for path in strangers::files(self.args.quick) {
            let name = strangers::name(&path);
            if !self.args.wants(&name) {
                continue;
            }
            let is_done = |row: &Row| row.table == Table::Strangers && row.subject == name;
            if self.rows.iter().any(is_done) {
                continue;
            }
            let rows = strangers::rows(&path, self.args.config.as_deref())?;
            if interrupt::requested() {
                return Ok(());
            }
            self.rows.extend(rows);
            self.keep()?;
        }
        Ok(())
    }

    fn keep(&self) -> anyhow::Result<()> {
        match &self.args.json {
            Some(path) => rows::write(path, &self.circumstances, &self.rows),
            None => Ok(()),
        }
    }

    fn finish(&self) -> anyhow::Result<()> {
        self.keep()?;
        let table = markdown(&self.rows) + &bars::markdown(&self.rows);
        say!("{}", table.trim_end());
        match &self.args.md {
            Some(path) => files::write(path, table),
            None => Ok(()),
        }
    }
}
