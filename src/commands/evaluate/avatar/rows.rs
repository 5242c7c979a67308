//! What is printed and kept: a row for each avatar and task, and which rows are there already.

use std::{fmt::Write as _, fs, io, path::Path};

use anyhow::{Context as _, ensure};
use serde::{Deserialize, Serialize};

use super::{
    plan::{Data, Job, Keyframes, Method, Poses, Table},
    subject::Task,
};
use crate::{files, machine::Machine};

/// Changes when a key changes its meaning.
const SCHEMA: &str = "effigy.evaluate.metavatar/2";

/// One method on one person in one outfit, for one task: means over the frames.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Row {
    pub(crate) table: Table,
    pub(crate) method: Method,
    /// How much is learned from: `8 frames`, `20 %`, `100 %`.
    pub(crate) data: String,
    /// Of the frames that are learned from; people of the data set are judged in true poses.
    pub(crate) poses: Poses,
    pub(crate) sensor: String,
    pub(crate) keyframes: Keyframes,
    pub(crate) outfit: String,
    pub(crate) subject: String,
    pub(crate) task: Task,
    pub(crate) seed: u64,
    /// Keyframes that were learned from; not all may be tracked.
    pub(crate) learned_from: usize,
    /// Frames that were judged.
    pub(crate) frames: usize,
    #[serde(flatten)]
    pub(crate) scores: Scores,
    /// Canonicalising and learning, once for both tasks.
    pub(crate) seconds: f64,
    /// How far surfaces in one pose lie apart for what went before: no function of the pose can do better.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub(crate) history_floor_cm: Option<f64>,
}

/// What the truth says of people, and depth alone of strangers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Scores {
    pub(crate) d_p_cm: Option<f64>,
    pub(crate) d_f_cm: Option<f64>,
    pub(crate) nc: Option<f64>,
    pub(crate) p2s_mm: Option<f64>,
    /// In place of asking people (extrapolation): mean angle of rendered normals, how much fine structure they have of the
    /// truth's, and how well it correlates.
    pub(crate) normals_deg: Option<f64>,
    pub(crate) fine_ratio: Option<f64>,
    pub(crate) fine_correlation: Option<f64>,
    /// Mean distance of observed points to the driven avatar, in frames that were not learned from.
    pub(crate) observed_mm: Option<f64>,
}

/// What rows depend on besides the program.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Circumstances {
    pub(crate) quick: bool,
    pub(crate) test_frames: usize,
    pub(crate) dataset: String,
    pub(crate) dataset_seed: u64,
    /// How the prior was trained, in its own words.
    pub(crate) prior: String,
    /// SHA-256 of all settings, of the data set's list of files with their checksums, and of the prior.
    pub(crate) inputs: String,
}

#[derive(Serialize)]
struct Report<'a> {
    schema: &'static str,
    machine: Machine,
    #[serde(flatten)]
    circumstances: &'a Circumstances,
    rows: &'a [Row],
}

#[derive(Deserialize)]
struct EarlierReport {
    schema: String,
    #[serde(flatten)]
    circumstances: Circumstances,
    rows: Vec<Row>,
}

impl Row {
    /// Whether this row is a result of the job.
    pub(crate) fn is_of(&self, job: &Job, subject: &str) -> bool {
        let same = (self.table, self.method, self.seed) == (job.table, job.method, job.seed);
        let seen = (self.poses, self.keyframes) == (job.poses, job.keyframes);
        same && seen
            && self.subject == subject
            && self.sensor == job.camera.name()
            && match job.data {
                Data::Few => !self.data.ends_with('%'),
                Data::Percent(percent) => self.data == format!("{percent} %"),
            }
    }
}

/// Rows of an earlier run under the same circumstances; none if there was no run. Rows of others are not thrown away.
pub(crate) fn earlier(path: &Path, now: &Circumstances) -> anyhow::Result<Vec<Row>> {
    let name = || path.display().to_string();
    let text = match fs::read_to_string(path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        read => read.with_context(name)?,
    };
    // Made to see whether it can be written.
    if text.is_empty() {
        return Ok(Vec::new());
    }
    let report: EarlierReport = serde_json::from_str(&text).with_context(|| {
        format!(
            "{}: not a file of this command; name another one with --json",
            name()
        )
    })?;
    ensure!(
        report.schema == SCHEMA && report.circumstances == *now,
        "{}: its rows are of another data set, prior, settings, number of frames or version; name another file with --json, or \
         leave --resume out to write over it",
        name()
    );
    Ok(report.rows)
}

pub(crate) fn write(
    path: &Path,
    circumstances: &Circumstances,
    rows: &[Row],
) -> anyhow::Result<()> {
    let report = Report { schema: SCHEMA, machine: Machine::this(), circumstances, rows };
    files::write_json(path, &report)
}

/// A table for each part that has rows.
pub(crate) fn markdown(rows: &[Row]) -> String {
    let mut text = String::new();
    for table in Table::ALL {
        let of_table: Vec<&Row> = rows.iter().filter(|row| row.table == table).collect();
        if of_table.is_empty() {
            continue;
        }
        let _written = write!(
            text,
            "## {}\n\n\
{}",
            table.name(),
            head(table)
        );
        for row in of_table {
            let _written = writeln!(text, "{}", line(row));
        }
        text.push('\n');
    }
    text
}

fn head(table: Table) -> &'static str {
    if table == Table::Strangers {
        "| character | method | sensor | keyframes | observed, mm | fitting, s |\n|---|---|---|---|---|---|\n"
    } else {
        "| person and outfit | task | method | data | poses | sensor | keyframes | seed | D_p, cm | D_f, cm | NC | P2S, mm \
         | normals, degrees | fine | fine corr. | fitting, s |\n|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|\n"
    }
}

fn line(row: &Row) -> String {
    let Row { subject, data, sensor, seed, scores, seconds, learned_from, .. } = row;
    let method = row.method.name();
    let number = |value: Option<f64>, digits: usize| {
        value.map_or_else(|| "-".to_owned(), |value| format!("{value:.digits$}"))
    };
    if row.table == Table::Strangers {
        let observed = number(scores.observed_mm, 2);
        return format!(
            "| {subject} | {method} | {sensor} | {learned_from} | {observed} | {seconds:.1} |"
        );
    }
    let task = match row.task {
        Task::Interpolation => "interpolation",
        Task::Extrapolation => "extrapolation",
    };
    let poses = match row.poses {
        Poses::True => "true",
        Poses::Fitted => "fitted",
    };
    let keyframes = match row.keyframes {
        Keyframes::Single => "single",
        Keyframes::Snippet => "snippet",
    };
    let figures = [
        number(scores.d_p_cm, 3),
        number(scores.d_f_cm, 3),
        number(scores.nc, 3),
        number(scores.p2s_mm, 2),
        number(scores.normals_deg, 1),
        number(scores.fine_ratio, 2),
        number(scores.fine_correlation, 2),
    ]
    .join(" | ");
    format!(
        "| {subject} | {task} | {method} | {data} | {poses} | {sensor} | {keyframes} | {seed} | {figures} | {seconds:.1} |"
    )
}
