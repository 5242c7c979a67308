//! `report.json`: what a run measured. Keys are explained in `docs/report.md`.

use std::{collections::BTreeMap, fmt, path::Path};

use serde::Serialize;

use crate::{files, machine::Machine};

/// Changes when a key changes its meaning.
pub(crate) const SCHEMA: &str = "effigy.report/1";

#[derive(Clone, Debug, Serialize)]
pub(crate) struct Report {
    pub(crate) schema: &'static str,
    pub(crate) source: String,
    pub(crate) machine: Machine,
    pub(crate) seconds_total: f64,
    pub(crate) peak_memory_mb: Option<f64>,
    pub(crate) frames: FrameCounts,
    /// From the program's start to the first tracked body.
    pub(crate) start_up_secs: Option<f64>,
    pub(crate) time_to_first_track_secs: Option<f64>,
    pub(crate) tracked_fraction: Option<f64>,
    pub(crate) keyframes: usize,
    /// How many were made: the first one, and better ones after it.
    pub(crate) avatars: usize,
    /// Of the avatar that was driven last.
    pub(crate) fine_tune: Option<FineTuneFigures>,
    /// Of what was driven last.
    pub(crate) drive: Option<DriveFigures>,
    pub(crate) time_to_first_avatar_secs: Option<f64>,
    pub(crate) preview: Option<PreviewScores>,
    pub(crate) latency_ms: Option<Latency>,
    pub(crate) stages_ms: BTreeMap<String, StageTime>,
    pub(crate) body: Option<BodyScores>,
    pub(crate) avatar: Option<SurfaceScores>,
    pub(crate) avatar_tracked: Option<SurfaceScores>,
    pub(crate) bare_body: Option<SurfaceScores>,
    pub(crate) bare_body_tracked: Option<SurfaceScores>,
    pub(crate) truth: Option<SurfaceScores>,
}

#[derive(Clone, Debug, Default, Serialize)]
pub(crate) struct FrameCounts {
    #[serde(rename = "in")]
    pub(crate) delivered: u64,
    pub(crate) tracked: u64,
    /// Somebody was in view, but too little of them to fit a body to.
    pub(crate) partial: u64,
    pub(crate) lost: u64,
    /// By cause.
    pub(crate) dropped: BTreeMap<String, u64>,
    /// Of those that came too late for the chain.
    pub(crate) dropped_while_fine_tuning: u64,
}

#[derive(Clone, Debug, Serialize)]
pub(crate) struct FineTuneFigures {
    /// What computed the steps: "CPU", "AMD Radeon RX 7600".
    pub(crate) device: String,
    /// Why a graphics card that was at hand did not.
    pub(crate) gave_up: Option<String>,
    pub(crate) steps: usize,
    pub(crate) seconds: f64,
    pub(crate) loss: f32,
    pub(crate) held_out_mm: f32,
    /// `None` where the drive evaluates the full field.
    pub(crate) map_p95_mm: Option<f32>,
}

/// What posed the avatar.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct DriveFigures {
    /// "CPU, map"; "AMD Radeon RX 7600, full field".
    pub(crate) device: String,
    /// Why a graphics card that was at hand does not.
    pub(crate) gave_up: Option<String>,
}

/// What was shown before the first avatar.
#[derive(Clone, Copy, Debug, Serialize)]
pub(crate) struct PreviewScores {
    /// From its last keyframe to something that can be driven.
    pub(crate) secs: f64,
    pub(crate) steps: usize,
    pub(crate) map_p95_mm: Option<f32>,
    /// In true poses.
    #[serde(flatten)]
    pub(crate) scores: SurfaceScores,
}

/// From a frame's delivery to its posed body (and avatar, once there is one).
#[derive(Clone, Copy, Debug, Serialize)]
pub(crate) struct Latency {
    pub(crate) p50: f64,
    pub(crate) p95: f64,
    pub(crate) p95_while_fine_tuning: Option<f64>,
    /// Of the frames that moved an avatar while none was being made.
    pub(crate) p50_driving: Option<f64>,
    pub(crate) p95_driving: Option<f64>,
}

#[derive(Clone, Copy, Debug, Serialize)]
pub(crate) struct StageTime {
    pub(crate) mean: f64,
    pub(crate) p50: f64,
    pub(crate) p95: f64,
}

/// The tracked body against the true one.
#[derive(Clone, Copy, Debug, Serialize)]
pub(crate) struct BodyScores {
    pub(crate) mpjpe_mm: f64,
    pub(crate) v2v_mm: f64,
}

/// A surface against the true one; definitions: `effigy_avatar::metrics`.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub(crate) struct SurfaceScores {
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) observed_mm: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) d_p_cm: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) d_f_cm: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) nc: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) p2s_mm: Option<f64>,
}

impl Report {
    pub(crate) fn write(&self, path: &Path) -> anyhow::Result<()> {
        files::write_json(path, self)
    }
}

/// The lines that a person wants to see at the end.
impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let counts = &self.frames;
        writeln!(f, "frames      {counts}")?;
        for (cause, count) in &counts.dropped {
            writeln!(f, "            {count} dropped: {cause}")?;
        }
        for (stage, time) in &self.stages_ms {
            writeln!(
                f,
                "{stage:<11} {:.1} ms p50, {:.1} ms p95",
                time.p50, time.p95
            )?;
        }
        if let Some(latency) = &self.latency_ms {
            writeln!(f, "latency     {latency}")?;
        }
        if let Some(tune) = &self.fine_tune {
            writeln!(
                f,
                "fine-tuning {} steps in {:.1} s on {}, {:.1} mm held out; {} avatars made",
                tune.steps, tune.seconds, tune.device, tune.held_out_mm, self.avatars
            )?;
            if let Some(reason) = &tune.gave_up {
                writeln!(f, "            no graphics card: {reason}")?;
            }
        }
        if let Some(DriveFigures { device, gave_up }) = &self.drive {
            writeln!(f, "driven by   {device}")?;
            if let Some(reason) = gave_up {
                writeln!(f, "            no graphics card: {reason}")?;
            }
        }
        if let Some(body) = &self.body {
            writeln!(
                f,
                "body        MPJPE {:.1} mm, V2V {:.1} mm",
                body.mpjpe_mm, body.v2v_mm
            )?;
        }
        if let Some(PreviewScores { secs, steps, scores, .. }) = &self.preview {
            writeln!(
                f,
                "preview     after {secs:.1} s and {steps} steps  {scores}"
            )?;
        }
        for (name, scores) in [
            ("avatar", self.avatar),
            ("  tracked", self.avatar_tracked),
            ("bare body", self.bare_body),
            ("  tracked", self.bare_body_tracked),
            ("truth", self.truth),
        ] {
            if let Some(scores) = scores.filter(SurfaceScores::has_figures) {
                writeln!(f, "{name:<11} {scores}")?;
            }
        }
        write!(f, "in all      {:.1} s", self.seconds_total)
    }
}

impl fmt::Display for FrameCounts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} in, {} tracked", self.delivered, self.tracked)?;
        for (count, what) in [
            (self.partial, "with too little of a person in view"),
            (self.lost, "without a person"),
        ] {
            if count > 0 {
                write!(f, ", {count} {what}")?;
            }
        }
        if self.tracked == 0 && self.delivered > 0 {
            let remedy = if self.partial > 0 {
                "step back until head and feet are in view"
            } else {
                "stand 1 to 4 m from the sensor, upright, with some room around you"
            };
            let what = if self.partial > 0 {
                "no whole body was in view"
            } else {
                "nobody was found"
            };
            write!(f, "\n            {what}: {remedy}")?;
        }
        Ok(())
    }
}

impl fmt::Display for Latency {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.1} ms p50, {:.1} ms p95", self.p50, self.p95)?;
        let driving = self.p50_driving.zip(self.p95_driving);
        if let Some((p50, p95)) = driving {
            write!(f, "; avatar driven {p50:.1} ms p50, {p95:.1} ms p95")?;
        }
        if let Some(p95) = self.p95_while_fine_tuning {
            write!(f, "; while fine-tuning {p95:.1} ms p95")?;
        }
        Ok(())
    }
}

impl SurfaceScores {
    /// Name, value and unit of each.
    fn figures(&self) -> [(&'static str, Option<f64>, &'static str); 5] {
        [
            ("observed", self.observed_mm, "mm"),
            ("D_p", self.d_p_cm, "cm"),
            ("D_f", self.d_f_cm, "cm"),
            ("NC", self.nc, ""),
            ("P2S", self.p2s_mm, "mm"),
        ]
    }

    fn has_figures(&self) -> bool {
        self.figures().iter().any(|(_, value, _)| value.is_some())
    }
}

impl fmt::Display for SurfaceScores {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (name, value, unit) in self.figures() {
            if let Some(value) = value {
                write!(f, "{name} {value:.3} {unit}  ")?;
            }
        }
        Ok(())
    }
}
