//! The table in `docs/sensors.md`, held to its tolerances.

use super::*;

const SIXTY: f32 = std::f32::consts::FRAC_PI_3;

#[test]
fn sigma_is_the_sources_within_15_percent_frontal_and_at_60_degrees() {
    for preset in SensorPreset::ALL {
        for depth_m in [1.013, 1.517, 2.021, 2.517, 3.019] {
            for turned_rad in [0.0, SIXTY] {
                let Sigma { measured_m, source_m, .. } = sigma(preset, depth_m, turned_rad, 3);
                let ratio = measured_m / source_m;
                assert!(
                    (0.85..1.15).contains(&ratio),
                    "{} at {depth_m} m, {turned_rad} rad: {measured_m} m, source {source_m} m",
                    preset.name()
                );
            }
        }
    }
}

#[test]
fn a_frontal_wall_is_filled_but_for_windows_without_texture() {
    for preset in SensorPreset::ALL {
        let least = if preset == SensorPreset::Oak {
            0.96
        } else {
            0.99
        };
        let fill = sigma(preset, 2.021, 0.0, 2).fill;
        assert!(fill > least && fill <= 1.0, "{}: {fill}", preset.name());
    }
}

#[test]
fn edges_grow_wobble_mix_and_cast_shadows_as_their_sensor_does() {
    let (near_m, far_m) = (1.5, 2.2);
    for preset in SensorPreset::ALL {
        let edges = edges(preset, near_m, far_m, 2);
        let name = preset.name();
        let [left_px, right_px] = edges.shadow_px;
        let expected_px = shadow_px(preset, near_m, far_m);
        match preset {
            SensorPreset::Azure => {
                assert!((0.3..1.0).contains(&edges.flying_px), "{name}: {edges:?}");
                assert!(edges.grown_px.abs() < 0.3, "{name}: {edges:?}");
            }
            SensorPreset::D435 | SensorPreset::D455 | SensorPreset::Oak => {
                // Half of a 7 px window, within 15 %.
                assert!(
                    (edges.grown_px / 3.5 - 1.0).abs() < 0.15,
                    "{name}: {edges:?}"
                );
                assert!(
                    (left_px / expected_px - 1.0).abs() < 0.15,
                    "{name}: {edges:?}"
                );
                assert!(right_px < 0.35 * left_px, "{name}: {edges:?}");
            }
            SensorPreset::Kinect => {
                // Nguyen's 0.8 px; whole pixels add a twelfth of their square.
                let expected = 0.8f64.hypot(1.0 / 12f64.sqrt());
                assert!(
                    (edges.wobble_px / expected - 1.0).abs() < 0.15,
                    "{name}: {edges:?}"
                );
                assert!(
                    (left_px / expected_px - 1.0).abs() < 0.15,
                    "{name}: {edges:?}"
                );
            }
        }
    }
}

#[test]
fn corners_read_too_far_only_where_phases_are_measured() {
    let right_angle = std::f32::consts::FRAC_PI_2;
    let azure = corner_excess_m(SensorPreset::Azure, 2.5, right_angle);
    assert!(
        (0.004..0.04).contains(&azure),
        "centimetres, as documented: {azure} m"
    );
    let flat = corner_excess_m(SensorPreset::Azure, 2.5, std::f32::consts::PI);
    assert!(flat < 0.002, "a flat wall lights nobody: {flat} m");
}

#[test]
fn the_interior_of_a_person_is_measured_as_it_was_made() {
    let width = 200;
    let random = crate::random::Randomness::new(3, 0, 1);
    let mut depth_m: Vec<f32> = (0..width * 200)
        .map(|p| 1.5 + 0.002 * (p % width) as f32 + 0.003 * random.gaussian(p as u64))
        .collect();
    for p in [20_050, 20_051, 25_120] {
        depth_m[p] = 0.0;
    }
    let mask = vec![true; depth_m.len()];
    let found = interior(&depth_m, width, &mask);
    // The mean of 49 pixels keeps a forty-ninth of the variance away.
    let expected = 0.003 * (48.0f64 / 49.0).sqrt();
    assert!((found.sigma_m / expected - 1.0).abs() < 0.05, "{found:?}");
    assert!(found.correlation[0].abs() < 0.05, "{found:?}");
    assert!(
        (found.hole_share - 3.0 / 40_000.0).abs() < 1e-9,
        "{found:?}"
    );
    assert_eq!(
        found.hole_px,
        [2.0, 2.0],
        "two holes, of 1 and 2 pixels: {found:?}"
    );
}

#[test]
fn depth_comes_in_the_matchers_steps_of_disparity() {
    for preset in SensorPreset::ALL {
        let (focal_baseline, steps_per_px) = match preset.defects() {
            Defects::TimeOfFlight(_) => continue,
            Defects::Stereo(stereo) => (stereo.focal_px * stereo.baseline_m, stereo.steps_per_px),
            Defects::StructuredLight(light) => {
                (light.focal_px * light.baseline_m, light.steps_per_px)
            }
        };
        let view = wall(preset.intrinsics(), 1.0, 0.3);
        let raw = exposure(preset).expose(&view, 11, FrameId(0));
        let answered = raw.iter().filter(|&&raw| raw > 0);
        let off_step = |raw: &u16| {
            let depth_m = f32::from(*raw) * UNIT_M;
            let steps = focal_baseline / depth_m * steps_per_px;
            // Raw units of 0.1 mm are up to a fifth of the finest step at this depth.
            let unit = focal_baseline / (depth_m * depth_m) * steps_per_px * UNIT_M;
            (steps - steps.round()).abs() > 0.6 * unit
        };
        let wrong = answered.clone().filter(|raw| off_step(raw)).count();
        assert!(answered.count() > 1000);
        assert_eq!(wrong, 0, "{}: between two steps", preset.name());
    }
}

#[test]
fn noise_that_does_not_grow_with_the_slant_is_told_from_noise_that_does() {
    let camera = Intrinsics { width: 200, height: 200, fx: 480.0, fy: 480.0, cx: 99.5, cy: 99.5 };
    let random = crate::random::Randomness::new(3, 0, 1);
    for (turned_rad, class, growth) in [(0.1f32, 0, 1.0), (1.08, 3, 1.0), (1.08, 3, 1.5)] {
        let mut depth_m = wall(camera, 1.2, turned_rad).depth_m;
        let sigma_per_m = 0.0003 * growth;
        for (pixel, z) in depth_m.iter_mut().enumerate() {
            *z = 1.0 / (1.0 / *z + sigma_per_m * random.gaussian(pixel as u64));
        }
        let found = noise_by_slant(&depth_m, &camera, &vec![true; depth_m.len()]);
        let expected = f64::from(sigma_per_m) * (48.0f64 / 49.0).sqrt();
        let Slanted { sigma_per_m, pixels } = found[class];
        assert!(pixels > 5000, "{turned_rad} rad: {found:?}");
        // Some of the slant measured at a pixel is its noise.
        assert!(
            (sigma_per_m / expected - 1.0).abs() < 0.05,
            "{turned_rad} rad: {found:?}"
        );
    }
}
