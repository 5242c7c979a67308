//! What an avatar is worth: every test frame's surface against the truth.

use effigy_avatar::rendered::{RenderedNormals, rendered_normals};

use super::{
    method::Outcome,
    plan::{Data, Job},
    rows::{Row, Scores},
    subject::{Subject, Task},
};
use crate::pipeline::evaluate::ScoreSum;

/// A row for each task that has frames.
pub(super) fn judge(job: &Job, outcome: &Outcome, subject: &Subject) -> anyhow::Result<Vec<Row>> {
    let mut rows = Vec::new();
    for task in [Task::Interpolation, Task::Extrapolation] {
        let mut sum = ScoreSum::default();
        let mut looks = Looks::default();
        for test in subject.tests.iter().filter(|test| test.task == task) {
            let predicted = outcome.fitted.posed(&test.params);
            sum.add(&test.truth, &test.measured, &predicted)?;
            if task == Task::Extrapolation {
                looks.add(rendered_normals(&test.truth, &predicted));
            }
        }
        if subject.tests.iter().all(|test| test.task != task) {
            continue;
        }
        // Without a surface there is nothing to measure, which is a result.
        let mean = sum.mean();
        let [normals_deg, fine_ratio, fine_correlation] = looks.means();
        rows.push(Row {
            table: job.table,
            method: job.method,
            data: match job.data {
                Data::Few => format!("{} frames", outcome.asked),
                Data::Percent(percent) => format!("{percent} %"),
            },
            poses: job.poses,
            sensor: job.camera.name().to_owned(),
            keyframes: job.keyframes,
            outfit: subject.outfit.clone(),
            subject: subject.name.clone(),
            task,
            seed: job.seed,
            learned_from: outcome.learned_from,
            frames: sum.frames,
            scores: Scores {
                d_p_cm: mean.map(|mean| mean.d_p_cm),
                d_f_cm: mean.map(|mean| mean.d_f_cm),
                nc: mean.map(|mean| mean.nc),
                p2s_mm: mean.map(|mean| mean.p2s_mm),
                normals_deg,
                fine_ratio,
                fine_correlation,
                observed_mm: None,
            },
            seconds: outcome.seconds,
            history_floor_cm: subject.history_floor_cm,
        });
    }
    Ok(rows)
}

/// Sums over frames of what rendered normals say.
#[derive(Default)]
struct Looks {
    sums: [f64; 3],
    frames: usize,
}

impl Looks {
    fn add(&mut self, frame: Option<RenderedNormals>) {
        let Some(RenderedNormals { off_deg, fine_ratio, fine_correlation }) = frame else {
            return;
        };
        let values = [off_deg, fine_ratio, fine_correlation];
        for (sum, value) in self.sums.iter_mut().zip(values) {
            *sum += f64::from(value);
        }
        self.frames += 1;
    }

    fn means(&self) -> [Option<f64>; 3] {
        self.sums
            .map(|sum| (self.frames > 0).then(|| sum / self.frames as f64))
    }
}
