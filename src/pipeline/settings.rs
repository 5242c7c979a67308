//! All stages' settings in one file.

use std::{fs, path::Path};

use anyhow::Context as _;
use effigy_avatar::{
    canonicalise::CanonicaliseConfig, fine_tune::FineTuneConfig, keyframes::KeyframeConfig,
};
use effigy_fusion::clean::CleanConfig;
use effigy_registration::track::TrackConfig;
use serde::{Deserialize, Serialize};

/// One section a stage; what a file does not name keeps its default.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct Settings {
    pub(crate) clean: CleanConfig,
    pub(crate) track: TrackConfig,
    pub(crate) keyframes: KeyframeConfig,
    pub(crate) canonicalise: CanonicaliseConfig,
    pub(crate) fine_tune: FineTuneConfig,
    pub(crate) schedule: ScheduleConfig,
}

/// When background results take effect.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct ScheduleConfig {
    /// In a replay an avatar takes over this many frames after it was asked for; the replay waits
    /// there if need be, so that two replays are the same.
    pub(crate) swap_after_frames: u64,
    /// An avatar is made better when this many of its keyframes have given way to others...
    pub(crate) improve_new_keyframes: usize,
    /// ...and it has been driven for this long.
    pub(crate) improve_after_frames: u64,
}

impl Default for ScheduleConfig {
    fn default() -> Self {
        // Three seconds at 30 Hz: long enough that fine-tuning has the chain's idle time to itself.
        Self { swap_after_frames: 90, improve_new_keyframes: 3, improve_after_frames: 150 }
    }
}

impl Settings {
    /// The defaults, or a TOML file's changes to them.
    pub(crate) fn load(path: Option<&Path>) -> anyhow::Result<Self> {
        let Some(path) = path else {
            return Ok(Self::default());
        };
        let text = fs::read_to_string(path)
            .with_context(|| format!("{}: cannot read the settings", path.display()))?;
        toml::from_str(&text)
            .with_context(|| format!("{}: these settings do not fit", path.display()))
    }
}
