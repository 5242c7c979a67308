//! MetaAvatar's protocol on our test people: eight single views in true poses, then frames nobody has seen.

mod method;
pub(crate) mod subject;

use std::{fmt::Write as _, path::Path};

use effigy_registration::smpl::builtin;
use effigy_sim_sensor::dataset::Dataset;
use serde::Serialize;

use self::{
    method::{Fitted, Method, fit},
    subject::{Subject, Task, test_people},
};
use crate::{
    cli::EvaluateAvatarArgs,
    files, interrupt,
    machine::Machine,
    pipeline::{clock::Clock, evaluate::ScoreSum, settings::Settings},
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
    for file in args.json.iter().chain(&args.md) {
        files::check_writable(file)?;
    }
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
    if let Some(path) = &args.json {
        files::write_json(path, &report)?;
    }
    if let Some(path) = &args.md {
        files::write(path, table)?;
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
        let mut sum = ScoreSum::default();
        for test in subject.tests.iter().filter(|test| test.task == task) {
            sum.add(&test.truth, &test.measured, &fitted.posed(&test.params))?;
        }
        let Some(mean) = sum.mean() else {
            continue;
        };
        rows.push(Row {
            table: "few-shot",
            method,
            data: format!("{} frames", subject.keyframes.len()),
            poses: "true",
            sensor: "noiseless",
            outfit: subject.outfit.clone(),
            subject: subject.name.clone(),
            task,
            frames: sum.frames,
            d_p_cm: mean.d_p_cm,
            d_f_cm: mean.d_f_cm,
            nc: mean.nc,
            p2s_mm: mean.p2s_mm,
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
