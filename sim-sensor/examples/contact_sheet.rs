//! Draws contact sheets of simulated people: `contact_sheet OUT_DIR [ROUTINE|MOTION_FILE [OUTFIT|FILE.glb[#CLIP]
//! [SENSOR [SEED]]]]`. A glTF character takes the place of an outfit.
//!
//! Top row: shaded colour; bottom row: depth as the sensor delivers it (near is bright, black is no answer).

use std::{env, error::Error, path::Path};

use effigy_capture::{FrameId, FrameSource as _};
use effigy_registration::{motion::Routine, smpl::builtin};
use effigy_sim_sensor::{
    MotionChoice, OutfitKind, Scenario, SensorPreset, SimulatedSensor, StrangerChoice,
};

const COLUMNS: u32 = 8;

fn main() -> Result<(), Box<dyn Error>> {
    let mut args = env::args().skip(1);
    let out = args.next().unwrap_or_else(|| ".".to_owned());
    let motion = args.next().unwrap_or_else(|| "mixture".to_owned());
    let outfit = args.next().unwrap_or_else(|| "demo".to_owned());
    let sensor = args.next().unwrap_or_else(|| "azure".to_owned());
    let seed = args.next().map_or(Ok(1), |seed| seed.parse())?;
    let choice = if Path::new(&motion).extension().is_some() {
        MotionChoice::File(motion.clone().into())
    } else {
        MotionChoice::Routine(named::<Routine>(&motion)?)
    };
    let stranger = outfit.contains(".gl").then(|| {
        let (path, clip) = outfit
            .split_once('#')
            .map_or((&*outfit, None), |(p, c)| (p, Some(c)));
        StrangerChoice { path: path.into(), clip: clip.map(str::to_owned), height_m: None }
    });
    let scenario = Scenario {
        seed,
        motion: choice,
        outfit: if stranger.is_some() {
            OutfitKind::Demo
        } else {
            named::<OutfitKind>(&outfit)?
        },
        stranger,
        sensor: named::<SensorPreset>(&sensor)?,
        ..Scenario::default()
    };
    let sheet = draw(&scenario)?;
    let stem = Path::new(&motion)
        .file_stem()
        .unwrap_or_default()
        .to_string_lossy()
        .into_owned();
    let wearer = outfit.rsplit('/').next().unwrap_or_default();
    sheet.save(Path::new(&out).join(format!("{stem}_{wearer}_{sensor}_{seed}.png")))?;
    Ok(())
}

/// A name as scenarios spell it.
fn named<T: serde::de::DeserializeOwned>(name: &str) -> Result<T, Box<dyn Error>> {
    Ok(serde_json::from_value(serde_json::Value::String(
        name.to_owned(),
    ))?)
}

fn draw(scenario: &Scenario) -> Result<image::RgbImage, Box<dyn Error>> {
    let mut sensor = SimulatedSensor::new(scenario, builtin::body())?;
    let secs = sensor.motion_secs();
    let size = sensor.calibration().depth.intrinsics;
    // The middle of the image: the person fills a fraction of its width.
    let crop = size.width * 9 / 20;
    let left = (size.width - crop) / 2;
    let mut sheet = image::RgbImage::new(crop * COLUMNS, size.height * 2);
    for column in 0..COLUMNS {
        let at_secs = secs * (column as f32 + 0.5) / COLUMNS as f32;
        let id = FrameId((at_secs * scenario.rate_hz()) as u64);
        let frame = sensor.expose(id)?;
        let color = sensor.view(id).shaded();
        for y in 0..size.height {
            for x in 0..crop {
                let pixel = (y * size.width + left + x) as usize;
                let to = column * crop + x;
                sheet.put_pixel(to, y, image::Rgb(color[pixel]));
                let grey = brightness(frame.depth.pixels()[pixel]);
                sheet.put_pixel(to, size.height + y, image::Rgb(grey));
            }
        }
    }
    Ok(sheet)
}

/// Bright at 1.8 m, dark at 4.2 m, with bands that show small steps.
fn brightness(raw: u16) -> [u8; 3] {
    if raw == 0 {
        return [0, 0, 0];
    }
    let share = ((4200.0 - f32::from(raw)) / 2400.0).clamp(0.05, 1.0);
    let band = (f32::from(raw) / 40.0).fract() * 50.0;
    [
        (share * 200.0 + band * 0.3) as u8,
        (share * 200.0 + band) as u8,
        (share * 220.0) as u8,
    ]
}
