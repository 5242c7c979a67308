//! What sensor and truth claim together.

use effigy_fusion::mesh::closest_point::ClosestPoint;
use effigy_registration::{motion::Routine, smpl::builtin};
use glam::Vec3;

use super::*;
use crate::{
    person::OutfitKind,
    preset::{Mount, SensorPreset},
    scenario::{Likeness, MotionChoice, Room},
    truth::Truth,
};

fn scenario(sensor: SensorPreset, routine: Routine) -> Scenario {
    Scenario { sensor, motion: MotionChoice::Routine(routine), ..Scenario::default() }
}

#[test]
fn noiseless_depth_lies_on_the_clothed_surface() {
    for preset in [SensorPreset::Azure, SensorPreset::D435] {
        let scenario = Scenario {
            noise: Noise::None,
            room: Room::Empty,
            outfit: OutfitKind::Loose,
            ..scenario(preset, Routine::Mixture)
        };
        let mut sensor = SimulatedSensor::new(&scenario, builtin::body()).unwrap();
        let truth = Truth::new(&scenario, builtin::body())
            .unwrap()
            .at(FrameId(140));
        let frame = sensor.expose(FrameId(140)).unwrap();
        let surface = ClosestPoint::from_mesh(&truth.clothed_in_world).unwrap();
        let camera = sensor.calibration().depth.intrinsics;
        let mut seen = 0;
        for (pixel, &raw) in frame.depth.pixels().iter().enumerate() {
            if raw == 0 || pixel % 7 != 0 {
                continue;
            }
            let at = glam::vec2(
                (pixel as u32 % camera.width) as f32,
                (pixel as u32 / camera.width) as f32,
            );
            let point = truth.world_from_camera * camera.unproject(at, f32::from(raw) * 0.001);
            let distance_m = surface.query(point).distance;
            assert!(
                distance_m < 0.001,
                "half a millimetre of rounding, not {distance_m} m"
            );
            seen += 1;
        }
        assert!(seen > 2000, "a person fills {seen} of every seventh pixel");
    }
}

#[test]
fn frames_repeat_bit_for_bit_and_do_not_depend_on_order() {
    let scenario = scenario(SensorPreset::D435, Routine::Wave);
    let mut one = SimulatedSensor::new(&scenario, builtin::body()).unwrap();
    let mut other = SimulatedSensor::new(&scenario, builtin::body()).unwrap();
    let in_order: Vec<_> = (0..3).map(|_| one.next_frame().unwrap().unwrap()).collect();
    for id in [2, 0, 1] {
        let frame = other.expose(FrameId(id)).unwrap();
        assert_eq!(*frame.depth, *in_order[id as usize].depth);
        assert_eq!(frame.timestamp, in_order[id as usize].timestamp);
    }
}

#[test]
fn sensors_beside_each_other_see_what_each_sees_alone() {
    let mount = Mount { height_m: 1.1, distance_m: 2.0, down_rad: 0.0 };
    let scenario = Scenario {
        outfit: OutfitKind::TshirtTrousers,
        mount: Some(mount),
        ..scenario(SensorPreset::Azure, Routine::Wave)
    };
    let mut azure = SimulatedSensor::new(&scenario, builtin::body()).unwrap();
    let mut beside = azure.beside(SensorPreset::D435).unwrap();
    let alone = Scenario { sensor: SensorPreset::D435, ..scenario };
    let mut alone = SimulatedSensor::new(&alone, builtin::body()).unwrap();
    for id in [0, 1, 2].map(FrameId) {
        azure.expose(id).unwrap();
        let (seen, expected) = (beside.expose(id).unwrap(), alone.expose(id).unwrap());
        assert_eq!(seen.depth.pixels(), expected.depth.pixels());
        assert_eq!(seen.timestamp, expected.timestamp);
    }
    assert_eq!(beside.calibration(), alone.calibration());
    let place = beside.truth().unwrap().at(FrameId(0)).world_from_camera;
    assert_eq!(place.translation, Vec3::new(0.0, 1.1, 2.0));
}

#[test]
fn dropped_frames_leave_gaps_and_the_count_knows_it() {
    let scenario = Scenario {
        seconds: 1.0,
        dropped_share: 0.3,
        noise: Noise::None,
        ..scenario(SensorPreset::Oak, Routine::Stand)
    };
    let mut sensor = SimulatedSensor::new(&scenario, builtin::body()).unwrap();
    let mut ids = Vec::new();
    while let Some(frame) = sensor.next_frame().unwrap() {
        ids.push(frame.id.0);
    }
    assert_eq!(ids.len() as u64, sensor.frame_count().unwrap());
    assert!(
        ids.len() > 10 && ids.len() < 30,
        "about 30 % of 30 are missing: {ids:?}"
    );
    assert!(ids.is_sorted() && ids[0] == 0);
}

#[test]
fn late_frames_say_when_they_were_exposed_and_show_that_moment() {
    let scenario = Scenario {
        seconds: 2.0,
        late_share: 0.3,
        noise: Noise::None,
        ..scenario(SensorPreset::Oak, Routine::WalkInPlace)
    };
    let sensor = SimulatedSensor::new(&scenario, builtin::body()).unwrap();
    let truth = Truth::new(&scenario, builtin::body()).unwrap();
    let on_time = Truth::new(&Scenario { late_share: 0.0, ..scenario }, builtin::body()).unwrap();
    let secs = |truth: &Truth, id| truth.at(FrameId(id)).timestamp.as_secs_f64();
    let late: Vec<u64> = (0..60)
        .filter(|&id| secs(&truth, id) > secs(&on_time, id) + 1e-6)
        .collect();
    assert!(
        late.len() > 8 && late.len() < 30,
        "about 30 % of 60: {late:?}"
    );
    for id in 1..60 {
        assert!(
            secs(&truth, id) > secs(&truth, id - 1),
            "never before the frame in front"
        );
    }
    let [a, b] = [&truth, &on_time].map(|t| t.params(FrameId(late[3])));
    assert_ne!(a, b, "the body has moved on by then");
    assert_eq!(sensor.frame_count(), Some(60));
}

/// The colour image is looked up through the calibration, as a user would do it.
#[test]
fn the_colour_cameras_place_and_lens_are_those_of_the_calibration() {
    for preset in SensorPreset::ALL {
        let scenario = Scenario {
            color: true,
            noise: Noise::None,
            room: Room::Empty,
            ..scenario(preset, Routine::Wave)
        };
        let mut sensor = SimulatedSensor::new(&scenario, builtin::body()).unwrap();
        let picture = sensor.expose(FrameId(40)).unwrap().color.unwrap();
        let calibration = sensor.calibration().clone();
        let camera = calibration.color.unwrap();
        let view = sensor.view(FrameId(40)).clone();
        let share = |color_from_depth: effigy_capture::Rigid3| {
            let (mut alike, mut all) = (0.0, 0.0);
            for pixel in (0..view.depth_m.len()).step_by(5) {
                let Some(point) = view.point(pixel) else {
                    continue;
                };
                let at = camera.project(color_from_depth * point).round();
                let inside = at.x >= 0.0
                    && at.y >= 0.0
                    && at.x < picture.width() as f32
                    && at.y < picture.height() as f32;
                if inside {
                    let seen =
                        picture.pixels()[at.y as usize * picture.width() as usize + at.x as usize];
                    all += 1.0;
                    alike += f64::from(u8::from(same_hue(seen, view.colors[pixel])));
                }
            }
            alike / all
        };
        let right = share(calibration.color_from_depth);
        let wrong = share(effigy_capture::Rigid3::IDENTITY);
        assert!(right > 0.93, "{}: {right} of the pixels", preset.name());
        assert!(
            wrong < right - 0.02,
            "{}: without the offset {wrong}",
            preset.name()
        );
    }
}

/// Whether one colour is the other in another light.
fn same_hue(shaded: [u8; 3], color: [u8; 3]) -> bool {
    let [a, b] = [shaded, color].map(|c| Vec3::from(c.map(f32::from)).normalize_or_zero());
    a.dot(b) > 0.997
}

#[test]
fn the_best_parameters_of_an_individual_come_with_their_residual() {
    for likeness in [Likeness::Model, Likeness::Individual] {
        let scenario = Scenario { likeness, ..scenario(SensorPreset::Azure, Routine::Squat) };
        let truth = Truth::new(&scenario, builtin::body()).unwrap();
        let ground = truth.at(FrameId(40));
        let of_params = truth.person().body.pose(&ground.params);
        let joints_m = (0..24)
            .map(|j| of_params.joints[j].distance(ground.minimal.joints[j]))
            .fold(0.0, f32::max);
        match likeness {
            Likeness::Model => assert_eq!((ground.params_residual_m, joints_m), (0.0, 0.0)),
            Likeness::Individual => {
                let residual_m = ground.params_residual_m;
                assert!((0.001..0.02).contains(&residual_m), "{residual_m} m");
                assert!(
                    joints_m < 0.02,
                    "the skeleton is nearly the model's: {joints_m} m"
                );
            }
        }
        let mut sensor = SimulatedSensor::new(&scenario, builtin::body()).unwrap();
        let lowest_m = ground
            .clothed_in_world
            .vertices
            .iter()
            .map(|v| v.y)
            .fold(f32::MAX, f32::min);
        assert!(lowest_m.abs() < 0.01, "on the floor, not at {lowest_m} m");
        assert!(
            sensor
                .view(FrameId(40))
                .labels
                .iter()
                .any(|label| label.is_person())
        );
    }
}

/// Betas of the tallest of some people.
fn tallest() -> [f32; 10] {
    let body = builtin::body();
    let height = |betas: &[f32; 10]| {
        let ys = body.shaped_vertices(betas).into_iter().map(|v| v.y);
        ys.clone().fold(f32::MIN, f32::max) - ys.fold(f32::MAX, f32::min)
    };
    let people = (0..60).map(|seed| crate::person::sample_betas(&body, seed));
    people
        .max_by(|a, b| height(a).total_cmp(&height(b)))
        .unwrap()
}

#[test]
fn the_whole_body_is_in_view_and_on_the_floor() {
    let betas = Some(tallest());
    for routine in Routine::ALL.into_iter().chain(Routine::ACTIONS) {
        for preset in SensorPreset::ALL {
            let outfit = OutfitKind::Loose;
            let scenario = Scenario { outfit, betas, ..scenario(preset, routine) };
            let scene = Scene::new(&scenario, builtin::body()).unwrap();
            let camera = scene.scenario.calibration().depth.intrinsics;
            let frames = (scene.motion_secs() * 30.0) as u64;
            for frame in (0..frames).step_by(23) {
                let pose = scene.pose(FrameId(frame));
                let mesh = scene.person.clothed_posed(&pose.theta, pose.trans);
                let lowest_m = mesh.vertices.iter().map(|v| v.y).fold(f32::MAX, f32::min);
                assert!(
                    lowest_m.abs() < 0.006,
                    "{routine:?}: stands {lowest_m} m over the floor"
                );
                for vertex in &mesh.vertices {
                    let in_camera = scene.world_from_camera.inverse() * *vertex;
                    assert_in_image(in_camera, &camera, routine, preset);
                }
            }
        }
    }
}

fn assert_in_image(
    point: Vec3,
    camera: &effigy_capture::Intrinsics,
    routine: Routine,
    preset: SensorPreset,
) {
    let pixel = camera.project(point);
    let (width, height) = (camera.width as f32, camera.height as f32);
    let inside = pixel.x > 2.0 && pixel.x < width - 3.0 && pixel.y > 2.0 && pixel.y < height - 3.0;
    assert!(
        inside,
        "{routine:?} on {}: {point} falls on {pixel}",
        preset.name()
    );
}
