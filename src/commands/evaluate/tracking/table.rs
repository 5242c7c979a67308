//! The figures: a row for each sensor and outfit, and beneath them each person's run.

use std::fmt;

use serde::Serialize;

use super::{
    real::RealRow,
    score::{BodyErrors, CaseScores, FrameScore, State},
    statistics::{mean, percentile, root_mean_square, share},
    suite::{Case, Purpose},
    variant::Variant,
};

/// A joint within this of the true one is a hit.
const HIT_MM: f32 = 100.0;
/// A loss must be over this soon.
const REACQUIRED_WITHIN_SECS: f32 = 0.5;
/// A person never found again counts as this late.
const NEVER_SECS: f32 = 99.0;

/// What an evaluation found.
#[derive(Clone, Debug, Default, Serialize)]
pub(crate) struct Table {
    rows: Vec<Row>,
    runs: Vec<Run>,
    real: Vec<RealRow>,
}

/// One sensor and outfit; figures that nothing was measured for are `null`.
#[derive(Clone, Debug, Default, Serialize)]
struct Row {
    variant: &'static str,
    suite: &'static str,
    sensor: &'static str,
    outfit: &'static str,
    frames: usize,
    /// Over all 24 joints, over those the camera could see, and over all vertices.
    mpjpe_mm: Option<f64>,
    mpjpe_observed_mm: Option<f64>,
    v2v_mm: Option<f64>,
    /// 99th percentile of observed joints' errors.
    p99_mm: Option<f64>,
    /// Of observed joints and of all joints; a frame without a track misses all.
    hit_rate_100mm: Option<f64>,
    hit_rate_all_100mm: Option<f64>,
    lost_fraction: Option<f64>,
    swapped_fraction: Option<f64>,
    losses: usize,
    noticed_p95_secs: Option<f64>,
    reacquire_p95_secs: Option<f64>,
    reacquired_fraction: Option<f64>,
    /// Of the frames in which there was no body, or none where it was said to be.
    false_tracked_fraction: Option<f64>,
    jitter_mm: Option<f64>,
    /// The same two figures after smoothing as the settings say.
    jitter_smooth_mm: Option<f64>,
    mpjpe_smooth_mm: Option<f64>,
    height_error_mm: Option<f64>,
    /// Processor time of cleaning and tracking where a body was followed.
    ms_p50: Option<f64>,
    ms_p99: Option<f64>,
    /// Of frames in which a body was found.
    find_ms_p95: Option<f64>,
}

/// One person's run.
#[derive(Clone, Debug, Serialize)]
struct Run {
    motion: String,
    person: u64,
    #[serde(flatten)]
    figures: Row,
}

impl Table {
    /// Rows in the order in which their first case comes.
    pub(super) fn new<'a>(
        variant: Variant,
        scored: impl Iterator<Item = (&'a Case, CaseScores)>,
    ) -> Self {
        let scored: Vec<(&Case, CaseScores)> = scored.collect();
        let mut keys: Vec<Key> = Vec::new();
        for (case, _) in &scored {
            if !keys.contains(&Key::of(case)) {
                keys.push(Key::of(case));
            }
        }
        let variant = variant.name();
        let of_key = |key: &Key| {
            let members = scored.iter().filter(|(case, _)| Key::of(case) == *key);
            Row::new(
                (variant, key),
                &members
                    .map(|(case, scores)| (*case, scores))
                    .collect::<Vec<_>>(),
            )
        };
        let run = |(case, scores): &(&Case, CaseScores)| Run {
            motion: case.motion_name(),
            person: case.scenario.seed,
            figures: Row::new((variant, &Key::of(case)), &[(*case, scores)]),
        };
        Self {
            rows: keys.iter().map(of_key).collect(),
            runs: scored.iter().map(run).collect(),
            real: Vec::new(),
        }
    }

    pub(super) fn of_real_people(real: Vec<RealRow>) -> Self {
        Self { real, ..Self::default() }
    }

    pub(crate) fn append(&mut self, other: Self) {
        self.rows.extend(other.rows);
        self.runs.extend(other.runs);
        self.real.extend(other.real);
    }
}

/// What a row is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Key {
    suite: &'static str,
    sensor: &'static str,
    outfit: &'static str,
}

impl Key {
    fn of(case: &Case) -> Self {
        Self { suite: case.suite, sensor: case.scenario.sensor.name(), outfit: case.wears() }
    }
}

impl Row {
    fn new((variant, key): (&'static str, &Key), cases: &[(&Case, &CaseScores)]) -> Self {
        let row = Self {
            variant,
            suite: key.suite,
            sensor: key.sensor,
            outfit: key.outfit,
            frames: cases.iter().map(|(_, scores)| scores.frames.len()).sum(),
            jitter_mm: jitter_mm(cases, |frame| frame.errors.as_ref()),
            jitter_smooth_mm: jitter_mm(cases, |frame| frame.smooth_errors.as_ref()),
            height_error_mm: mean(
                cases
                    .iter()
                    .filter_map(|(_, scores)| scores.height_error_m)
                    .map(|m| m.abs() * 1e3),
            ),
            ..Self::default()
        };
        let watched: Vec<&FrameScore> = cases
            .iter()
            .filter(|(case, _)| !matches!(case.purpose, Purpose::Losses(_)))
            .flat_map(|(_, scores)| &scores.frames)
            .collect();
        row.with_accuracy(&watched)
            .with_losses(cases)
            .with_times(cases)
    }

    fn with_accuracy(self, frames: &[&FrameScore]) -> Self {
        let errors = || frames.iter().filter_map(|frame| frame.errors.as_ref());
        let observed = || frames.iter().flat_map(|frame| observed_mm(frame));
        let hits = |mm: f32| mm < HIT_MM;
        Self {
            mpjpe_mm: mean(
                frames
                    .iter()
                    .flat_map(|frame| all_mm(frame))
                    .filter(|mm| mm.is_finite()),
            ),
            mpjpe_smooth_mm: mean(
                frames
                    .iter()
                    .filter_map(|frame| frame.smooth_errors.as_ref())
                    .flat_map(|errors| errors.joints_mm),
            ),
            mpjpe_observed_mm: mean(observed().filter(|mm| mm.is_finite())),
            v2v_mm: mean(errors().filter_map(|errors| errors.v2v_mm)),
            p99_mm: percentile(observed().filter(|mm| mm.is_finite()), 0.99),
            hit_rate_100mm: share(observed(), hits),
            hit_rate_all_100mm: share(frames.iter().flat_map(|frame| all_mm(frame)), hits),
            lost_fraction: share(frames, |frame| !frame.truly_tracked()),
            swapped_fraction: share(errors(), |errors: &BodyErrors| errors.swapped),
            ..self
        }
    }

    fn with_losses(self, cases: &[(&Case, &CaseScores)]) -> Self {
        let losses = || cases.iter().flat_map(|(_, scores)| &scores.losses);
        let back = || losses().map(|loss| loss.reacquired_secs.unwrap_or(NEVER_SECS));
        let lost_frames = cases
            .iter()
            .flat_map(|(_, scores)| &scores.frames)
            .filter(|frame| frame.truly_lost());
        Self {
            losses: losses().count(),
            noticed_p95_secs: percentile(
                losses().map(|loss| loss.noticed_secs.unwrap_or(NEVER_SECS)),
                0.95,
            ),
            reacquire_p95_secs: percentile(back(), 0.95),
            reacquired_fraction: share(back(), |secs| secs <= REACQUIRED_WITHIN_SECS),
            false_tracked_fraction: share(lost_frames, |frame: &FrameScore| {
                frame.state == State::Tracked
            }),
            ..self
        }
    }

    fn with_times(self, cases: &[(&Case, &CaseScores)]) -> Self {
        let (mut following, mut finding) = (Vec::new(), Vec::new());
        for (_, scores) in cases {
            let mut followed = false;
            for frame in &scores.frames {
                let tracked = frame.state == State::Tracked;
                match (followed, tracked) {
                    (true, true) => following.push(frame.milliseconds),
                    (false, true) => finding.push(frame.milliseconds),
                    (_, false) => {}
                }
                followed = tracked;
            }
        }
        Self {
            ms_p50: percentile(following.iter().copied(), 0.5),
            ms_p99: percentile(following, 0.99),
            find_ms_p95: percentile(finding, 0.95),
            ..self
        }
    }
}

/// Errors of the joints the camera could see; infinite where there is no track.
fn observed_mm(frame: &FrameScore) -> Vec<f32> {
    errors_mm(frame, &frame.observed)
}

/// Errors of all joints there is a truth about.
fn all_mm(frame: &FrameScore) -> Vec<f32> {
    errors_mm(frame, &frame.measured)
}

fn errors_mm(frame: &FrameScore, which: &[bool]) -> Vec<f32> {
    let error = |joint: usize| {
        frame
            .errors
            .as_ref()
            .map_or(f32::INFINITY, |errors| errors.joints_mm[joint])
    };
    (0..which.len())
        .filter(|&joint| which[joint])
        .map(error)
        .collect()
}

fn jitter_mm(
    cases: &[(&Case, &CaseScores)],
    errors: fn(&FrameScore) -> Option<&BodyErrors>,
) -> Option<f64> {
    let still = cases
        .iter()
        .filter(|(case, _)| case.purpose == Purpose::Stillness);
    root_mean_square(still.flat_map(|(_, scores)| wrist_jitter_mm(&scores.frames, errors)))
}

/// How far each wrist's error strays from its mean within a second, in the last seconds of a stand: what a steady
/// offset adds is not jitter, and neither is the person's own swaying.
fn wrist_jitter_mm(frames: &[FrameScore], of: fn(&FrameScore) -> Option<&BodyErrors>) -> Vec<f32> {
    const WINDOW: usize = 30;
    const WINDOWS: usize = 2;
    let tail = frames.len().saturating_sub(WINDOW * WINDOWS);
    let mut strays = Vec::new();
    for window in frames[tail..].chunks_exact(WINDOW) {
        for side in 0..2 {
            let errors: Vec<_> = window
                .iter()
                .filter_map(of)
                .map(|errors| errors.wrists_mm[side])
                .collect();
            let middle = errors.iter().sum::<glam::Vec3>() / errors.len().max(1) as f32;
            strays.extend(errors.iter().map(|error| error.distance(middle)));
        }
    }
    strays
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:<60}", "")?;
        for column in Row::default().columns() {
            write!(f, "{:>9}", column.title)?;
        }
        writeln!(f)?;
        for row in &self.rows {
            row.write_line(f, &row.name())?;
        }
        writeln!(f)?;
        for Run { motion, person, figures } in &self.runs {
            figures.write_line(f, &format!("{} {motion} {person}", figures.name()))?;
        }
        for row in &self.real {
            writeln!(f, "{}", row.line())?;
        }
        Ok(())
    }
}

struct Column {
    title: &'static str,
    value: Option<f64>,
    decimals: usize,
}

impl Row {
    fn name(&self) -> String {
        let Self { variant, sensor, outfit, .. } = self;
        if *variant == Variant::Default.name() {
            format!("{sensor} {outfit}")
        } else {
            format!("{variant} {sensor} {outfit}")
        }
    }

    fn columns(&self) -> [Column; 20] {
        let of = |title, value, decimals| Column { title, value, decimals };
        [
            of("mpjpe", self.mpjpe_mm, 1),
            of("observed", self.mpjpe_observed_mm, 1),
            of("v2v", self.v2v_mm, 1),
            of("p99", self.p99_mm, 0),
            of("hits", self.hit_rate_100mm, 3),
            of("hits all", self.hit_rate_all_100mm, 3),
            of("lost", self.lost_fraction, 3),
            of("swapped", self.swapped_fraction, 3),
            of("noticed", self.noticed_p95_secs, 2),
            of("found", self.reacquire_p95_secs, 2),
            of("in time", self.reacquired_fraction, 2),
            of("false", self.false_tracked_fraction, 3),
            of("jitter", self.jitter_mm, 1),
            of("smooth", self.jitter_smooth_mm, 1),
            of("mpjpe s", self.mpjpe_smooth_mm, 1),
            of("height", self.height_error_mm, 0),
            of("ms p50", self.ms_p50, 1),
            of("ms p99", self.ms_p99, 1),
            of("find ms", self.find_ms_p95, 0),
            of("frames", Some(self.frames as f64), 0),
        ]
    }

    fn write_line(&self, f: &mut fmt::Formatter<'_>, name: &str) -> fmt::Result {
        write!(f, "{name:<60}")?;
        for Column { value, decimals, .. } in self.columns() {
            match value {
                Some(value) => write!(f, "{value:>9.decimals$}")?,
                None => write!(f, "{:>9}", "-")?,
            }
        }
        writeln!(f)
    }
}
