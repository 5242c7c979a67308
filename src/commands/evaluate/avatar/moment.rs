//! A sequence between its frames: data sets are kept at 12 Hz, sensors deliver 30.

use effigy_sim_sensor::dataset::{Sequence, SequenceFrame};
use glam::{Quat, Vec3};

/// A sequence of one frame: `at` counts in frames and may lie between two of them. Star-pose surface and translation
/// are interpolated linearly, joints along the shortest turn; what is visible is that of the nearer frame.
pub(super) fn moment(sequence: &Sequence, at: f32) -> Sequence {
    let last = sequence.frames.len() - 1;
    let at = at.clamp(0.0, last as f32);
    let before = (at.floor() as usize).min(last);
    let share = at - before as f32;
    let (a, b) = (
        &sequence.frames[before],
        &sequence.frames[(before + 1).min(last)],
    );
    let nearer = if share < 0.5 { a } else { b };
    let between = |a: Vec3, b: Vec3| a.lerp(b, share);
    let frame = SequenceFrame {
        theta: std::array::from_fn(|joint| turned(a.theta[joint], b.theta[joint], share)),
        trans: between(a.trans, b.trans),
        params_trans: between(a.params_trans, b.params_trans),
        star: a
            .star
            .iter()
            .zip(&b.star)
            .map(|(&a, &b)| between(a, b))
            .collect(),
        ..nearer.clone()
    };
    Sequence { frames: vec![frame], ..sequence.clone() }
}

fn turned(a: Vec3, b: Vec3, share: f32) -> Vec3 {
    let turn = Quat::from_scaled_axis(a).slerp(Quat::from_scaled_axis(b), share);
    let shortest = if turn.w < 0.0 { -turn } else { turn };
    shortest.to_scaled_axis()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_way_between_two_turns_is_half_the_turn() {
        let half = turned(Vec3::X * 0.2, Vec3::X * 0.6, 0.5);
        assert!((half - Vec3::X * 0.4).length() < 1e-6, "{half}");
        // Across half a turn the short way is taken.
        let across = turned(Vec3::Y * 3.1, Vec3::Y * -3.1, 0.5);
        assert!(
            (across.length() - std::f32::consts::PI).abs() < 1e-3,
            "{across}"
        );
    }
}
