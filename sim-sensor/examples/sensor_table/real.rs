//! The same measurements inside real people and simulated ones at the same distance.

use std::{error::Error, path::Path};

use effigy_capture::{Calibration, FrameId, Intrinsics, Rigid3, SensorModel};
use effigy_registration::{motion::Routine, smpl::builtin};
use effigy_sim_sensor::{
    MotionChoice, OutfitKind, Room, Scenario, SensorPreset, Truth,
    measure::{Interior, SLANTS_DEG, closed_mask, interior, noise_by_slant},
    noise::{Exposure, stereo::Stereo},
    preset::Defects,
    render::{Renderer, View},
};
use glam::{Quat, vec3};

/// The VCL frames' camera.
const D415: Intrinsics =
    Intrinsics { width: 640, height: 360, fx: 482.0, fy: 482.0, cx: 315.2, cy: 175.0 };
const D415_BASELINE_M: f32 = 0.055;

/// A depth image in metres.
struct Depth {
    metres: Vec<f32>,
    width: usize,
}

pub(crate) fn print(data: &Path) -> Result<(), Box<dyn Error>> {
    println!("\ninside people: real frames and simulated ones");
    println!(
        "| | depth | sigma, mm | correlation at 1, 2, 3, 4, 6 px | holes | holes / 10k px | size p50, p90 |\n|---|---|---|---|---|---|---|"
    );
    let folder = data.join("ddrnet-person");
    for number in [1, 6] {
        let depth = read(&folder.join(format!("depth_map/frame_{number:06}.png")))?;
        let mask = read(&folder.join(format!("mask/frame_{number:06}.png")))?;
        let mask: Vec<bool> = mask.metres.iter().map(|&m| m > 0.0).collect();
        row(
            &format!("ddrnet {number}, real"),
            interior(&depth.metres, depth.width, &mask),
        );
    }
    row("`kinect` preset", simulated_kinect());
    let depth = read(&data.join("vcl-realsense-d415/0_M11_depth_0.png"))?;
    row("vcl d415, real", person_before_a_room(&depth));
    row(
        "d415 simulated, s = 0.08",
        person_before_a_room(&simulated_d415(0.08)),
    );
    row(
        "d415 simulated, s = 0.03",
        person_before_a_room(&simulated_d415(0.03)),
    );
    println!("\nnoise of disparity by the surface's angle, px (pixels)");
    let classes = SLANTS_DEG
        .windows(2)
        .map(|ends| format!("{}-{} degrees", ends[0], ends[1]));
    println!(
        "| | {} |\n|---|---|---|---|---|",
        classes.collect::<Vec<_>>().join(" | ")
    );
    slants("vcl d415, real", &depth);
    slants("d415 simulated, s = 0.03", &simulated_d415(0.03));
    Ok(())
}

/// As measured by a camera like the VCL frame's.
fn slants(name: &str, depth: &Depth) {
    let mask = closed_mask(&depth.metres, depth.width, [0.9, 1.7], 4);
    let found = noise_by_slant(&depth.metres, &D415, &mask);
    let cells = found.map(|class| {
        let px = class.sigma_per_m * f64::from(D415.fx * D415_BASELINE_M);
        format!("{px:.4} ({})", class.pixels)
    });
    println!("| {name} | {} |", cells.join(" | "));
}

fn row(name: &str, found: Interior) {
    let correlation: Vec<String> = found
        .correlation
        .iter()
        .map(|c| format!("{c:.2}"))
        .collect();
    println!(
        "| {name} | {:.2} m | {:.2} | {} | {:.1} % | {:.1} | {:.0}, {:.0} |",
        found.depth_m,
        found.sigma_m * 1e3,
        correlation.join(", "),
        found.hole_share * 100.0,
        found.holes_per_10k,
        found.hole_px[0],
        found.hole_px[1]
    );
}

fn read(path: &Path) -> Result<Depth, Box<dyn Error>> {
    let picture = image::open(path).map_err(|error| format!("{}: {error}", path.display()))?;
    let picture = picture.into_luma16();
    let width = picture.width() as usize;
    let metres = picture
        .into_raw()
        .into_iter()
        .map(|raw| f32::from(raw) * 0.001)
        .collect();
    Ok(Depth { metres, width })
}

/// Everything up to arm's length behind the person, with the narrow gaps closed.
fn person_before_a_room(depth: &Depth) -> Interior {
    let mask = closed_mask(&depth.metres, depth.width, [0.9, 1.7], 4);
    interior(&depth.metres, depth.width, &mask)
}

/// As the `DDRNet` frames: waist up at 1.35 m, 640x480, f = 536.6 px.
fn simulated_kinect() -> Interior {
    let camera = Intrinsics { width: 640, height: 480, fx: 536.6, fy: 536.6, cx: 310.6, cy: 234.8 };
    let preset = SensorPreset::Kinect;
    let view = person(camera, 1.42, 1.35);
    let depth = exposed(&view, &preset.calibration(), preset.defects());
    let mask: Vec<bool> = view.labels.iter().map(|label| label.is_person()).collect();
    interior(&depth.metres, depth.width, &mask)
}

/// As the VCL frame: head to knees at 1.27 m.
fn simulated_d415(subpixel_rms_px: f32) -> Depth {
    let model =
        SensorModel::Stereo { baseline_m: D415_BASELINE_M, focal_px: D415.fx, subpixel_rms_px };
    let view = person(D415, 1.37, 1.25);
    exposed(
        &view,
        &SensorPreset::D435.calibration(),
        Defects::Stereo(Stereo::of(model)),
    )
}

fn exposed(view: &View, calibration: &Calibration, defects: Defects) -> Depth {
    let unit_m = calibration.metres_per_unit;
    let raw = Exposure::new(calibration, defects).expose(view, 5, FrameId(0));
    Depth {
        metres: raw.into_iter().map(|r| f32::from(r) * unit_m).collect(),
        width: view.width,
    }
}

/// Somebody standing relaxed, seen from a distance at a height.
fn person(camera: Intrinsics, distance_m: f32, height_m: f32) -> View {
    let scenario = Scenario {
        outfit: OutfitKind::Demo,
        motion: MotionChoice::Routine(Routine::Stand),
        ..Scenario::default()
    };
    let truth = Truth::new(&scenario, builtin::body()).expect("a default scenario is valid");
    let ground = truth.at(FrameId(10));
    let world_from_camera = Rigid3 {
        rotation: Quat::from_rotation_x(std::f32::consts::PI),
        translation: vec3(0.0, height_m, distance_m),
    };
    let mut renderer = Renderer::new(camera, world_from_camera, Room::FloorAndWall);
    let person = truth.person();
    renderer
        .render(
            &ground.clothed_in_world,
            &person.paint,
            &person.body.skinning,
        )
        .clone()
}
