//! Fields whose surface is known, for tests.

use std::sync::Arc;

use effigy_fusion::mesh::closest_point::ClosestPoint;
use effigy_registration::BodyModel;
use glam::Vec3;

use crate::{
    model::{PoseField, Subject},
    pose_input::PoseInput,
    sdf::SignedDistanceField,
    skinning::star_body,
};

/// A formula as a field; gradients by central differences.
pub(crate) struct Analytic<F>(pub(crate) F);

impl<F: Fn(Vec3) -> f32 + Sync> SignedDistanceField for Analytic<F> {
    fn values(&self, points: &[Vec3], out: &mut [f32]) {
        for (value, &point) in out.iter_mut().zip(points) {
            *value = self.0(point);
        }
    }

    fn values_and_gradients(&self, points: &[Vec3], values: &mut [f32], gradients: &mut [Vec3]) {
        const STEP: f32 = 1e-3;
        self.values(points, values);
        for (gradient, &point) in gradients.iter_mut().zip(points) {
            *gradient = Vec3::from_array(std::array::from_fn(|axis| {
                let step = Vec3::AXES[axis] * STEP;
                (self.0(point + step) - self.0(point - step)) / (2.0 * STEP)
            }));
        }
    }
}

/// The minimal body in star pose, blown up evenly: a person in a diving suit.
#[derive(Clone)]
pub(crate) struct InflatedBody {
    pub(crate) body: Arc<ClosestPoint>,
    pub(crate) thickness: f32,
    /// How much thicker each radian of knee and elbow makes the suit: a field that depends on the pose.
    pub(crate) growth: f32,
}

impl InflatedBody {
    /// `thickness_m` is in metres; the field is in unit space.
    pub(crate) fn new(model: &BodyModel, subject: &Subject, thickness_m: f32) -> Self {
        let vertices: Vec<Vec3> = star_body(model, &subject.betas)
            .iter()
            .map(|&vertex| subject.unit_box.unit_from_canonical(vertex))
            .collect();
        let body = ClosestPoint::new(&vertices, &model.triangles).unwrap();
        let thickness = thickness_m / subject.unit_box.metres_per_unit();
        Self { body: Arc::new(body), thickness, growth: 0.0 }
    }
}

impl SignedDistanceField for InflatedBody {
    fn values(&self, points: &[Vec3], out: &mut [f32]) {
        for (value, distance) in out.iter_mut().zip(self.body.signed_distance_all(points)) {
            *value = distance - self.thickness;
        }
    }

    fn values_and_gradients(&self, points: &[Vec3], values: &mut [f32], gradients: &mut [Vec3]) {
        let hits = self.body.query_all(points);
        for (index, (point, hit)) in points.iter().zip(&hits).enumerate() {
            let sign = self.body.sign(*point, hit);
            values[index] = sign * hit.distance - self.thickness;
            gradients[index] = (sign * (*point - hit.point)).normalize_or_zero();
        }
    }
}

impl PoseField for InflatedBody {
    fn field(&self, pose: &PoseInput) -> Box<dyn SignedDistanceField> {
        let bend: f32 = [4, 5, 18, 19]
            .iter()
            .map(|&joint| {
                ((pose.rotations[joint].col(0)[0]
                    + pose.rotations[joint].col(1)[1]
                    + pose.rotations[joint].col(2)[2]
                    - 1.0)
                    * 0.5)
                    .clamp(-1.0, 1.0)
                    .acos()
            })
            .sum();
        Box::new(Self { thickness: self.thickness + self.growth * bend, ..self.clone() })
    }

    fn kind(&self) -> &'static str {
        "inflated-body"
    }

    fn to_bytes(&self) -> Vec<u8> {
        [self.thickness, self.growth]
            .iter()
            .flat_map(|x| x.to_le_bytes())
            .collect()
    }
}
