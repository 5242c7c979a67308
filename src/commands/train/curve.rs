//! How a training goes, as a picture and a table.

use std::{fmt::Write as _, path::Path};

use effigy_avatar::meta::{PriorProgress, Stage};

use crate::files;

/// Loss and held-out error, step by step.
#[derive(Default)]
pub(super) struct Curve {
    /// Of every so many steps the mean.
    losses: Vec<(Stage, u32, f64)>,
    sum: (f64, u32),
    held_out: Vec<(Stage, u32, f64)>,
}

impl Curve {
    pub(super) fn add_loss(&mut self, now: &PriorProgress) {
        let every = (now.steps / 200).max(1);
        self.sum = (self.sum.0 + now.loss, self.sum.1 + 1);
        if now.step.is_multiple_of(every) {
            self.losses
                .push((now.stage, now.step, self.sum.0 / f64::from(self.sum.1)));
            self.sum = (0.0, 0);
        }
    }

    pub(super) fn add_held_out(&mut self, now: &PriorProgress, held_out_mm: f64) {
        self.held_out.push((now.stage, now.step, held_out_mm));
    }

    /// `OUT.curve.csv` and, for each stage, `OUT.STAGE.svg`.
    pub(super) fn write(&self, out: &Path) -> anyhow::Result<()> {
        let mut csv = String::from("stage,step,loss,held_out_mm\n");
        for &(stage, step, loss) in &self.losses {
            let _written = writeln!(csv, "{stage:?},{step},{loss:.4},");
        }
        for &(stage, step, held_out_mm) in &self.held_out {
            let _written = writeln!(csv, "{stage:?},{step},,{held_out_mm:.4}");
        }
        files::write(&out.with_extension("curve.csv"), csv)?;
        for stage in [Stage::Field, Stage::Joint, Stage::Adapt] {
            let of = |points: &[(Stage, u32, f64)]| -> Vec<(f64, f64)> {
                let of_stage = points.iter().filter(|(s, ..)| *s == stage);
                of_stage.map(|&(_, x, y)| (f64::from(x), y)).collect()
            };
            let (losses, held_out) = (of(&self.losses), of(&self.held_out));
            if !losses.is_empty() {
                let name = format!("{stage:?}.svg").to_lowercase();
                files::write(&out.with_extension(name), svg(&losses, &held_out))?;
            }
        }
        Ok(())
    }
}

/// Two panels above each other, each with its own scale.
fn svg(losses: &[(f64, f64)], held_out: &[(f64, f64)]) -> String {
    const WIDTH: f64 = 640.0;
    const HEIGHT: f64 = 200.0;
    let mut text = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {}\" font-family=\"sans-serif\" font-size=\"12\">\n\
         <rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n",
        2.0 * HEIGHT
    );
    let panels = [
        ("loss", losses, 0.0),
        ("held-out error, mm", held_out, HEIGHT),
    ];
    for (title, points, top) in panels {
        let Some(&(last, _)) = points.last() else {
            continue;
        };
        let low = points.iter().map(|p| p.1).fold(f64::INFINITY, f64::min);
        let high = points.iter().map(|p| p.1).fold(f64::NEG_INFINITY, f64::max);
        let span = (high - low).max(1e-9);
        let places: Vec<String> = points
            .iter()
            .map(|(x, y)| {
                let right = 60.0 + x / last.max(1.0) * (WIDTH - 80.0);
                let down = top + 24.0 + (high - y) / span * (HEIGHT - 48.0);
                format!("{right:.1},{down:.1}")
            })
            .collect();
        let _written = writeln!(
            text,
            "<text x=\"60\" y=\"{}\">{title}, {last} steps</text>\n\
             <text x=\"4\" y=\"{}\">{high:.3}</text><text x=\"4\" y=\"{}\">{low:.3}</text>\n\
             <polyline fill=\"none\" stroke=\"#1f6f8b\" stroke-width=\"1.5\" points=\"{}\"/>",
            top + 14.0,
            top + 28.0,
            top + HEIGHT - 20.0,
            places.join(" ")
        );
    }
    text + "</svg>\n"
}
