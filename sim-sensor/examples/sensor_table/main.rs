//! Measures every sensor preset beside its source's figures, and simulated people beside real frames:
//! `cargo run --release -p effigy-sim-sensor --example sensor_table -- [DATA_FOLDER [STILLS_FOLDER]]`.

#![expect(clippy::print_stdout, reason = "the table is for people")]

use std::{env, error::Error, path::PathBuf};

use effigy_capture::FrameId;
use effigy_registration::{motion::Routine, smpl::builtin};
use effigy_sim_sensor::{
    MotionChoice, OutfitKind, Scenario, SensorPreset, SimulatedSensor,
    measure::{self, Edges, Sigma},
};

mod real;

const DEPTHS_M: [f32; 5] = [1.013, 1.517, 2.021, 2.517, 3.019];
const FRAMES: u64 = 4;

fn main() -> Result<(), Box<dyn Error>> {
    let mut args = env::args().skip(1).map(PathBuf::from);
    print_sigma(0.0, "frontal");
    print_sigma(std::f32::consts::FRAC_PI_3, "turned by 60 degrees");
    print_correlation();
    print_edges();
    if let Some(data) = args.next() {
        real::print(&data)?;
    }
    if let Some(folder) = args.next() {
        for preset in SensorPreset::ALL {
            still(preset)?.save(folder.join(format!("{}.png", preset.name())))?;
        }
    }
    Ok(())
}

/// Millimetres: measured / source.
fn print_sigma(turned_rad: f32, title: &str) {
    println!("\nsigma on a wall, {title}, mm: measured / source (fill rate)");
    let names = SensorPreset::ALL.map(SensorPreset::name).join(" | ");
    println!(
        "| depth | {names} |\n|---|{}",
        "---|".repeat(SensorPreset::ALL.len())
    );
    for depth_m in DEPTHS_M {
        print!("| {depth_m:.1} m |");
        for preset in SensorPreset::ALL {
            let Sigma { measured_m, source_m, fill } =
                measure::sigma(preset, depth_m, turned_rad, FRAMES);
            print!(
                " {:.2} / {:.2} ({:.1} %) |",
                measured_m * 1e3,
                source_m * 1e3,
                fill * 100.0
            );
        }
        println!();
    }
}

fn print_correlation() {
    const LAGS: [usize; 7] = [1, 2, 3, 4, 6, 8, 12];
    println!("\ncorrelation of errors along a row at 2 m");
    println!("| pixels apart | 1 | 2 | 3 | 4 | 6 | 8 | 12 |\n|---|---|---|---|---|---|---|---|");
    let print_row = |name: &str, values: &[f64]| {
        let values: Vec<String> = values.iter().map(|value| format!("{value:.2}")).collect();
        println!("| {name} | {} |", values.join(" | "));
    };
    for preset in SensorPreset::ALL {
        print_row(
            preset.name(),
            &measure::correlation(preset, 2.021, &LAGS, 3),
        );
    }
    let windows = LAGS.map(measure::window_correlation);
    print_row("windows of 7 px that overlap", &windows);
}

fn print_edges() {
    let (near_m, far_m) = (1.5, 2.2);
    println!("\nedges of a slab at {near_m} m before a wall at {far_m} m, px");
    println!(
        "| | grown | wobble | flying | shadow left / right (f B step) |\n|---|---|---|---|---|"
    );
    for preset in SensorPreset::ALL {
        let Edges { grown_px, wobble_px, flying_px, shadow_px: [left, right] } =
            measure::edges(preset, near_m, far_m, 3);
        let step = measure::shadow_px(preset, near_m, far_m);
        println!(
            "| {} | {grown_px:.2} | {wobble_px:.2} | {flying_px:.2} | {left:.1} / {right:.1} ({step:.1}) |",
            preset.name()
        );
    }
    let corner = measure::corner_excess_m(SensorPreset::Azure, 2.5, std::f32::consts::FRAC_PI_2);
    println!(
        "azure: a corner of 90 degrees at 2.5 m reads up to {:.1} mm too far",
        corner * 1e3
    );
}

/// The person in the middle of one frame: near is bright, black is no answer, bands are 40 mm wide.
fn still(preset: SensorPreset) -> Result<image::GrayImage, Box<dyn Error>> {
    let scenario = Scenario {
        sensor: preset,
        outfit: OutfitKind::Loose,
        motion: MotionChoice::Routine(Routine::Wave),
        ..Scenario::default()
    };
    let mut sensor = SimulatedSensor::new(&scenario, builtin::body())?;
    let frame = sensor.expose(FrameId(50))?;
    let (width, height) = (frame.depth.width(), frame.depth.height());
    let shown = height * 9 / 20;
    let left = (width - shown) / 2;
    Ok(image::GrayImage::from_fn(shown, height, |x, y| {
        let raw = frame.depth.pixels()[(y * width + left + x) as usize];
        image::Luma([brightness(raw)])
    }))
}

fn brightness(raw: u16) -> u8 {
    if raw == 0 {
        return 0;
    }
    let share = ((4400.0 - f32::from(raw)) / 2600.0).clamp(0.1, 1.0);
    let band = (f32::from(raw) / 40.0).fract() * 40.0;
    // Few grey levels keep the picture small.
    (share * 200.0 + band) as u8 & 0xf8
}
