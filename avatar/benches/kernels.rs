//! How long each piece of the avatar takes, on all threads: `cargo bench -p effigy-avatar`.

use std::{hint::black_box, sync::Arc};

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use effigy_avatar::{
    Avatar, DriveConfig, Driver, SignedDistanceField as _, Subject, TopologyConfig, hyper, mesher,
    sdf::{
        SirenConfig, SirenField,
        batch::{FieldFrame, FieldGradients},
        loss::{Known, LossConfig, LossPoint},
    },
    skinning::{ClosestBodyPoint, ClosestBodyPointConfig, Skinning as _},
};
use effigy_capture::FrameId;
use effigy_registration::{
    BodyParams,
    smpl::{JOINT_COUNT, builtin},
};
use glam::Vec3;
use rand::{RngExt as _, SeedableRng as _, rngs::StdRng};

const FRAMES: usize = 8;
const POINTS: usize = 1500;

fn random_points(count: usize, rng: &mut StdRng) -> Vec<Vec3> {
    let mut next = || rng.random_range(-1.0..1.0);
    (0..count)
        .map(|_| Vec3::new(next(), next(), next()))
        .collect()
}

/// Values, gradients, and the backward pass through both.
fn field(criterion: &mut Criterion) {
    let mut rng = StdRng::seed_from_u64(1);
    for (name, config) in [("live", SirenConfig::LIVE), ("paper", SirenConfig::PAPER)] {
        let field = SirenField::init(config, &mut rng);
        let points = random_points(FRAMES * POINTS, &mut rng);
        let mut values = vec![0.0; points.len()];
        let mut gradients = vec![Vec3::ZERO; points.len()];
        let mut group = criterion.benchmark_group(name);
        group.throughput(Throughput::Elements(points.len() as u64));
        group.bench_function("values", |b| b.iter(|| field.values(&points, &mut values)));
        group.bench_function("values and gradients", |b| {
            b.iter(|| field.values_and_gradients(&points, &mut values, &mut gradients));
        });
        let known: Vec<LossPoint> = points
            .iter()
            .map(|point| LossPoint {
                known: Known::Surface { normal: point.normalize_or(Vec3::Y) },
                weight: 1.0,
            })
            .collect();
        let frames: Vec<FieldFrame<'_>> = points
            .chunks(POINTS)
            .zip(known.chunks(POINTS))
            .map(|(points, known)| FieldFrame { parameters: field.parameters(), points, known })
            .collect();
        let mut batch = FieldGradients::new(config);
        let loss = LossConfig::paper();
        group.bench_function("loss and its gradient, 8 frames", |b| {
            b.iter(|| black_box(batch.compute(&frames, &loss)));
        });
        group.finish();
    }
}

/// The shipped prior as somebody's avatar.
fn avatar(criterion: &mut Criterion) {
    let body = builtin::body();
    let subject = Subject::new(&body, &[0.0; 10]).expect("the built-in body has vertices");
    let skinning = ClosestBodyPoint::new(
        Arc::clone(&body),
        &subject.betas,
        ClosestBodyPointConfig::default(),
    );
    let network = Arc::new(hyper::prior());
    let theta: [Vec3; JOINT_COUNT] =
        std::array::from_fn(|joint| Vec3::new(0.1, 0.02 * joint as f32, -0.05));
    let pose = subject.pose_input(&theta);
    criterion.bench_function("a pose's field from the hypernetwork", |b| {
        b.iter(|| black_box(network.field(&pose)));
    });
    let sdf = network.field(&pose);
    let mut group = criterion.benchmark_group("whole surface");
    group.sample_size(10);
    group.bench_function("mesh in 128^3", |b| {
        b.iter(|| black_box(mesher::extract(&sdf, 128)));
    });
    let config = TopologyConfig::default();
    group.bench_function("fixed topology with skinning", |b| {
        b.iter(|| {
            let avatar = Avatar::new(&subject, network.clone(), &skinning, &theta, &config);
            black_box(avatar.is_ok())
        });
    });
    group.finish();
    let avatar = Avatar::new(&subject, network.clone(), &skinning, &theta, &config)
        .expect("the prior has a surface");
    let points: Vec<Vec3> = avatar
        .topology
        .vertices_in_unit
        .iter()
        .map(|&vertex| subject.unit_box.canonical_from_unit(vertex))
        .collect();
    let normals = avatar.topology.normals.clone();
    criterion.bench_function("forward skinning, 7 k points", |b| {
        b.iter(|| black_box(skinning.forward(&points, &normals)));
    });
    let mut driver = Driver::new(Arc::new(avatar), DriveConfig::default());
    let params = BodyParams { betas: subject.betas, theta, trans: Vec3::ZERO };
    criterion.bench_function("drive one pose, 7 k vertices", |b| {
        b.iter(|| black_box(driver.pose(&params, FrameId(0))));
    });
}

criterion_group!(benches, field, avatar);
criterion_main!(benches);
