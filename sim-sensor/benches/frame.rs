//! What a simulated frame costs: dressing and posing, drawing, exposing; and simulating cloth.

use std::sync::Arc;

use criterion::{Criterion, criterion_group, criterion_main};
use effigy_capture::{FrameId, FrameSource as _};
use effigy_registration::{motion::Routine, smpl::builtin};
use effigy_sim_sensor::{
    Outfit, OutfitKind, Person, Room, Scenario, SensorPreset, SimulatedSensor, Truth,
    cloth::{ClothConfig, ClothKind, Wear},
    noise::Exposure,
    person::sample_betas,
    render::Renderer,
};

fn frame(criterion: &mut Criterion) {
    for sensor in SensorPreset::ALL {
        let scenario = Scenario { sensor, outfit: OutfitKind::Loose, ..Scenario::default() };
        let truth = Truth::new(&scenario, builtin::body()).expect("a default scenario is valid");
        let mut simulated =
            SimulatedSensor::new(&scenario, builtin::body()).expect("a default scenario is valid");
        let calibration = simulated.calibration().clone();
        let ground = truth.at(FrameId(100));
        let person = truth.person();
        let mut renderer = Renderer::new(
            calibration.depth.intrinsics,
            ground.world_from_camera,
            Room::default(),
        );
        let mut group = criterion.benchmark_group(sensor.name());
        group.sample_size(20);
        group.bench_function("dress and pose", |b| {
            b.iter(|| person.clothed_posed(&ground.params.theta, ground.params.trans));
        });
        group.bench_function("draw", |b| {
            b.iter(|| {
                let view = renderer.render(
                    &ground.clothed_in_world,
                    &person.paint,
                    &person.body.skinning,
                );
                view.depth_m[0]
            });
        });
        let view = simulated.view(FrameId(100)).clone();
        let mut exposure = Exposure::new(&calibration, sensor.defects());
        group.bench_function("expose", |b| {
            b.iter(|| exposure.expose(&view, 1, FrameId(100)));
        });
        group.finish();
    }
}

/// One frame of a fully dressed person at 30 Hz, the body's posing included; the bar is 350 ms on one core.
fn cloth(criterion: &mut Criterion) {
    let body = builtin::body();
    let betas = sample_betas(&body, 1);
    let person = Arc::new(Person::new(body, betas, Outfit::UNDER, 1));
    let motion = Routine::WalkInPlace.motion(&person.rest_body(), 30.0, 1);
    let mut group = criterion.benchmark_group("cloth");
    group.sample_size(20);
    for kind in [
        ClothKind::Dress,
        ClothKind::TshirtTrousers,
        ClothKind::BlazerTrousers,
    ] {
        let mut wear = Wear::new(Arc::clone(&person), kind, 0.8, 1, ClothConfig::default());
        wear.start(&motion.poses[0]);
        let mut poses = motion.poses.iter().cycle();
        group.bench_function(kind.name(), |b| {
            b.iter(|| {
                if let Some(pose) = poses.next() {
                    wear.step(pose, 1.0 / 30.0);
                }
            });
        });
    }
    group.finish();
}

criterion_group!(benches, frame, cloth);
criterion_main!(benches);
