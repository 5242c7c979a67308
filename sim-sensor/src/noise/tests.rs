//! What the noise claims: its sigma follows the sensor's model, and its defects are where they belong.

use glam::Vec3;

use super::*;
use crate::{preset::SensorPreset, render::Label};

/// A frontal wall, and perhaps a nearer slab over the image's middle columns.
fn scene(preset: SensorPreset, wall_m: f32, slab_m: Option<f32>) -> View {
    let camera = preset.intrinsics();
    let count = camera.pixel_count();
    let width = camera.width as usize;
    let in_slab = |pixel: usize| (width * 2 / 5..width * 3 / 5).contains(&(pixel % width));
    let depth_m = (0..count)
        .map(|pixel| slab_m.filter(|_| in_slab(pixel)).unwrap_or(wall_m))
        .collect();
    let mut view = View {
        width,
        height: camera.height as usize,
        depth_m,
        normals: vec![Vec3::NEG_Z; count],
        incidence_rad: vec![0.0; count],
        cosine: vec![0.0; count],
        labels: vec![Label::Wall; count],
        reflectance: vec![0.8; count],
        colors: vec![[200; 3]; count],
        camera,
    };
    (0..count).for_each(|pixel| view.measure_incidence(pixel));
    view
}

fn exposure(preset: SensorPreset) -> Exposure {
    let mut calibration = preset.calibration();
    calibration.metres_per_unit = 0.0001;
    Exposure::new(&calibration, preset.defects())
}

/// Errors in metres around the image's centre, where the wall is frontal; missing pixels are left out.
fn central_errors_m(preset: SensorPreset, wall_m: f32, frame: u64) -> Vec<f64> {
    let view = scene(preset, wall_m, None);
    let raw = exposure(preset).expose(&view, 11, FrameId(frame));
    let (width, height) = (view.width, view.height);
    let mut errors = Vec::new();
    for y in height * 3 / 8..height * 5 / 8 {
        for x in width * 3 / 8..width * 5 / 8 {
            let raw = raw[y * width + x];
            if raw > 0 {
                errors.push(f64::from(raw) * 0.0001 - f64::from(wall_m));
            }
        }
    }
    errors
}

fn deviation(values: &[f64]) -> f64 {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / values.len() as f64).sqrt()
}

#[test]
fn sigma_on_a_frontal_wall_follows_the_sensors_model() {
    for preset in SensorPreset::ALL {
        let model = preset.sensor_model();
        for wall_m in [1.013, 1.517, 2.021, 2.517, 3.019] {
            let errors: Vec<f64> = (0..3)
                .flat_map(|f| central_errors_m(preset, wall_m, f))
                .collect();
            let measured = deviation(&errors);
            let expected = f64::from(model.sigma_m(wall_m, 0.0));
            let ratio = measured / expected;
            println!(
                "{} at {wall_m} m: {:.2} mm, model {:.2} mm",
                preset.name(),
                measured * 1e3,
                expected * 1e3
            );
            assert!(
                (0.85..1.15).contains(&ratio),
                "{} at {wall_m} m: ratio {ratio}",
                preset.name()
            );
        }
    }
}

#[test]
fn the_same_seed_and_frame_give_the_same_bits_in_any_order() {
    for preset in SensorPreset::ALL {
        let view = scene(preset, 2.0, Some(1.4));
        let mut one = exposure(preset);
        let first = one.expose(&view, 5, FrameId(0));
        let second = one.expose(&view, 5, FrameId(1));
        let mut other = exposure(preset);
        assert_eq!(other.expose(&view, 5, FrameId(1)), second);
        assert_eq!(other.expose(&view, 5, FrameId(0)), first);
        assert_ne!(first, second, "{}: frames differ", preset.name());
        assert_ne!(
            other.expose(&view, 6, FrameId(0)),
            first,
            "{}: seeds differ",
            preset.name()
        );
    }
}

/// Correlation of errors between pixels of a row, this many columns apart.
fn correlation(preset: SensorPreset, lag: usize) -> f64 {
    let view = scene(preset, 2.0, None);
    let raw = exposure(preset).expose(&view, 3, FrameId(0));
    let width = view.width;
    let error = |p: usize| (raw[p] > 0).then(|| f64::from(raw[p]) * 0.0001 - 2.0);
    let (mut products, mut squares, mut n) = (0.0, 0.0, 0.0);
    for y in view.height / 3..view.height * 2 / 3 {
        for x in width / 3..width * 2 / 3 {
            if let (Some(a), Some(b)) = (error(y * width + x), error(y * width + x + lag)) {
                products += a * b;
                squares += a * a;
                n += 1.0;
            }
        }
    }
    assert!(n > 1000.0, "most pixels are there");
    products / squares
}

#[test]
fn stereo_noise_is_alike_within_its_window_and_phase_noise_is_not() {
    let near = correlation(SensorPreset::D435, 2);
    let far = correlation(SensorPreset::D435, 12);
    let phase = correlation(SensorPreset::Azure, 1);
    assert!(
        near > 0.4,
        "two pixels apart share most of a 7 px window: {near}"
    );
    assert!(far.abs() < 0.15, "12 pixels apart share nothing: {far}");
    assert!(phase.abs() < 0.05, "phase pixels are independent: {phase}");
}

#[test]
fn stereo_shadows_fall_to_the_left_and_are_as_wide_as_the_disparity_step() {
    let preset = SensorPreset::D435;
    let (wall_m, slab_m) = (2.5, 1.5);
    let view = scene(preset, wall_m, Some(slab_m));
    let raw = exposure(preset).expose(&view, 3, FrameId(0));
    let (width, height) = (view.width, view.height);
    let missing = |columns: std::ops::Range<usize>| -> f32 {
        let pixels = (0..height).flat_map(|y| columns.clone().map(move |x| y * width + x));
        pixels.filter(|&p| raw[p] == 0).count() as f32 / height as f32
    };
    let (left, right) = (width * 2 / 5, width * 3 / 5);
    let step_px = 424.0 * 0.05 * (1.0 / slab_m - 1.0 / wall_m);
    let shadow_px = missing(left - 30..left);
    assert!(
        (shadow_px - step_px).abs() < 1.5,
        "{shadow_px} px in shadow, step {step_px} px"
    );
    assert!(missing(right..right + 30) < 1.0, "no shadow to the right");
}

#[test]
fn phase_cameras_mix_depths_at_edges_and_give_up_at_large_steps() {
    let between = |wall_m: f32, slab_m: f32| {
        let view = scene(SensorPreset::Azure, wall_m, Some(slab_m));
        let raw = exposure(SensorPreset::Azure).expose(&view, 3, FrameId(0));
        let edge = view.width * 2 / 5;
        let rows = view.height / 3..view.height * 2 / 3;
        let edge_pixels: Vec<f32> = rows
            .flat_map(|y| [y * view.width + edge - 1, y * view.width + edge])
            .map(|p| f32::from(raw[p]) * 0.0001)
            .collect();
        let mixed = |&&z: &&f32| z > slab_m + 0.02 && z < wall_m - 0.02;
        let share = |n: usize| n as f32 / edge_pixels.len() as f32;
        let holes = edge_pixels.iter().filter(|&&z| z == 0.0).count();
        (
            share(edge_pixels.iter().filter(mixed).count()),
            share(holes),
        )
    };
    let (mixed, holes) = between(2.0, 1.7);
    assert!(
        mixed > 0.15 && mixed < 0.6,
        "flying pixels between two near surfaces: {mixed}"
    );
    assert!(holes < 0.4, "{holes}");
    let (mixed, holes) = between(3.0, 1.7);
    assert!(
        mixed == 0.0 && holes == 1.0,
        "beyond 0.8 m the sensor gives up: {mixed}, {holes}"
    );
}

#[test]
fn dark_surfaces_give_no_answer() {
    for preset in [
        SensorPreset::Azure,
        SensorPreset::D435,
        SensorPreset::Kinect,
    ] {
        let mut view = scene(preset, 2.5, None);
        view.reflectance.fill(0.02);
        let raw = exposure(preset).expose(&view, 3, FrameId(0));
        let answered = raw.iter().filter(|&&r| r > 0).count() as f32 / raw.len() as f32;
        assert!(answered < 0.15, "{}: {answered} answered", preset.name());
    }
}
