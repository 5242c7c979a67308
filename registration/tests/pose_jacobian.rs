//! The analytic Jacobian agrees with finite differences.

use std::sync::Arc;

use effigy_registration::smpl::{
    BodyModel, BodyParams, PARAMETER_COUNT, PoseDirection, PoseJacobian, Poser, builtin,
};
use glam::Vec3;

/// Central differences of this step are off by its square; f32 noise of 2e-7 m adds 2e-5.
const STEP: f32 = 1e-2;
const TOLERANCE_M: f32 = 4e-4;

#[test]
fn vertex_rows_match_finite_differences() {
    let (model, params) = (plain_body(), some_params());
    let mut jacobian = PoseJacobian::new(Arc::clone(&model));
    jacobian.update(&params);
    let mut poser = Poser::new(Arc::clone(&model));
    let differences = differences(&params, |p| poser.pose(p).vertices.clone());
    let mut rows = [Vec3::ZERO; PARAMETER_COUNT];
    for vertex in (0..model.vertex_count()).step_by(37) {
        jacobian.vertex_rows(vertex, &mut rows);
        for (column, row) in rows.iter().enumerate() {
            let expected = differences[column][vertex];
            assert!(
                row.distance(expected) < TOLERANCE_M,
                "vertex {vertex}, column {column}"
            );
        }
    }
}

#[test]
fn joint_rows_match_finite_differences() {
    let (model, params) = (plain_body(), some_params());
    let mut jacobian = PoseJacobian::new(Arc::clone(&model));
    jacobian.update(&params);
    let mut poser = Poser::new(model);
    let differences = differences(&params, |p| poser.pose(p).joints.to_vec());
    let mut rows = [Vec3::ZERO; PARAMETER_COUNT];
    for joint in 0..24 {
        jacobian.joint_rows(joint, &mut rows);
        for (column, (row, difference)) in rows.iter().zip(&differences).enumerate() {
            let expected = difference[joint];
            assert!(
                row.distance(expected) < TOLERANCE_M,
                "joint {joint}, column {column}"
            );
        }
    }
}

#[test]
fn poser_repeats_the_model_bit_for_bit() {
    let (model, params) = (builtin::body(), some_params());
    let mut poser = Poser::new(Arc::clone(&model));
    poser.pose(&BodyParams::ZERO);
    let posed = poser.pose(&params);
    let expected = model.pose(&params);
    assert_eq!(posed.vertices, expected.vertices);
    assert_eq!(posed.joints, expected.joints);
}

fn differences(
    params: &BodyParams,
    mut points: impl FnMut(&BodyParams) -> Vec<Vec3>,
) -> Vec<Vec<Vec3>> {
    (0..PARAMETER_COUNT)
        .map(|column| {
            let after = points(&nudged(params, column, STEP));
            let before = points(&nudged(params, column, -STEP));
            after
                .iter()
                .zip(&before)
                .map(|(a, b)| (a - b) / (2.0 * STEP))
                .collect()
        })
        .collect()
}

fn nudged(params: &BodyParams, column: usize, by: f32) -> BodyParams {
    let mut nudged = *params;
    match column {
        0..72 => nudged.theta[column / 3][column % 3] += by,
        72..82 => nudged.betas[column - 72] += by,
        _ => nudged.trans[column - 82] += by,
    }
    nudged
}

/// The Jacobian leaves the change of pose correctives out, so they are taken out here.
fn plain_body() -> Arc<BodyModel> {
    let mut model = BodyModel::clone(&builtin::body());
    model.pose_dirs = vec![PoseDirection::default(); 207];
    Arc::new(model)
}

fn some_params() -> BodyParams {
    let wave = |i: usize, j: usize| ((i * 7 + j * 3) as f32 * 0.61).sin();
    BodyParams {
        betas: std::array::from_fn(|i| wave(i, 5)),
        theta: std::array::from_fn(|i| Vec3::new(wave(i, 0), wave(i, 1), wave(i, 2)) * 0.8),
        trans: Vec3::new(0.3, 0.9, -2.1),
    }
}
