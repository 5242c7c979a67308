//! What clothes do that no function of the pose can know: the same pose, reached in two ways.
//!
//! After its last frame a sequence is played on: the movement slows down, turns around, and goes back through the
//! poses it came from. In each of these the clothes lie differently the second time. A model that sees the pose
//! alone answers the same to both, so its two errors add up to at least their distance.

use effigy_capture::FrameId;
use effigy_fusion::mesh::{TriangleMesh, closest_point::ClosestPoint};
use effigy_registration::smpl::{MEASURED_JOINTS, VertexWeights};
use glam::Vec3;
use serde::{Deserialize, Serialize};

use super::sequence::Sequence;
use crate::{
    cloth::{Behaviour, strays_m},
    truth::Truth,
};

/// What the clothes of a sequence do.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ClothFacts {
    /// How far points of garments on measured bones stray in star pose from their mean over the frames, root mean
    /// square.
    pub strays_rms_mm: f32,
    /// The same of the point that a tenth of them stray further than.
    pub strays_p90_mm: f32,
    /// Share of edges longer or shorter than cut and let out by more than 15 %, and of points deeper than 2 mm inside the minimal
    /// body, 0 to 1, over the frames; points in every fourth.
    pub strained_share: f32,
    pub deep_share: f32,
    /// The least mean error (`D_f`) over two visits to the same poses that a function of the pose can have: half the
    /// mean distance of measured vertices to the other visit's surface, both ways. Only of test people.
    pub history_floor_cm: Option<f32>,
}

/// Frames in which the movement turns around, and frames it then goes back.
const TURN_FRAMES: u32 = 6;
const BACK_FRAMES: u32 = 12;
/// Poses that are compared; the first is a third of the way back, where the turn itself has died down.
const VISITS: u32 = 3;

/// The frames of a sequence that are visited again, later ones first.
pub(super) fn revisited(frames: u32) -> Vec<u64> {
    let last = frames.saturating_sub(1);
    let back = BACK_FRAMES.min(last);
    let visits = (1..=VISITS).map(|visit| u64::from(last - back * visit / VISITS));
    let mut visits: Vec<u64> = visits.filter(|&frame| frame < u64::from(last)).collect();
    visits.dedup();
    visits
}

/// Half the mean distance between the surfaces of the first visits (by frame, in the order of [`revisited`]) and of
/// the second; `None` without simulated clothes.
pub(super) fn history_floor_cm(
    truth: &Truth,
    weights: &[VertexWeights],
    first_visits: &[(u64, TriangleMesh)],
    last: u64,
) -> Option<f32> {
    let scene = truth.scene();
    let mut wear = scene.wear_after(FrameId(last))?;
    let secs = scene.scenario.rate_hz().recip();
    for step in 1..=TURN_FRAMES {
        // Constant deceleration from one frame a step forwards to one backwards.
        let step = f64::from(step);
        let beyond = step - step * step / f64::from(TURN_FRAMES);
        wear.step(&scene.pose_between(last as f64 + beyond), secs);
    }
    let (mut sum_m, mut count) = (0.0, 0);
    let mut now = last;
    for (frame, first) in first_visits {
        while now > *frame {
            now -= 1;
            wear.step(&scene.pose(FrameId(now)), secs);
        }
        let second = wear.surface().envelope().posed;
        for (from, to) in [(first, &second), (&second, first)] {
            let tree = ClosestPoint::from_mesh(to).ok()?;
            let measured = measured_points(from, weights);
            count += measured.len();
            let hits = tree.query_all(&measured);
            sum_m += hits.iter().map(|hit| f64::from(hit.distance)).sum::<f64>();
        }
    }
    (count > 0).then(|| (0.5 * 100.0 * sum_m / count as f64) as f32)
}

/// Vertices that triangles use, where MetaAvatar measures.
fn measured_points(mesh: &TriangleMesh, weights: &[VertexWeights]) -> Vec<Vec3> {
    let mut used = vec![false; mesh.vertices.len()];
    for &v in mesh.triangles.iter().flatten() {
        used[v as usize] = true;
    }
    let vertices = mesh.vertices.iter().zip(weights).zip(used);
    vertices
        .filter(|((_, weights), used)| *used && is_measured(weights))
        .map(|((point, _), _)| *point)
        .collect()
}

fn is_measured(weights: &VertexWeights) -> bool {
    MEASURED_JOINTS.contains(&weights.main_bone())
}

/// How much a sequence's clothes move beyond what skinning says; `None` without garments of their own.
pub(super) fn cloth_facts(
    sequence: &Sequence,
    behaviour: &Behaviour,
    history_floor_cm: Option<f32>,
) -> Option<ClothFacts> {
    let of_cloth: Vec<usize> = (0..sequence.weights.len())
        .filter(|&v| sequence.layers[v] > 0 && is_measured(&sequence.weights[v]))
        .collect();
    let stars = sequence.frames.iter();
    let places: Vec<Vec<Vec3>> = stars
        .map(|frame| of_cloth.iter().map(|&v| frame.star[v]).collect())
        .collect();
    let mut strays = strays_m(&places);
    strays.sort_by(f32::total_cmp);
    let p90 = *strays.get(strays.len() * 9 / 10)?;
    let squares: f64 = strays.iter().map(|m| f64::from(*m).powi(2)).sum();
    Some(ClothFacts {
        strays_rms_mm: (1e3 * (squares / strays.len() as f64).sqrt()) as f32,
        strays_p90_mm: 1e3 * p90,
        strained_share: behaviour.strained_share(),
        deep_share: behaviour.deep_share(),
        history_floor_cm,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn poses_are_visited_again_in_the_order_of_the_way_back() {
        assert_eq!(revisited(40), [35, 31, 27]);
        assert_eq!(revisited(6), [4, 2, 0]);
        assert_eq!(revisited(1), [0; 0]);
    }
}
