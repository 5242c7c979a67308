//! How long it takes to pose the whole body, and to ask for derivatives.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use effigy_registration::smpl::{BodyParams, PARAMETER_COUNT, PoseJacobian, Poser, builtin};
use glam::Vec3;

fn pose_body(criterion: &mut Criterion) {
    let body = builtin::body();
    let mut params = BodyParams::ZERO;
    params.betas = [0.3; 10];
    params.theta = std::array::from_fn(|joint| Vec3::new(0.3, 0.1 * joint as f32, -0.2));
    criterion.bench_function("pose, allocating", |b| {
        b.iter(|| black_box(body.pose(&params)));
    });
    let mut poser = Poser::new(builtin::body());
    criterion.bench_function("pose, buffers kept", |b| {
        b.iter(|| black_box(poser.pose(&params).joints[0]));
    });
    let mut jacobian = PoseJacobian::new(builtin::body());
    let mut rows = [Vec3::ZERO; PARAMETER_COUNT];
    criterion.bench_function("pose and 1000 vertex rows", |b| {
        b.iter(|| {
            jacobian.update(&params);
            for vertex in 0..1000 {
                jacobian.vertex_rows(vertex, &mut rows);
                black_box(&rows);
            }
        });
    });
}

criterion_group!(benches, pose_body);
criterion_main!(benches);
