//! What a simulated frame costs: dressing and posing, drawing, exposing.

use criterion::{Criterion, criterion_group, criterion_main};
use effigy_capture::{FrameId, FrameSource as _};
use effigy_registration::smpl::builtin;
use effigy_sim_sensor::{
    OutfitKind, Room, Scenario, SensorPreset, SimulatedSensor, Truth, noise::Exposure,
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

criterion_group!(benches, frame);
criterion_main!(benches);
