//! Room to move: what would be too short when the wearer squats, bends, reaches out or raises the arms is let out.
//!
//! Clothes cut to somebody who stands cannot follow everywhere: the back widens by a fifth when the arms reach
//! forward, the seat when one sits down. Tailors leave ease there, knitters use yarn that gives; here single edges
//! become longer.

use effigy_registration::{motion::Routine, smpl::BoneTransforms};
use glam::Vec3;

use super::{form::Form, sew::Garment, sheet::Edge, wear::bones_of};
use crate::person::Person;

/// What is done while trying on, how often the tailor looks, and how many times.
const TRIALS: [Routine; 6] = [
    Routine::Squat,
    Routine::Reach,
    Routine::Bend,
    Routine::RaiseArms,
    Routine::Punch,
    Routine::BallerinaSpin,
];
const LOOKS_HZ: f32 = 4.0;
const LOOKS: usize = 16;
/// Nothing is let out further.
const MOST: f32 = 1.4;

/// The poses clothes are tried on in, as bones.
pub(super) fn trials(person: &Person) -> Vec<BoneTransforms> {
    let rest = person.rest_body();
    let trial = |routine: Routine| {
        let poses = routine.motion(&rest, LOOKS_HZ, 0).poses.into_iter();
        poses.take(LOOKS).map(|pose| bones_of(person, &pose.theta))
    };
    TRIALS.into_iter().flat_map(trial).collect()
}

/// By what factor each edge of a garment is longer than it was cut on its form: as long as the trials need it, no longer.
/// With 11 % more the tightest shirt stood 2.4 cm off its wearer; what folds of flesh need beyond, cloth stretches.
pub(super) fn let_out(garment: &Garment, form: &Form, trials: &[BoneTransforms]) -> Vec<f32> {
    let edges = garment.rest.edges();
    // Between a neck and a belt that hold it, what is too wide never comes to rest.
    if garment.pattern.is_tucked_in() {
        return vec![1.0; edges.len()];
    }
    let (points, weights) = (&garment.rest.points, &garment.weights);
    let at_rest: Vec<Vec3> = points
        .iter()
        .zip(weights)
        .map(|(point, weights)| form.at_rest(*point, weights))
        .collect();
    let across = |points: &[Vec3], edge: &Edge| {
        let [a, b] = edge.ends.map(|v| points[v as usize]);
        a - b
    };
    let cut: Vec<Vec3> = edges.iter().map(|edge| across(points, edge)).collect();
    let mut longest_m: Vec<f32> = cut.iter().map(|cut| cut.length()).collect();
    for bones in trials {
        let moved: Vec<Vec3> = at_rest
            .iter()
            .zip(weights)
            .map(|(point, weights)| bones.blend(weights).transform_point3(*point))
            .collect();
        for (longest_m, edge) in longest_m.iter_mut().zip(&edges) {
            *longest_m = longest_m.max(across(&moved, edge).length());
        }
    }
    let factor = |(longest_m, cut): (f32, Vec3)| {
        let needed = (longest_m / cut.length().max(1e-6)).clamp(1.0, MOST);
        // Shirts and skirts ride up instead of growing longer.
        let sideways = if garment.pattern.has_legs() {
            1.0
        } else {
            1.0 - cut.normalize_or_zero().y.powi(2)
        };
        1.0 + (needed - 1.0) * sideways
    };
    longest_m.into_iter().zip(cut).map(factor).collect()
}
