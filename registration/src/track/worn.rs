//! Following the surface that is seen: once an avatar exists, its clothes are known, and need not be allowed for.

use std::sync::Arc;

use glam::{Mat3A, Vec3};

use super::Tracker;
use crate::{
    align::EnergyConfig,
    error::RegistrationError,
    smpl::{BodyModel, star_transforms},
    state::BETA_COUNT,
    surface::{REGION_COUNT, ShapedSurface, Surface},
};

/// A surface known to this is met from both sides alike.
const KNOWN_TO_M: f32 = 0.010;

impl Tracker {
    /// From now on aligns to a surface instead of the bare body: for each of the model's vertices how far the
    /// surface is from it, in canonical (star-pose) space. Betas, joints and parameters stay the bare body's. Until
    /// [`Tracker::forget_person`].
    pub fn set_surface(&mut self, offsets_in_canonical: &[Vec3]) -> Result<(), RegistrationError> {
        let model = &self.surface.model;
        let offsets = offsets_in_zero_pose(model, &self.shaped.betas, offsets_in_canonical)?;
        self.worn = Some(Arc::from(offsets));
        self.energy = self.config.energy.with_known_surface();
        self.shaped = self.dressed(&self.surface, self.shaped.betas);
        Ok(())
    }

    /// A surface of the person with what is known of their clothes.
    pub(super) fn dressed(
        &self,
        surface: &Arc<Surface>,
        betas: [f32; BETA_COUNT],
    ) -> ShapedSurface {
        ShapedSurface::wearing(surface, betas, self.worn.as_deref())
    }
}

impl EnergyConfig {
    /// For a surface that is met as it is, without clothes over it.
    pub(super) fn with_known_surface(self) -> Self {
        Self {
            cloth_standoff_m: 0.0,
            cloth_by_region: [1.0; REGION_COUNT],
            hair_m: 0.0,
            sole_m: 0.0,
            cloth_outside_m: KNOWN_TO_M,
            cloth_inside_m: KNOWN_TO_M,
            say_in_hollows: 1.0,
            ..self
        }
    }
}

/// Offsets turn back with the bones that carry them.
pub(super) fn offsets_in_zero_pose(
    model: &BodyModel,
    betas: &[f32; BETA_COUNT],
    offsets_in_canonical: &[Vec3],
) -> Result<Vec<Vec3>, RegistrationError> {
    if offsets_in_canonical.len() != model.vertex_count() {
        return Err(RegistrationError::SurfaceMismatch {
            got: offsets_in_canonical.len(),
            expected: model.vertex_count(),
        });
    }
    let star = star_transforms(&model.joints(&model.shaped_vertices(betas)));
    let turned = |(offset, weights): (&Vec3, &crate::smpl::VertexWeights)| {
        let canonical_from_zero: Mat3A = star.blend(weights).matrix3;
        let offset = Vec3::from(canonical_from_zero.inverse() * glam::Vec3A::from(*offset));
        if offset.is_finite() {
            offset
        } else {
            Vec3::ZERO
        }
    };
    Ok(offsets_in_canonical
        .iter()
        .zip(&model.skinning)
        .map(turned)
        .collect())
}

#[cfg(test)]
mod tests {
    use effigy_capture::Intrinsics;

    use super::*;
    use crate::{TrackConfig, smpl::builtin};

    fn tracker() -> Tracker {
        let camera = Intrinsics { width: 64, height: 48, fx: 50.0, fy: 50.0, cx: 31.5, cy: 23.5 };
        let config =
            TrackConfig { surface_vertices: 300, search_vertices: 200, ..TrackConfig::default() };
        Tracker::new(builtin::body(), camera.into(), config, None)
    }

    #[test]
    fn a_surface_of_another_body_is_refused_and_says_so() {
        let error = tracker()
            .set_surface(&[Vec3::ZERO; 5])
            .unwrap_err()
            .to_string();
        assert!(error.contains('5'), "{error}");
    }

    #[test]
    fn offsets_move_the_surface_and_leave_the_joints() {
        let mut tracker = tracker();
        let bare = tracker.shaped.clone();
        let model = Arc::clone(&tracker.surface.model);
        let lift = vec![Vec3::new(0.0, 0.0, 0.02); model.vertex_count()];
        tracker.set_surface(&lift).unwrap();
        assert_eq!(tracker.shaped.rest_joints, bare.rest_joints);
        for (worn, bare) in tracker.shaped.vertices.iter().zip(&bare.vertices) {
            // A turn about z, as the star pose's legs make, leaves z alone; blends shorten it a little.
            assert!((worn.z - bare.z - 0.02).abs() < 1e-4);
        }
        tracker.forget_person();
        assert_eq!(tracker.shaped.vertices, bare.vertices);
    }
}
