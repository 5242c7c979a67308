//! A second look at frames that were tracked, once it is known what the person wears.

use std::sync::Arc;

use effigy_capture::CameraModel;
use glam::Vec3;

use super::{TrackConfig, tracked, worn::offsets_in_zero_pose};
use crate::{
    align::{Context, Effort, align},
    error::RegistrationError,
    observe::Observation,
    registered::RegisteredFrame,
    residual::Prediction,
    smpl::{BodyModel, BodyParams, JOINT_COUNT},
    state::BodyState,
    surface::{ShapedSurface, Surface},
};

/// Brings bodies that were tracked without knowing their clothes onto the surface that they turned out to have.
#[derive(Debug)]
pub struct Refiner {
    surface: Arc<Surface>,
    camera: CameraModel,
    config: TrackConfig,
}

impl Refiner {
    pub fn new(model: Arc<BodyModel>, camera: CameraModel, config: TrackConfig) -> Self {
        let surface = Arc::new(Surface::new(model, config.surface_vertices));
        Self { surface, camera, config }
    }

    /// The same frame with its pose aligned to a surface: for each of the model's vertices how far that is from it, in
    /// canonical (star-pose) space and in this frame's pose. Nothing moves far from the pose `near` (of the same betas),
    /// which may be the frame's own or where it was tracked at first: limbs that the frame does not show stay there. A
    /// frame that is not tracked, or in which nobody is seen, comes back as it is.
    pub fn refine(
        &self,
        frame: &RegisteredFrame,
        near: &BodyParams,
        offsets_in_canonical: &[Vec3],
    ) -> Result<RegisteredFrame, RegistrationError> {
        let Some(params) = frame.params() else {
            return Ok(frame.clone());
        };
        let (world_from_camera, looks) = (frame.world_from_camera, self.config.looks());
        let seen = Observation::new(&frame.clean, &self.camera, world_from_camera, &looks);
        let Some(observation) = seen else {
            return Ok(frame.clone());
        };
        let model = &self.surface.model;
        let offsets = offsets_in_zero_pose(model, &params.betas, offsets_in_canonical)?;
        let shaped = ShapedSurface::wearing(&self.surface, params.betas, Some(&offsets));
        let near = Prediction {
            state: BodyState::from_params(near),
            joints_still: [0.0; JOINT_COUNT],
            trans_still: 0.0,
        };
        let energy = self.config.energy.with_known_surface();
        let context = Context {
            energy: &energy,
            predicted: Some(&near),
            grounded: frame.clean.floor.is_some(),
            whole: true,
        };
        let effort =
            Effort { rounds: 2 * self.config.rounds, settled_from: 0.5, ..self.config.effort() };
        let start = BodyState::from_params(params);
        let found = align(&shaped, &start, &observation, &context, &effort);
        Ok(RegisteredFrame { tracking: tracked(&found), ..frame.clone() })
    }
}
