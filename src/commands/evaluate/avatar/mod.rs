//! MetaAvatar's protocol on our test people: eight single views in true poses, then frames nobody has seen.

mod method;
mod subject;

use std::{fmt::Write as _, fs, path::Path};

use anyhow::Context as _;
use effigy_avatar::metrics;
use effigy_registration::smpl::builtin;
use effigy_sim_sensor::dataset::Dataset;
use serde::Serialize;

use self::{
    method::{Fitted, Method, fit},
    subject::{Subject, Task, test_people},
};
use crate::{
    cli::EvaluateAvatarArgs,
    interrupt,
    machine::Machine,
    pipeline::{clock::Clock, settings::Settings},
    progress::Progress,
};

/// Changes when a key changes its meaning.
const SCHEMA: &str = "effigy.evaluate.metavatar/1";

/// Of a quick look.
const QUICK_TEST_FRAMES: usize = 2;

#[derive(Serialize)]
struct Report<'a> {
    schema: &'static str,
    machine: Machine,
    quick: bool,
    rows: &'a [Row],
}

/// One method on one person in one outfit, for one task: means over the frames.
#[derive(Clone, Debug, Serialize)]
struct Row {
    table: &'static str,
    method: Method,
    data: String,
    poses: &'static str,
    sensor: &'static str,
    outfit: String,
    subject: String,
    task: Task,
    frames: usize,
    d_p_cm: f64,
    d_f_cm: f64,
    nc: f64,
    p2s_mm: f64,
    /// Fitting, once for both tasks.
    seconds: f64,
}

pub(super) fn run(args: &EvaluateAvatarArgs, data: &Path) -> anyhow::Result<()> {
    let clock = Clock::start();
    let body = builtin::body();
    let settings = Settings::load(args.config.as_deref())?;
    let dataset = Dataset::open(data, &body)?;
    let mut people = test_people(&dataset);
    if args.quick {
        people.truncate(1);
    }
    let tests = if args.quick {
        QUICK_TEST_FRAMES
    } else {
        args.test_frames
    };
    let methods = Method::ALL;
    let progress = Progress::new("evaluating", Some((people.len() * methods.len()) as u64));
    let mut rows = Vec::new();
    let mut done = 0;
    for entries in people.iter().take_while(|_| !interrupt::requested()) {
        let counts = (settings.keyframes.count, tests);
        let subject = Subject::load(&dataset, entries, counts, &settings)?;
        for method in methods {
            progress.say(format!("{} {}", subject.name, method.name()));
            let start = clock.secs();
            let fitted = fit(method, &subject, &body, &settings, clock)?;
            let seconds = clock.secs() - start;
            if interrupt::requested() {
                break;
            }
            rows.extend(judge(&fitted, method, &subject, seconds)?);
            done += 1;
            progress.advance(done);
        }
    }
    progress.finish();
    let table = markdown(&rows);
    print!("{table}");
    let report =
        Report { schema: SCHEMA, machine: Machine::this(), quick: args.quick, rows: &rows };
    let text = serde_json::to_string_pretty(&report).context("figures are plain data")?;
    for (path, text) in [(&args.json, text + "\n"), (&args.md, table)] {
        if let Some(path) = path {
            fs::write(path, text).with_context(|| {
                format!("{}: cannot write; is the folder there?", path.display())
            })?;
        }
    }
    Ok(())
}

/// A row for each task that has frames.
fn judge(
    fitted: &Fitted,
    method: Method,
    subject: &Subject,
    seconds: f64,
) -> anyhow::Result<Vec<Row>> {
    let mut rows = Vec::new();
    for task in [Task::Interpolation, Task::Extrapolation] {
        let mut sums = [0.0_f64; 4];
        let mut frames = 0;
        for test in subject.tests.iter().filter(|test| test.task == task) {
            let predicted = fitted.posed(&test.params);
            let scores = metrics::surface_metrics(&test.truth, &test.measured, &predicted)?;
            let Some(scores) = scores else { continue };
            let p2s_mm = metrics::p2s_mm(&test.truth, &predicted)?;
            let values = [scores.d_p_cm, scores.d_f_cm, scores.nc, p2s_mm];
            for (sum, value) in sums.iter_mut().zip(values) {
                *sum += f64::from(value);
            }
            frames += 1;
        }
        if frames == 0 {
            continue;
        }
        let mean = sums.map(|sum| sum / frames as f64);
        rows.push(Row {
            table: "few-shot",
            method,
            data: format!("{} frames", subject.keyframes.len()),
            poses: "true",
            sensor: "noiseless",
            outfit: subject.outfit.clone(),
            subject: subject.name.clone(),
            task,
            frames,
            d_p_cm: mean[0],
            d_f_cm: mean[1],
            nc: mean[2],
            p2s_mm: mean[3],
            seconds,
        });
    }
    Ok(rows)
}

fn markdown(rows: &[Row]) -> String {
    let mut text = String::from(
        "| person and outfit | task | method | D_p, cm | D_f, cm | NC | P2S, mm | fitting, s |\n\
         |---|---|---|---|---|---|---|---|\n",
    );
    for row in rows {
        let task = match row.task {
            Task::Interpolation => "interpolation",
            Task::Extrapolation => "extrapolation",
        };
        let _written = writeln!(
            text,
            "| {} | {task} | {} | {:.3} | {:.3} | {:.3} | {:.2} | {:.1} |",
            row.subject,
            row.method.name(),
            row.d_p_cm,
            row.d_f_cm,
            row.nc,
            row.p2s_mm,
            row.seconds,
        );
    }
    text
}
