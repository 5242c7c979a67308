//! All stages' settings in one file.

use std::path::{Path, PathBuf};

use anyhow::{Context as _, ensure};
use effigy_avatar::{
    MapConfig,
    canonicalise::CanonicaliseConfig,
    fine_tune::{FineTuneConfig, SamplingConfig},
    hyper::{self, HyperNetwork},
    keyframes::KeyframeConfig,
};
use effigy_fusion::clean::CleanConfig;
use effigy_registration::{SmoothConfig, smpl::BodyIdentity, track::TrackConfig};
use serde::{Deserialize, Serialize};

use super::{
    devices::{DeviceSettings, Wishes},
    refine::RefineConfig,
};
use crate::files;

/// More would not be few shots any more, and fill the memory.
pub(crate) const MOST_KEYFRAMES: usize = 64;

const MOST_THREADS: usize = 256;

/// One section a stage; what a file does not name keeps its default.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct Settings {
    /// What fine-tuning starts from (`effigy train hyper`) instead of the built-in prior.
    pub(crate) prior: Option<PathBuf>,
    pub(crate) clean: CleanConfig,
    pub(crate) track: TrackConfig,
    /// How the poses that the avatar is driven with are calmed, `"off"` or `{ one_euro = { .. } }`. Where nothing is said:
    /// live it is done, a recording repeats what was done when it was made, and other replays show what was tracked.
    pub(crate) smooth: Option<SmoothConfig>,
    pub(crate) keyframes: KeyframeConfig,
    pub(crate) canonicalise: CanonicaliseConfig,
    /// Whether keyframes are looked at again with the clothes that they turned out to show.
    pub(crate) refine: RefineConfig,
    pub(crate) fine_tune: FineTuneConfig,
    /// How an avatar's shape is learned as a function of the pose, so that the drive need not evaluate its field.
    pub(crate) map: MapConfig,
    /// What poses the avatar once there is one.
    pub(crate) drive: DeviceSettings,
    /// What computes the steps of fine-tuning.
    pub(crate) learn: DeviceSettings,
    pub(crate) preview: PreviewConfig,
    pub(crate) schedule: ScheduleConfig,
}

/// The avatar that is shown while the first one is still learned: the same network after fewer steps.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct PreviewConfig {
    /// Steps of fine-tuning after which it is made; 0 for none.
    pub(crate) steps: u32,
    /// Poses of each motion that its map is learned from, fewer than an avatar's: it must be quick.
    pub(crate) poses_a_motion: usize,
}

impl Default for PreviewConfig {
    fn default() -> Self {
        Self { steps: 20, poses_a_motion: 3 }
    }
}

/// When background results take effect.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct ScheduleConfig {
    /// In a replay an avatar takes over this many frames after it was asked for; the replay waits
    /// there if need be, so that two replays are the same.
    pub(crate) swap_after_frames: u64,
    /// In a replay the preview is shown this many frames after its avatar was asked for.
    pub(crate) preview_after_frames: u64,
    /// An avatar is made better when this many of its keyframes have given way to others...
    pub(crate) improve_new_keyframes: usize,
    /// ...and it has been driven for this long.
    pub(crate) improve_after_frames: u64,
    /// Whether tracking aligns to the avatar's surface instead of the bare body's once there is one.
    pub(crate) follow_avatar: bool,
}

impl Default for ScheduleConfig {
    fn default() -> Self {
        // Three seconds at 30 Hz: long enough that fine-tuning has the chain's idle time to itself.
        Self {
            swap_after_frames: 90,
            preview_after_frames: 15,
            improve_new_keyframes: 3,
            improve_after_frames: 150,
            follow_avatar: false,
        }
    }
}

impl Settings {
    /// The defaults, or a TOML file's changes to them.
    pub(crate) fn load(path: Option<&Path>) -> anyhow::Result<Self> {
        let Some(path) = path else {
            return Ok(Self::default());
        };
        let settings: Self = files::read_toml(path)?;
        settings
            .check()
            .with_context(|| path.display().to_string())?;
        Ok(settings)
    }

    /// What drives and what learns, as far as the user has a wish.
    pub(crate) fn wishes(&self) -> Wishes {
        Wishes { drive: self.drive.device, learn: self.learn.device }
    }

    /// The network that fine-tuning starts from; one of the user's own must belong to the body.
    pub(crate) fn prior_network(&self, body: BodyIdentity) -> anyhow::Result<HyperNetwork> {
        let (prior, name) = match &self.prior {
            None => (hyper::prior(), "the built-in prior".to_owned()),
            Some(path) => {
                let prior = HyperNetwork::load(path).context("cannot read the prior")?;
                (prior, path.display().to_string())
            }
        };
        ensure!(
            prior.provenance.body == Some(body),
            "{name} belongs to another body: make one with `effigy train sdf` and `effigy train hyper`"
        );
        Ok(prior)
    }

    /// Refuses what would run and mean nothing.
    fn check(&self) -> anyhow::Result<()> {
        let count = self.keyframes.count;
        ensure!(
            (1..=MOST_KEYFRAMES).contains(&count),
            "keyframes.count is {count}, expected 1 to {MOST_KEYFRAMES}"
        );
        let steps = self.fine_tune.steps;
        ensure!(
            steps >= 1,
            "fine_tune.steps is {steps}, expected at least 1"
        );
        let doubt_m = self.fine_tune.doubt_m;
        ensure!(
            doubt_m.is_finite() && doubt_m >= 0.0,
            "fine_tune.doubt_m is {doubt_m}, expected metres, or 0 for no doubts"
        );
        check_sampling(&self.fine_tune.sampling).context("fine_tune")?;
        let min_samples = self.clean.segment.floor.min_samples;
        ensure!(
            min_samples >= 3,
            "clean.segment.floor.min_samples is {min_samples}, expected at least the 3 that make a plane"
        );
        self.refine.check()?;
        let threads = self.fine_tune.threads.count;
        ensure!(
            threads <= MOST_THREADS,
            "fine_tune.threads.count is {threads}, expected at most {MOST_THREADS}, or 0 for as many as there are cores"
        );
        if let Some(place) = self.clean.segment.pick {
            ensure!(
                place.iter().all(|share| (0.0..=1.0).contains(share)),
                "clean.segment.pick is {place:?}, expected a place in the picture, from [0, 0] at its top left to [1, 1]"
            );
        }
        if let Some([nearest, farthest]) = self.clean.range_m {
            ensure!(
                nearest >= 0.0 && nearest < farthest,
                "clean.range_m is [{nearest}, {farthest}], expected the nearest depth, then the farthest"
            );
        }
        Ok(())
    }
}

/// Refuses what no point can be drawn by; of fine-tuning's settings and of a training's.
pub(crate) fn check_sampling(sampling: &SamplingConfig) -> anyhow::Result<()> {
    let near_deviation = sampling.near_deviation;
    ensure!(
        near_deviation.is_finite() && near_deviation >= 0.0,
        "sampling.near_deviation is {near_deviation}, expected a length of unit space, 0 or more"
    );
    Ok(())
}
