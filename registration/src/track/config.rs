//! What can be set about tracking.

use serde::{Deserialize, Serialize};

use crate::{
    align::{Effort, EnergyConfig},
    fit::FitConfig,
    initialize::InitializeConfig,
    observe::ObserveConfig,
};

/// Everything that can be set about tracking.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TrackConfig {
    /// Vertices of the surface that is fitted: three centimetres apart.
    pub surface_vertices: usize,
    /// Vertices of the surface that is searched with.
    pub search_vertices: usize,
    /// Depth points a frame.
    pub points: usize,
    pub search_points: usize,
    /// How much of a frame's velocity is believed; the rest is as it was.
    pub velocity_share: f32,
    /// Rounds of matching and moving a frame.
    pub rounds: usize,
    /// Steps of each round, with the matches that it began with.
    pub steps: usize,
    /// Fewer person pixels are nobody (field practice: re-initialise below 1000).
    pub min_person_px: usize,
    /// Drawn body and picture differ by more than this on average, beyond the sensor's noise: the track is bad.
    pub bad_error_m: f32,
    /// A search must end below this to be believed.
    pub found_error_m: f32,
    /// A bad track for this long is lost.
    pub patience_secs: f32,
    /// Pause between searches that fail.
    pub search_every_secs: f32,
    /// More depth points than this share without body near them: a limb is astray.
    pub stray_share: f32,
    /// Pause between attempts to bring a limb back.
    pub recover_every_secs: f32,
    /// Two headings are followed side by side for this long, until the picture has decided.
    pub undecided_secs: f32,
    pub energy: EnergyConfig,
    pub search: InitializeConfig,
    pub fit: FitConfig,
}

impl TrackConfig {
    /// How a frame's body is looked for, close to where it is.
    pub(super) fn effort(&self) -> Effort {
        Effort {
            rounds: self.rounds,
            steps: self.steps,
            every: 1,
            drawn_visibility: true,
            widen: 1.0,
            settled_from: 0.3,
        }
    }

    /// How frames are looked at to follow a body in them.
    pub(super) fn looks(&self) -> ObserveConfig {
        ObserveConfig { points: self.points, cell_m: 0.01, min_px: self.min_person_px }
    }
}

impl Default for TrackConfig {
    fn default() -> Self {
        Self {
            surface_vertices: 2400,
            search_vertices: 600,
            points: 1600,
            search_points: 260,
            velocity_share: 0.4,
            rounds: 7,
            steps: 1,
            min_person_px: 1000,
            bad_error_m: 0.055,
            found_error_m: 0.05,
            patience_secs: 0.2,
            search_every_secs: 0.15,
            stray_share: 0.02,
            recover_every_secs: 0.1,
            undecided_secs: 0.5,
            energy: EnergyConfig::default(),
            search: InitializeConfig::default(),
            fit: FitConfig::default(),
        }
    }
}
