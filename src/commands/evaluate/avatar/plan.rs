//! What is measured: the rows of the paper's tables, and of ours beside them.

use effigy_sim_sensor::SensorPreset;
use serde::{Deserialize, Serialize};

/// Seeds of the headline row.
pub(crate) const HEADLINE_SEEDS: u64 = 3;

/// A part of the evaluation that can be run by itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Table {
    /// Eight noiseless frames in true poses, and whatever else can be made of them.
    FewShot,
    /// More frames.
    Data,
    /// Eight frames of noisy sensors, single and as snippets.
    Sensors,
    /// Eight frames of noisy sensors whose poses our own tracker found.
    Fitted,
    /// Other networks that learn the same from the same.
    Ablation,
    /// Characters of other makers, tracked.
    Strangers,
}

impl Table {
    pub(crate) const ALL: [Self; 6] = [
        Self::FewShot,
        Self::Data,
        Self::Sensors,
        Self::Fitted,
        Self::Ablation,
        Self::Strangers,
    ];

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::FewShot => "few-shot",
            Self::Data => "data",
            Self::Sensors => "sensors",
            Self::Fitted => "fitted",
            Self::Ablation => "ablation",
            Self::Strangers => "strangers",
        }
    }
}

/// What makes an avatar of what was seen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Method {
    /// The minimal body.
    BareBody,
    /// One surface for all poses: the same network, always given the same pose.
    Static,
    /// Occupancy in the manner of LEAP.
    Occupancy,
    /// A distance field in the manner of `SCANimate`.
    Scanimate,
    /// From random parameters instead of the prior, with as many steps.
    NoMetaLearning,
    Effigy,
    /// The same network, fitted to the whole true surface of the very frames it is judged on.
    Oracle,
    /// Ablation: `ReLU` units, told point and quaternions.
    Mlp,
    /// Ablation: the same with positional encoding.
    PositionalEncoding,
    /// Ablation: sines, told point and quaternions.
    Siren,
    /// Ablation: a hypernetwork told quaternions.
    HyperQuaternions,
    /// Ablation: a hypernetwork with the bone encoder, taught as the others are.
    HyperBones,
}

impl Method {
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::BareBody => "bare_body",
            Self::Static => "static",
            Self::Occupancy => "occupancy",
            Self::Scanimate => "scanimate",
            Self::NoMetaLearning => "no_meta_learning",
            Self::Effigy => "effigy",
            Self::Oracle => "oracle",
            Self::Mlp => "mlp",
            Self::PositionalEncoding => "positional_encoding",
            Self::Siren => "siren",
            Self::HyperQuaternions => "hyper_quaternions",
            Self::HyperBones => "hyper_bones",
        }
    }

    /// Those of the ablation, in the paper's order.
    const ABLATION: [Self; 5] = [
        Self::Mlp,
        Self::PositionalEncoding,
        Self::Siren,
        Self::HyperQuaternions,
        Self::HyperBones,
    ];
}

/// How much of the frames that may be learned from is learned from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Data {
    /// As many as the settings say: eight.
    Few,
    /// A share of them in percent.
    Percent(usize),
}

/// What frames are seen with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Camera {
    /// The paper's: 250 x 250 pixels, no noise.
    Paper,
    Sensor(SensorPreset),
}

impl Camera {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Paper => "noiseless",
            Self::Sensor(preset) => preset.name(),
        }
    }
}

/// Whose poses the frames have that are learned from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Poses {
    True,
    /// Our tracker's, which met the person half a second before each keyframe.
    Fitted,
}

/// What a keyframe is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Keyframes {
    Single,
    /// A frame and the ten around it in time, averaged in canonical space.
    Snippet,
}

/// One avatar to be made and judged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Job {
    pub(super) table: Table,
    pub(super) method: Method,
    pub(super) data: Data,
    pub(super) camera: Camera,
    pub(super) poses: Poses,
    pub(super) keyframes: Keyframes,
    pub(super) seed: u64,
}

impl Job {
    /// Whether its network first learns the data set's training people.
    pub(super) fn learns_people_first(&self) -> bool {
        self.table == Table::Ablation || self.method == Method::Occupancy
    }
}

/// The avatars of one person in one outfit that the tables ask for.
pub(super) fn jobs(tables: &[Table], quick: bool) -> Vec<Job> {
    let wanted = tables.iter().flat_map(|&table| of_table(table, quick));
    wanted.collect()
}

fn of_table(table: Table, quick: bool) -> Vec<Job> {
    let job = |method| Job {
        table,
        method,
        data: Data::Few,
        camera: Camera::Paper,
        poses: Poses::True,
        keyframes: Keyframes::Single,
        seed: 1,
    };
    let ours = job(Method::Effigy);
    match table {
        Table::FewShot => {
            let seeds = if quick { 1 } else { HEADLINE_SEEDS };
            let others = [
                Method::BareBody,
                Method::Static,
                Method::Occupancy,
                Method::Scanimate,
                Method::NoMetaLearning,
                Method::Oracle,
            ];
            let headline = (1..=seeds).map(|seed| Job { seed, ..ours });
            others.map(job).into_iter().chain(headline).collect()
        }
        Table::Data => [20, 100]
            .map(|percent| Job { data: Data::Percent(percent), ..ours })
            .to_vec(),
        Table::Sensors => single_and_snippet(ours, sensors(quick, &SensorPreset::ALL)),
        Table::Fitted => {
            let fitted = Job { poses: Poses::Fitted, ..ours };
            let both = [SensorPreset::Azure, SensorPreset::D435];
            let bare = Job {
                method: Method::BareBody,
                camera: Camera::Sensor(SensorPreset::Azure),
                ..fitted
            };
            let mut rows = single_and_snippet(fitted, sensors(quick, &both));
            rows.insert(0, bare);
            rows
        }
        Table::Ablation => Method::ABLATION.map(job).to_vec(),
        // Not of the data set's people.
        Table::Strangers => Vec::new(),
    }
}

fn sensors(quick: bool, all: &[SensorPreset]) -> &[SensorPreset] {
    if quick { &all[..1] } else { all }
}

fn single_and_snippet(job: Job, sensors: &[SensorPreset]) -> Vec<Job> {
    let each = sensors.iter().flat_map(|&preset| {
        [Keyframes::Single, Keyframes::Snippet].map(|keyframes| Job {
            camera: Camera::Sensor(preset),
            keyframes,
            ..job
        })
    });
    each.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_row_is_made_twice() {
        let all = jobs(&Table::ALL, false);
        for (number, job) in all.iter().enumerate() {
            assert!(!all[..number].contains(job), "{job:?}");
        }
    }
}
