//! The table in `docs/sensors.md`, held to its tolerances.

use super::*;

const SIXTY: f32 = std::f32::consts::FRAC_PI_3;

#[test]
fn sigma_is_the_sources_within_15_percent_frontal_and_at_60_degrees() {
    for preset in SensorPreset::ALL {
        for depth_m in [1.013, 1.517, 2.021, 2.517, 3.019] {
            for turned_rad in [0.0, SIXTY] {
                let Sigma { measured_m, source_m, .. } = sigma(preset, depth_m, turned_rad, 3);
                // Stereo's own angle term adds 20 % at 60 degrees, where its sources have none.
                let slant = match preset {
                    SensorPreset::D435 | SensorPreset::Oak if turned_rad > 0.0 => 1.20,
                    _ => 1.0,
                };
                let ratio = measured_m / source_m / slant;
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
            SensorPreset::D435 | SensorPreset::Oak => {
                // Half of a 7 px window, within 15 %.
                assert!(
                    (edges.grown_px / 3.5 - 1.0).abs() < 0.15,
                    "{name}: {edges:?}"
                );
                assert!((left_px - expected_px).abs() < 1.5, "{name}: {edges:?}");
                assert!(right_px < 0.35 * left_px, "{name}: {edges:?}");
            }
            SensorPreset::Kinect => {
                // Nguyen's 0.8 px; whole pixels add a twelfth of their square.
                let expected = 0.8f64.hypot(1.0 / 12f64.sqrt());
                assert!(
                    (edges.wobble_px / expected - 1.0).abs() < 0.15,
                    "{name}: {edges:?}"
                );
                assert!((left_px - expected_px).abs() < 1.5, "{name}: {edges:?}");
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
