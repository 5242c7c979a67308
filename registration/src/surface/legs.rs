//! Places down both legs, each with its width: what keeps one leg out of the other.

use glam::Vec3;

use crate::smpl::{BodyModel, VertexWeights};

/// One place on both legs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LegStation {
    /// Of the surface's vertices, one on the inner and one on the outer side.
    pub(crate) left: [u32; 2],
    pub(crate) right: [u32; 2],
    /// Both radii together, on the mean body.
    pub(crate) least_m: f32,
}

/// Hip, knee and ankle of either leg.
const LEGS: [[usize; 3]; 2] = [[1, 4, 7], [2, 5, 8]];
/// Where stations are: down the thigh from its middle, and down the shin.
const ON_THIGH: [f32; 2] = [0.6, 0.85];
const ON_SHIN: [f32; 4] = [0.05, 0.35, 0.65, 0.95];

/// Stations of a surface that has these of the model's vertices.
pub(super) fn leg_stations(
    model: &BodyModel,
    vertices: &[u32],
    skinning: &[VertexWeights],
) -> Vec<LegStation> {
    let joints = model.joints(&model.template);
    let places = ON_THIGH.map(|share| (0, share)).into_iter();
    let places = places.chain(ON_SHIN.map(|share| (1, share)));
    places
        .filter_map(|(bone, share)| {
            let [left, right] = LEGS.map(|leg| {
                let middle = joints[leg[bone]].lerp(joints[leg[bone + 1]], share);
                sides(model, vertices, skinning, &leg, middle)
            });
            let (left, right) = (left?, right?);
            let width_m = |[inner, outer]: [u32; 2]| {
                let place = |v: u32| model.template[vertices[v as usize] as usize];
                (place(outer).x - place(inner).x).abs()
            };
            Some(LegStation { left, right, least_m: 0.5 * (width_m(left) + width_m(right)) })
        })
        .collect()
}

/// The vertices of a leg nearest to the two ends of its width at a place.
fn sides(
    model: &BodyModel,
    vertices: &[u32],
    skinning: &[VertexWeights],
    leg: &[usize; 3],
    middle: Vec3,
) -> Option<[u32; 2]> {
    /// As thick as a slice has to be to have vertices on either side: twice their distance.
    const SLICE_M: f32 = 0.06;
    let place = |v: &usize| model.template[vertices[*v] as usize];
    let slice: Vec<usize> = (0..vertices.len())
        .filter(|v| leg.contains(&usize::from(skinning[*v].main_bone())))
        .filter(|v| (place(v).y - middle.y).abs() < SLICE_M)
        .collect();
    let inwards = -middle.x.signum();
    // The widest there is; of two equally wide the one at the place's own height.
    let reach = |v: &usize, side: f32| side * place(v).x - 0.3 * (place(v).y - middle.y).abs();
    let end = |side: f32| {
        let best = slice
            .iter()
            .max_by(|a, b| reach(a, side).total_cmp(&reach(b, side)));
        best.map(|&v| v as u32)
    };
    Some([end(inwards)?, end(-inwards)?])
}

#[cfg(test)]
mod tests {
    use crate::{smpl::builtin, surface::Surface};

    #[test]
    fn stations_are_mirrored_and_as_wide_as_legs() {
        let model = builtin::body();
        let surface = Surface::new(model.clone(), 2400);
        assert_eq!(surface.legs.len(), 6);
        let place = |v: u32| model.template[surface.vertices[v as usize] as usize];
        for station in &surface.legs {
            assert!((0.05..0.22).contains(&station.least_m), "{station:?}");
            for (left, right) in station.left.iter().zip(&station.right) {
                assert!(place(*left).x > 0.0 && place(*right).x < 0.0);
                assert!((place(*left).y - place(*right).y).abs() < 0.06);
            }
        }
    }
}
