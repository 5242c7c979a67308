//! What a training shows while it runs: a bar, a curve, and a picture for each validation.

use std::{
    ops::ControlFlow,
    path::{Path, PathBuf},
};

use effigy_avatar::{
    hyper::HyperNetwork,
    mesher,
    meta::{PriorProgress, Stage, TrainEvent, Validated},
};
use effigy_fusion::TriangleMesh;
use effigy_viewer::pictures::ContactSheet;

use super::{curve::Curve, held_out::Judge};
use crate::{commands::dataset::drawn, interrupt, progress::Progress};

const TILE_PX: [u32; 2] = [300, 360];
/// Of the pictures' meshes: cells of about 1.5 cm.
const RESOLUTION: usize = 128;

pub(super) struct Reporter<'a> {
    out: PathBuf,
    judges: &'a [Judge],
    curve: Curve,
    bar: Option<(Stage, Progress)>,
    held_out_mm: Option<f64>,
    problem: Option<anyhow::Error>,
}

impl<'a> Reporter<'a> {
    pub(super) fn new(out: &Path, judges: &'a [Judge]) -> Self {
        Self {
            out: out.to_owned(),
            judges,
            curve: Curve::default(),
            bar: None,
            held_out_mm: None,
            problem: None,
        }
    }

    pub(super) fn take(&mut self, event: &TrainEvent<'_>) -> ControlFlow<()> {
        match event {
            TrainEvent::Step(now) => self.step(now),
            TrainEvent::Validated(now, validated) => {
                self.held_out_mm = Some(validated.held_out_mm);
                self.curve.add_held_out(now, validated.held_out_mm);
                let taught = validated
                    .taught_mm
                    .map_or_else(String::new, |mm| format!(", taught {mm:.3} mm"));
                eprintln!(
                    "{:?} {}/{}: held out {:.3} mm{taught}",
                    now.stage, now.step, now.steps, validated.held_out_mm
                );
                let shown = self
                    .curve
                    .write(&self.out)
                    .and_then(|()| self.picture(now, validated));
                if let Err(problem) = shown {
                    self.problem = Some(problem);
                    return ControlFlow::Break(());
                }
            }
            TrainEvent::EndsEarly(now) => eprintln!(
                "{:?} ends early at {}/{}: the held-out error has not fallen for a while",
                now.stage, now.step, now.steps
            ),
        }
        if interrupt::requested() {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    }

    /// Ends the bar and writes the whole curve; what could not be written.
    pub(super) fn finish(self) -> anyhow::Result<()> {
        if let Some((_, bar)) = &self.bar {
            bar.finish();
        }
        self.problem.map_or(Ok(()), Err)?;
        self.curve.write(&self.out)
    }

    fn step(&mut self, now: &PriorProgress) {
        if self
            .bar
            .as_ref()
            .is_none_or(|(stage, _)| *stage != now.stage)
        {
            let what = match now.stage {
                Stage::Field => "field",
                Stage::Joint => "hypernet",
                Stage::Adapt => "adapting",
            };
            self.bar = Some((now.stage, Progress::new(what, Some(now.steps.into()))));
        }
        self.curve.add_loss(now);
        if let Some((_, bar)) = &self.bar {
            let held_out = self
                .held_out_mm
                .map_or_else(String::new, |mm| format!(", held out {mm:.2} mm"));
            bar.say(format!("loss {:.2}{held_out}", now.loss));
            bar.advance(now.step.into());
        }
    }

    /// Each judge's true surface, and the one that a short fine-tuning gives.
    fn picture(&self, now: &PriorProgress, validated: &Validated) -> anyhow::Result<()> {
        let mut sheet = ContactSheet::new(4);
        for (judge, network) in self.judges.iter().zip(&validated.tuned) {
            sheet = sheet
                .add(judge.name.clone(), drawn(&judge.truth_in_star, TILE_PX))
                .add(
                    "fine-tuned".to_owned(),
                    drawn(&learned(judge, network), TILE_PX),
                );
        }
        let stage = format!("{:?}", now.stage).to_lowercase();
        sheet.save(
            &self
                .out
                .with_extension(format!("{stage}-{:05}.png", now.step)),
        )?;
        Ok(())
    }
}

/// In star pose, metres.
fn learned(judge: &Judge, network: &HyperNetwork) -> TriangleMesh {
    let Some(frame) = judge.held_out.judged.first() else {
        return TriangleMesh::default();
    };
    let mut mesh = mesher::extract(&network.field(&frame.pose), RESOLUTION);
    let unit_box = &judge.canonicaliser.subject().unit_box;
    for vertex in &mut mesh.vertices {
        *vertex = unit_box.canonical_from_unit(*vertex);
    }
    mesh.compute_normals();
    mesh
}
