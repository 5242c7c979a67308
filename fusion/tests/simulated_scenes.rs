//! Cleaning and segmentation of rendered figures in a room, against what was rendered.

mod scene;

use std::sync::Arc;

use effigy_capture::{DepthImage, Frame, FrameId, SensorModel, Timestamp};
use effigy_fusion::{
    CleanConfig, CleanFrame, Cleaner, FusionError, TriangleMesh, clean::PersonVisibility,
    mesh::primitives::cuboid,
};
use glam::{Vec3, vec3};
use scene::{
    AZURE, CAMERA, CAMERA_HEIGHT_M, D435, View, at, calibration, expose, figure, render, room,
};

fn clean(view: &View, sensor: SensorModel) -> CleanFrame {
    let mut cleaner = Cleaner::new(calibration(sensor), CleanConfig::default());
    let frame = expose(view, sensor, 0);
    cleaner
        .process(&frame)
        .expect("the frame has the camera's size")
}

/// Pixels of the mask that are not the mesh, and of the mesh that are not in the mask, as shares of the mesh.
fn mask_errors(clean: &CleanFrame, view: &View, mesh: usize) -> (f32, f32) {
    let (mut wrong, mut missing, mut all) = (0, 0, 0);
    for (pixel, &seen) in view.mesh.iter().enumerate() {
        let is_mesh = seen == Some(mesh);
        all += usize::from(is_mesh);
        missing += usize::from(is_mesh && !clean.person[pixel]);
        wrong += usize::from(!is_mesh && clean.person[pixel]);
    }
    (wrong as f32 / all as f32, missing as f32 / all as f32)
}

#[test]
fn a_figure_in_a_room_is_cut_out_and_the_floor_found() {
    for (sensor, tilt_deg, most_missing) in
        [(AZURE, 0.0, 0.04), (AZURE, 12.0, 0.04), (D435, -4.0, 0.06)]
    {
        let view = render(
            &[room(), figure(at(0.2, 2.4), 4)],
            f32::to_radians(tilt_deg),
        );
        let clean = clean(&view, sensor);
        let (wrong, missing) = mask_errors(&clean, &view, 1);
        println!(
            "tilt {tilt_deg}: {wrong} wrong, {missing} missing, {:?}",
            clean.floor
        );
        // Soles within 2 cm and noise of the floor, and mixed pixels of the outline.
        assert!(
            wrong < 0.005 && missing < most_missing,
            "{wrong} wrong, {missing} missing"
        );
        assert_eq!(clean.visibility, PersonVisibility::Whole);
        let floor = clean.floor.unwrap();
        // The floor under a person is wanted to a few millimetres; the tilt to a third of a degree.
        assert!(
            (floor.offset_m + CAMERA_HEIGHT_M).abs() < 0.006,
            "{floor:?}"
        );
        let up = glam::Mat3::from_rotation_x(f32::to_radians(tilt_deg)) * vec3(0.0, -1.0, 0.0);
        assert!(
            floor.normal.angle_between(up).to_degrees() < 0.3,
            "{floor:?}"
        );
    }
}

#[test]
fn cleaning_brings_depth_and_normals_close_to_the_surface() {
    let view = render(&[room(), figure(at(0.0, 2.0), 5)], 0.0);
    let frame = expose(&view, AZURE, 3);
    let clean = clean(&view, AZURE);
    let on_figure = || (0..view.mesh.len()).filter(|&p| clean.person[p] && view.mesh[p] == Some(1));
    let count = on_figure().count() as f32;
    let raw = on_figure()
        .map(|p| {
            (f32::from(frame.depth.pixels()[p]) / 1000.0 - view.depth_m[p])
                .abs()
                .min(0.1)
        })
        .sum::<f32>();
    let cleaned = on_figure()
        .map(|p| (clean.depth.metres[p] - view.depth_m[p]).abs())
        .sum::<f32>();
    println!(
        "raw {:.3} mm, cleaned {:.3} mm",
        1e3 * raw / count,
        1e3 * cleaned / count
    );
    assert!(cleaned < 0.5 * raw);
    for pixel in on_figure() {
        assert!(clean.normals.normals[pixel].dot(clean.vertices.points[pixel]) < 0.0);
        assert!(clean.sigma_m[pixel] > 0.001);
    }
}

#[test]
fn a_figure_cut_at_the_waist_is_partly_visible() {
    let near = render(&[room(), figure(at(0.0, 1.0), 4)], 0.0);
    assert_eq!(clean(&near, AZURE).visibility, PersonVisibility::Partial);
    let behind_a_table = cuboid(vec3(-1.0, 0.2, 1.6), vec3(1.0, CAMERA_HEIGHT_M, 1.8));
    let hidden = render(&[room(), figure(at(0.0, 2.2), 4), behind_a_table], 0.0);
    let clean = clean(&hidden, AZURE);
    assert_eq!(clean.visibility, PersonVisibility::Partial);
    let (wrong, missing) = mask_errors(&clean, &hidden, 1);
    assert!(
        wrong < 0.01 && missing < 0.04,
        "{wrong} wrong, {missing} missing"
    );
}

#[test]
fn nobody_is_found_in_empty_rooms_and_empty_frames() {
    for sensor in [AZURE, D435] {
        let clean = clean(&render(&[room()], 0.1), sensor);
        assert_eq!(clean.visibility, PersonVisibility::Nobody);
        assert!(clean.floor.is_some());
        assert!(!clean.person.contains(&true));
    }
    let mut cleaner = Cleaner::new(calibration(AZURE), CleanConfig::default());
    for raw in [0, u16::MAX, 1000] {
        let depth = DepthImage::new(640, 576, vec![raw; 640 * 576]).unwrap();
        let frame =
            Frame { id: FrameId(0), timestamp: Timestamp(0), depth: Arc::new(depth), color: None };
        let clean = cleaner.process(&frame).unwrap();
        assert_eq!(clean.visibility, PersonVisibility::Nobody);
        assert!(clean.vertices.points.iter().all(|point| point.is_nan()));
    }
}

#[test]
fn furniture_is_not_taken_for_somebody_standing_behind_it() {
    let chair = cuboid(vec3(-1.0, 0.3, 1.7), vec3(-0.55, CAMERA_HEIGHT_M, 2.1));
    let cupboard = cuboid(vec3(1.2, -0.9, 2.0), vec3(2.2, CAMERA_HEIGHT_M, 2.6));
    let view = render(&[room(), figure(at(0.1, 2.6), 4), chair, cupboard], 0.0);
    let clean = clean(&view, AZURE);
    let (wrong, missing) = mask_errors(&clean, &view, 1);
    assert!(
        wrong < 0.01 && missing < 0.04,
        "{wrong} wrong, {missing} missing"
    );
}

#[test]
fn the_nearest_of_two_is_followed_even_when_the_other_comes_nearer() {
    let mut cleaner = Cleaner::new(calibration(AZURE), CleanConfig::default());
    for step in 0..10 {
        let walked_m = 0.08 * step as f32;
        let first = figure(at(-0.5, 2.1 + walked_m), 3);
        let second = figure(at(0.5, 2.6 - walked_m), 3);
        let view = render(&[room(), first, second], 0.0);
        let clean = cleaner.process(&expose(&view, AZURE, step)).unwrap();
        let (wrong, missing) = mask_errors(&clean, &view, 1);
        assert!(
            wrong < 0.01 && missing < 0.04,
            "step {step}: {wrong} wrong, {missing} missing"
        );
    }
}

#[test]
fn whoever_is_picked_is_followed_though_another_is_nearer() {
    let view = |near_m: f32, far_m: f32| {
        render(
            &[
                room(),
                figure(at(-0.6, near_m), 4),
                figure(at(0.7, far_m), 4),
            ],
            0.0,
        )
    };
    let mut cleaner = Cleaner::new(calibration(AZURE), CleanConfig::default());
    cleaner.pick([0.7, 0.4]);
    for number in 0..4 {
        let view = view(2.0, 2.6 + 0.05 * number as f32);
        let clean = cleaner.process(&expose(&view, AZURE, number)).unwrap();
        let (wrong, missing) = mask_errors(&clean, &view, 2);
        assert!(
            wrong < 0.01 && missing < 0.06,
            "{wrong} wrong, {missing} missing"
        );
    }
}

#[test]
fn a_hand_held_out_in_front_of_the_chest_is_the_persons() {
    // The forearm points at the camera and is hidden behind its own hand.
    let hand = {
        let mut ball = effigy_fusion::mesh::primitives::sphere(vec3(0.05, -0.15, 2.0), 0.09, 3);
        ball.triangles
            .iter_mut()
            .for_each(|triangle| triangle.swap(1, 2));
        ball
    };
    let mut person: TriangleMesh = figure(at(0.0, 2.4), 4);
    let offset = person.vertices.len() as u32;
    person.vertices.extend(&hand.vertices);
    person
        .triangles
        .extend(hand.triangles.iter().map(|t| t.map(|v| v + offset)));
    let view = render(&[room(), person], 0.0);
    let (wrong, missing) = mask_errors(&clean(&view, AZURE), &view, 1);
    assert!(
        wrong < 0.005 && missing < 0.04,
        "{wrong} wrong, {missing} missing"
    );
}

#[test]
fn the_same_frames_give_the_same_bits() {
    let view = render(&[room(), figure(at(0.0, 2.2), 3)], 0.05);
    let run = || {
        let mut cleaner = Cleaner::new(calibration(D435), CleanConfig::default());
        (0..3)
            .map(|number| cleaner.process(&expose(&view, D435, number)).unwrap())
            .collect::<Vec<_>>()
    };
    let bits = |frames: Vec<CleanFrame>| {
        frames
            .iter()
            .flat_map(|frame| {
                let points = frame.vertices.points.iter().map(|point| point.z.to_bits());
                let normals = frame
                    .normals
                    .normals
                    .iter()
                    .map(|normal| normal.x.to_bits());
                points
                    .chain(normals)
                    .chain(frame.sigma_m.iter().map(|sigma| sigma.to_bits()))
            })
            .collect::<Vec<u32>>()
    };
    let one = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .unwrap();
    let three = rayon::ThreadPoolBuilder::new()
        .num_threads(3)
        .build()
        .unwrap();
    assert_eq!(bits(one.install(run)), bits(three.install(run)));
}

#[test]
fn a_frame_of_another_size_is_refused_with_both_sizes() {
    let mut cleaner = Cleaner::new(calibration(AZURE), CleanConfig::default());
    let depth = DepthImage::new(320, 288, vec![0; 320 * 288]).unwrap();
    let frame =
        Frame { id: FrameId(0), timestamp: Timestamp(0), depth: Arc::new(depth), color: None };
    let error = cleaner.process(&frame).unwrap_err();
    assert!(matches!(
        error,
        FusionError::SizeMismatch { got_px: [320, 288], .. }
    ));
    assert!(
        error
            .to_string()
            .contains(&format!("[{}, {}]", CAMERA.width, CAMERA.height))
    );
}

#[test]
fn memory_that_served_before_leaves_no_trace_in_the_next_frame() {
    let mut fresh = Cleaner::new(calibration(AZURE), CleanConfig::default());
    let mut recycling = fresh.clone();
    // Somebody walks across: pixels of one frame's person are background in the next.
    for (number, x_m) in [-0.5, 0.4, 0.0].into_iter().enumerate() {
        let view = render(&[room(), figure(at(x_m, 2.4), 4)], 0.0);
        let frame = expose(&view, AZURE, number as u64);
        let expected = fresh.process(&frame).unwrap();
        let found = recycling.process(&frame).unwrap();
        let bits = |clean: &CleanFrame| -> Vec<u32> {
            let points = clean.vertices.points.iter();
            let vectors = points.chain(&clean.normals.normals);
            let numbers = vectors.flat_map(Vec3::to_array);
            let all = numbers.chain(clean.depth.metres.iter().copied());
            all.chain(clean.sigma_m.iter().copied())
                .map(f32::to_bits)
                .collect()
        };
        assert!(bits(&expected) == bits(&found), "frame {number}");
        assert_eq!(expected.person, found.person);
        recycling.recycle(found);
    }
}
