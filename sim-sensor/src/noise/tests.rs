//! What the noise claims: its sigma follows the sensor's model, and its defects are where they belong.

use super::*;
use crate::{measure, preset::SensorPreset};

/// A frontal wall, and perhaps a nearer slab over the image's middle columns.
fn scene(preset: SensorPreset, wall_m: f32, slab_m: Option<f32>) -> View {
    match slab_m {
        Some(slab_m) => measure::slab(preset.intrinsics(), slab_m, wall_m),
        None => measure::wall(preset.intrinsics(), wall_m, 0.0),
    }
}

fn exposure(preset: SensorPreset) -> Exposure {
    let mut calibration = preset.calibration();
    calibration.metres_per_unit = 0.0001;
    Exposure::new(&calibration, preset.defects())
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

#[test]
fn stereo_noise_is_shared_as_windows_overlap_and_phase_noise_is_not() {
    const LAGS: [usize; 5] = [1, 2, 3, 4, 12];
    for preset in [SensorPreset::D435, SensorPreset::D455, SensorPreset::Oak] {
        let found = measure::correlation(preset, 2.0, &LAGS, 3);
        for (lag, found) in LAGS.into_iter().zip(found) {
            let expected = measure::window_correlation(lag);
            assert!(
                (found - expected).abs() < (0.15 * expected).max(0.05),
                "{}, {lag} pixels apart: {found}, windows share {expected}",
                preset.name()
            );
        }
    }
    let phase = measure::correlation(SensorPreset::Azure, 2.0, &[1], 1)[0];
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
        (shadow_px / step_px - 1.0).abs() < 0.15,
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
    for preset in SensorPreset::ALL {
        let mut view = scene(preset, 2.5, None);
        view.reflectance.fill(0.02);
        let raw = exposure(preset).expose(&view, 3, FrameId(0));
        let answered = raw.iter().filter(|&&r| r > 0).count() as f32 / raw.len() as f32;
        assert!(answered < 0.15, "{}: {answered} answered", preset.name());
    }
}
