//! The tracker that is evaluated, and what it is without one thing or the other.

use effigy_registration::EnergyConfig;

use super::{Case, Options};

/// Settings beside those asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Variant {
    Default,
    /// Depth is met from both sides alike and expected on the skin.
    NoClothTerm,
    /// Depth may match what the camera cannot see.
    NoVisibility,
    /// A frame's pose is only looked for from where the last ones lead.
    NoTemporalTerm,
    /// In the manner of sxyu/avatar: some 200 points, three rounds of nearest neighbours with ten steps each, pose and
    /// shape prior, and nothing else. Its forest of part labels it lacks, and it has our point-to-plane distance, our
    /// way of finding people and our weights of the priors.
    Sxyu,
    /// Told each frame's true surface instead of the body's: as much as an avatar could tell. Only of people in clothes
    /// that are part of their surface.
    TrueSurface,
}

impl Variant {
    pub(crate) const ALL: [Self; 6] = [
        Self::Default,
        Self::NoClothTerm,
        Self::NoVisibility,
        Self::NoTemporalTerm,
        Self::Sxyu,
        Self::TrueSurface,
    ];

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Default => "default",
            Self::NoClothTerm => "no_cloth_term",
            Self::NoVisibility => "no_visibility",
            Self::NoTemporalTerm => "no_temporal_term",
            Self::Sxyu => "sxyu",
            Self::TrueSurface => "true_surface",
        }
    }

    /// Strangers are for the tracker as it is; a surface is known of clothes that are part of it.
    pub(crate) fn applies_to(self, case: &Case) -> bool {
        let scenario = &case.scenario;
        match self {
            Self::Default => true,
            Self::NoClothTerm | Self::NoVisibility | Self::NoTemporalTerm | Self::Sxyu => {
                scenario.stranger.is_none()
            }
            Self::TrueSurface => scenario.stranger.is_none() && scenario.outfit.cloth().is_none(),
        }
    }

    /// What becomes of settings.
    pub(super) fn of(self, options: &Options) -> Options {
        let mut options = options.clone();
        let track = &mut options.track;
        match self {
            Self::Default => {}
            Self::NoClothTerm => {
                track.energy = without_cloth(track.energy);
                track.fit.learns_thickness = false;
            }
            Self::TrueSurface => options.true_surface = true,
            Self::NoVisibility => track.energy.visible_only = false,
            Self::NoTemporalTerm => track.energy.temporal_weight = 0.0,
            Self::Sxyu => {
                (track.points, track.rounds, track.steps) = (200, 3, 10);
                track.fit.learns_thickness = false;
                track.energy = EnergyConfig {
                    direction_m: 0.0,
                    oblique: -1.0,
                    contradiction_weight: 0.0,
                    temporal_weight: 0.0,
                    standing_weight: 0.0,
                    floor_weight: 0.0,
                    contact_weight: 0.0,
                    ..without_cloth(track.energy)
                };
            }
        }
        options
    }
}

/// As if depth were measured on the skin.
fn without_cloth(energy: EnergyConfig) -> EnergyConfig {
    EnergyConfig {
        cloth_standoff_m: 0.0,
        hair_m: 0.0,
        sole_m: 0.0,
        cloth_outside_m: energy.cloth_inside_m,
        say_in_hollows: 1.0,
        ..energy
    }
}
