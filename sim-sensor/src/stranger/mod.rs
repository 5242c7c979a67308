//! Strangers: any skinned glTF character in front of the simulated sensor.
//!
//! In: a file, and either one of its own clips or a motion of ours. Out: its surface in each frame, and where its
//! limbs' joints are. Nothing of SMPL is true about a stranger but the names of its joints.

use std::path::PathBuf;

use effigy_capture::{Calibration, FrameId, Rigid3, Timestamp};
use effigy_fusion::mesh::TriangleMesh;
use effigy_registration::{motion::Motion, smpl::BoneTransforms};
use glam::{Quat, Vec3};
use serde::{Deserialize, Serialize};

mod character;
mod document;
mod limbs;
mod skeleton;
mod skin;
#[cfg(test)]
mod tests;

pub use character::Character;
pub use limbs::{EstimatedLimbs, LIMB_JOINTS, LimbJoint, limb_errors_m};

use skeleton::Clip;

use crate::{error::SimError, person::Paint, scenario::Scenario};

/// Whose character it is, and what moves it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StrangerChoice {
    /// A `.glb` or `.gltf` file.
    pub path: PathBuf,
    /// One of the file's own clips by name; without it the scenario's motion moves the character.
    #[serde(default)]
    pub clip: Option<String>,
    /// Scales the character; files in metres need no scaling, others become 1.7 m tall.
    #[serde(default)]
    pub height_m: Option<f32>,
}

/// The truth about each frame of a scenario with a stranger.
#[derive(Clone, Debug)]
pub struct StrangerTruth {
    scene: StrangerScene,
}

/// The truth about one frame.
#[derive(Clone, Debug)]
pub struct StrangerGround {
    pub id: FrameId,
    pub timestamp: Timestamp,
    pub world_from_camera: Rigid3,
    /// The outer surface, with normals and colours; vertex `i` is one point in all frames.
    pub surface_in_world: TriangleMesh,
    /// Hips, knees, ankles, shoulders, elbows and wrists, in the order of [`LIMB_JOINTS`].
    pub limbs: [LimbJoint; LIMB_JOINTS.len()],
}

impl StrangerTruth {
    pub fn new(scenario: &Scenario) -> Result<Self, SimError> {
        Ok(Self { scene: StrangerScene::new(scenario)? })
    }

    pub fn character(&self) -> &Character {
        &self.scene.character
    }

    pub fn at(&self, frame: FrameId) -> StrangerGround {
        let scene = &self.scene;
        let mut surface_in_world = scene.surface(frame);
        surface_in_world.colors = scene.paint.vertex_colors();
        StrangerGround {
            id: frame,
            timestamp: scene.scenario.timestamp(frame),
            world_from_camera: scene.world_from_camera,
            surface_in_world,
            limbs: scene.limbs(frame),
        }
    }
}

/// A scenario with a stranger, made concrete.
#[derive(Clone, Debug)]
pub(crate) struct StrangerScene {
    pub(crate) scenario: Scenario,
    pub(crate) character: Character,
    pub(crate) paint: Paint,
    world_from_camera: Rigid3,
    act: Act,
}

/// What moves the character.
#[derive(Clone, Debug)]
enum Act {
    Motion(Motion),
    /// One of its own clips, moved so that it stands on the floor around the origin.
    Clip {
        clip: Clip,
        shift: Vec3,
    },
}

/// Moments of a clip that decide where its floor and its middle are.
const CLIP_SAMPLES: usize = 24;

impl StrangerScene {
    pub(crate) fn new(scenario: &Scenario) -> Result<Self, SimError> {
        let scenario = scenario.clone().checked()?;
        let Some(choice) = &scenario.stranger else {
            return Err(SimError::Scenario {
                field: "stranger",
                got: "none".to_owned(),
                expected: "a character; people of ours have a Truth",
            });
        };
        let character = Character::read(&choice.path, choice.height_m)?;
        let act = match &choice.clip {
            Some(name) => Act::of_clip(&character, choice, name)?,
            None => Act::Motion(scenario.motion(&character.rest_body())?),
        };
        let calibration: Calibration = scenario.calibration();
        let hair = character.hair();
        Ok(Self {
            paint: Paint::of_bones(&character.weights, &hair, scenario.seed),
            world_from_camera: calibration.world_from_camera.unwrap_or_default(),
            scenario,
            character,
            act,
        })
    }

    pub(crate) fn motion_secs(&self) -> f32 {
        match &self.act {
            Act::Motion(motion) => motion.duration_secs(),
            Act::Clip { clip, .. } => clip.secs,
        }
    }

    pub(crate) fn surface(&self, frame: FrameId) -> TriangleMesh {
        let secs = self.secs(frame);
        match &self.act {
            Act::Motion(motion) => {
                let pose = motion.at(secs).expect("motions have at least one pose");
                self.character.posed(&pose.theta, pose.trans)
            }
            Act::Clip { clip, shift } => {
                let (mut mesh, _) = self.character.at(clip, secs);
                mesh.vertices
                    .iter_mut()
                    .for_each(|vertex| *vertex += *shift);
                mesh
            }
        }
    }

    fn limbs(&self, frame: FrameId) -> [LimbJoint; LIMB_JOINTS.len()] {
        let secs = self.secs(frame);
        match &self.act {
            Act::Motion(motion) => {
                let pose = motion.at(secs).expect("motions have at least one pose");
                let (bones, joints) =
                    BoneTransforms::from_pose(&pose.theta, &self.character.joints);
                LIMB_JOINTS.map(|smpl| LimbJoint {
                    position: joints[smpl] + pose.trans,
                    rotation: Quat::from_mat3a(&bones.0[smpl].matrix3).normalize(),
                })
            }
            Act::Clip { clip, shift } => {
                let (_, globals) = self.character.at(clip, secs);
                LIMB_JOINTS.map(|smpl| {
                    let found = self.character.joint(smpl, &globals);
                    let (position, rotation) = found.expect("characters without limbs are refused");
                    LimbJoint { position: position + *shift, rotation }
                })
            }
        }
    }

    /// Movements repeat for as long as the scenario lasts.
    fn secs(&self, frame: FrameId) -> f32 {
        self.scenario.looped_secs(frame, self.motion_secs())
    }
}

impl Act {
    fn of_clip(
        character: &Character,
        choice: &StrangerChoice,
        name: &str,
    ) -> Result<Self, SimError> {
        let known = || {
            character
                .clips
                .iter()
                .map(|clip| clip.name.as_str())
                .collect::<Vec<_>>()
                .join(", ")
        };
        let clip = character
            .clips
            .iter()
            .find(|clip| clip.name == name)
            .cloned()
            .ok_or_else(|| {
                let found = if character.clips.is_empty() {
                    "none".to_owned()
                } else {
                    known()
                };
                SimError::character(&choice.path, &format!("a clip {name:?}"), &found)
            })?;
        let (mut lowest, mut middle) = (f32::MAX, Vec3::ZERO);
        for sample in 0..CLIP_SAMPLES {
            let secs = clip.secs * sample as f32 / CLIP_SAMPLES as f32;
            let (mesh, globals) = character.at(&clip, secs);
            lowest = mesh.vertices.iter().map(|v| v.y).fold(lowest, f32::min);
            middle += character.joint(0, &globals).unwrap_or_default().0 / CLIP_SAMPLES as f32;
        }
        Ok(Self::Clip { clip, shift: Vec3::new(-middle.x, -lowest, -middle.z) })
    }
}
