//! What is simulated: plain data that a recording carries with it.

use std::{path::PathBuf, sync::Arc};

use effigy_capture::{Calibration, FrameId, Timestamp};
use effigy_registration::{
    BodyModel,
    motion::{self, Motion, RestBody, Routine},
};
use serde::{Deserialize, Serialize};

use crate::{
    error::SimError,
    person::{Material, Outfit, OutfitKind, Person, sample_betas},
    preset::{Mount, SensorPreset},
    random::Randomness,
    stranger::StrangerChoice,
};

/// Everything a simulation follows from, to the last bit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Scenario {
    pub version: u32,
    pub seed: u64,
    pub sensor: SensorPreset,
    /// Where the sensor stands; where the whole person is in view, whatever they do, where none is given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mount: Option<Mount>,
    pub motion: MotionChoice,
    pub outfit: OutfitKind,
    /// Whether the body model can be the person exactly.
    #[serde(skip_serializing_if = "Likeness::is_model")]
    pub likeness: Likeness,
    /// Somebody else's character instead of a person of ours; outfit, fit and betas have no say then.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stranger: Option<StrangerChoice>,
    /// Size of simulated clothes, from tight (0) to loose (1); drawn from the seed where none is given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fit: Option<f32>,
    /// The person's shape; drawn from the seed where none is given.
    pub betas: Option<[f32; 10]>,
    pub seconds: f32,
    /// Frames a second; the sensor's own rate where none is given.
    pub rate_hz: Option<f32>,
    pub noise: Noise,
    pub room: Room,
    /// Whether frames carry an image of the sensor's colour camera.
    pub color: bool,
    /// Share of frames that never arrive; their numbers are missing in the stream.
    pub dropped_share: f32,
    /// Share of frames exposed too late, by up to most of a frame; their timestamps say so.
    pub late_share: f32,
}

#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MotionChoice {
    Routine(Routine),
    /// A BVH file, performed on the spot.
    Bvh(PathBuf),
    /// Any motion file (`.bvh`, `.amc`, `.npz`, `.csv`), performed on the spot.
    File(PathBuf),
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Likeness {
    /// Betas make the person.
    #[default]
    Model,
    /// An adult of the survey with a surface of their own and flesh that moves; `betas` have no say.
    Individual,
}

impl Likeness {
    #[expect(
        clippy::trivially_copy_pass_by_ref,
        reason = "serde asks with a reference"
    )]
    fn is_model(&self) -> bool {
        *self == Self::Model
    }
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Noise {
    /// As the sensor makes it.
    #[default]
    Sensor,
    /// The truth in the sensor's units.
    None,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Room {
    Empty,
    Floor,
    #[default]
    FloorAndWall,
}

/// The version this program writes and reads.
pub const SCENARIO_VERSION: u32 = 1;
const MAX_SECONDS: f32 = 3600.0;

impl Default for Scenario {
    fn default() -> Self {
        Self {
            version: SCENARIO_VERSION,
            seed: 1,
            sensor: SensorPreset::Azure,
            mount: None,
            motion: MotionChoice::Routine(Routine::Mixture),
            outfit: OutfitKind::Demo,
            likeness: Likeness::Model,
            stranger: None,
            fit: None,
            betas: None,
            seconds: 20.0,
            rate_hz: None,
            noise: Noise::Sensor,
            room: Room::FloorAndWall,
            color: false,
            dropped_share: 0.0,
            late_share: 0.0,
        }
    }
}

impl Scenario {
    pub fn from_json(text: &str) -> Result<Self, SimError> {
        let scenario: Self = serde_json::from_str(text)
            .map_err(|source| SimError::Json { expected_version: SCENARIO_VERSION, source })?;
        scenario.checked()
    }

    pub fn to_json(&self) -> String {
        serde_json::to_string(self).expect("plain data always serialises")
    }

    /// Frames a second.
    pub fn rate_hz(&self) -> f32 {
        self.rate_hz
            .unwrap_or_else(|| self.sensor.calibration().rate_hz)
    }

    /// Frames from start to end, those that will be dropped included.
    pub fn frame_slots(&self) -> u64 {
        (self.seconds * self.rate_hz()).round().max(1.0) as u64
    }

    /// The sensor's calibration at this scenario's rate and place, with a colour camera where colour is asked for.
    pub fn calibration(&self) -> Calibration {
        let mut calibration = self.sensor.calibration();
        calibration.rate_hz = self.rate_hz();
        if let Some(mount) = self.mount {
            calibration.world_from_camera = Some(mount.world_from_camera());
        }
        if self.color {
            calibration.color = Some(self.sensor.color_camera());
            calibration.color_from_depth = self.sensor.color_from_depth();
        }
        calibration
    }

    /// When a frame is exposed; never before the one in front of it.
    pub fn timestamp(&self, frame: FrameId) -> Timestamp {
        let frames = frame.0 as f64 + f64::from(self.lateness(frame));
        Timestamp::from_secs_f64(frames / f64::from(self.rate_hz()))
    }

    /// Where a movement is at a frame: it repeats for as long as the scenario lasts.
    pub(crate) fn looped_secs(&self, frame: FrameId, duration_secs: f32) -> f32 {
        let secs = self.timestamp(frame).as_secs_f64() as f32;
        if duration_secs > 0.0 {
            secs % duration_secs
        } else {
            0.0
        }
    }

    /// In frames, below one.
    fn lateness(&self, frame: FrameId) -> f32 {
        const MOST: f32 = 0.9;
        let random = Randomness::new(self.seed, 1, 0xd0);
        let late = frame.0 > 0 && random.uniform(2 * frame.0) < self.late_share;
        if late {
            MOST * random.uniform(2 * frame.0 + 1)
        } else {
            0.0
        }
    }

    pub fn is_dropped(&self, frame: FrameId) -> bool {
        // The first frame always comes: a stream that starts with a gap helps nobody.
        let random = Randomness::new(self.seed, 0, 0xd0);
        frame.0 > 0 && random.uniform(frame.0) < self.dropped_share
    }

    /// Who it is, in clothes that are part of their surface.
    pub(crate) fn person(&self, body: Arc<BodyModel>, outfit: Outfit) -> Person {
        match self.likeness {
            Likeness::Individual => Person::individual(body, outfit, self.seed),
            Likeness::Model => {
                let sampled = || sample_betas(&body, self.seed);
                let betas = self.betas.unwrap_or_else(sampled);
                Person::new(body, betas, outfit, self.seed)
            }
        }
    }

    /// How loosely simulated clothes are cut: 0 (tight) to 1.
    pub(crate) fn cloth_fit(&self) -> f32 {
        let random = Randomness::new(self.seed, 0, 0xf17);
        self.fit.unwrap_or_else(|| random.uniform(0))
    }

    /// What simulated garments are made of, from the innermost to the outermost; none without simulated clothes.
    pub(crate) fn cloth_materials(&self) -> Vec<Material> {
        let kind = self.outfit.cloth();
        let patterns = kind.map(|kind| kind.patterns(self.cloth_fit(), self.seed));
        let patterns = patterns.unwrap_or_default();
        patterns.iter().map(|pattern| pattern.material).collect()
    }

    /// The movement as a body performs it.
    pub(crate) fn motion(&self, rest: &RestBody) -> Result<Motion, SimError> {
        Ok(match &self.motion {
            MotionChoice::Routine(routine) => routine.motion(rest, self.rate_hz(), self.seed),
            MotionChoice::Bvh(path) | MotionChoice::File(path) => motion::open(path, rest)?
                .in_place()
                .starting_at_origin(rest)
                .closed(),
        })
    }

    /// Refuses what cannot be simulated.
    pub fn checked(self) -> Result<Self, SimError> {
        let check = |ok: bool, field, got: String, expected| {
            if ok {
                Ok(())
            } else {
                Err(SimError::Scenario { field, got, expected })
            }
        };
        let version = self.version == SCENARIO_VERSION;
        check(
            version,
            "version",
            self.version.to_string(),
            "1; write it with this program",
        )?;
        let seconds = self.seconds > 0.0 && self.seconds <= MAX_SECONDS;
        check(
            seconds,
            "seconds",
            self.seconds.to_string(),
            "more than 0 and at most 3600",
        )?;
        let rate = (0.5..=240.0).contains(&self.rate_hz());
        check(rate, "rate_hz", self.rate_hz().to_string(), "0.5 to 240")?;
        let dropped = (0.0..=0.9).contains(&self.dropped_share);
        check(
            dropped,
            "dropped_share",
            self.dropped_share.to_string(),
            "0 to 0.9",
        )?;
        let fit = self.fit.is_none_or(|fit| (0.0..=1.0).contains(&fit));
        check(
            fit,
            "fit",
            format!("{:?}", self.fit),
            "0 (tight) to 1 (loose)",
        )?;
        let late = (0.0..=1.0).contains(&self.late_share);
        check(late, "late_share", self.late_share.to_string(), "0 to 1")?;
        let stands = self.mount.is_none_or(|mount| {
            (0.3..=10.0).contains(&mount.distance_m)
                && (0.0..=5.0).contains(&mount.height_m)
                && mount.down_rad.abs() <= 1.5
        });
        check(
            stands,
            "mount",
            format!("{:?}", self.mount),
            "a distance of 0.3 to 10 m, a height of 0 to 5 m, a tilt of at most 1.5 rad",
        )?;
        let height_m = self.stranger.as_ref().and_then(|choice| choice.height_m);
        check(
            height_m.is_none_or(|height_m| (0.3..=3.0).contains(&height_m)),
            "stranger.height_m",
            format!("{height_m:?}"),
            "0.3 to 3 metres",
        )?;
        let betas = self
            .betas
            .is_none_or(|b| b.iter().all(|beta| beta.abs() <= 5.0));
        check(
            betas,
            "betas",
            format!("{:?}", self.betas),
            "ten numbers from -5 to 5",
        )?;
        Ok(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scenario_survives_json_and_refuses_what_it_does_not_know() {
        let scenario = Scenario {
            motion: MotionChoice::Routine(Routine::Squat),
            betas: Some([0.5; 10]),
            mount: Some(Mount { height_m: 1.1, distance_m: 2.0, down_rad: 0.0 }),
            ..Scenario::default()
        };
        assert_eq!(Scenario::from_json(&scenario.to_json()).unwrap(), scenario);
        let error = Scenario::from_json(r#"{"version":1,"sed":4}"#)
            .unwrap_err()
            .to_string();
        assert!(error.contains("sed"), "names the unknown field: {error}");
        let error = Scenario::from_json(r#"{"version":9}"#)
            .unwrap_err()
            .to_string();
        assert!(error.contains('9') && error.contains("version"), "{error}");
        assert!(Scenario::from_json(r#"{"seconds":-1.0}"#).is_err());
        let far = r#"{"mount":{"height_m":1.0,"distance_m":40.0,"down_rad":0.0}}"#;
        assert!(Scenario::from_json(far).is_err());
    }
}
