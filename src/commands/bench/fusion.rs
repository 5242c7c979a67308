//! What happens to every frame of a sensor before a body is looked for, and the body itself.

use std::{hint::black_box, path::Path};

use anyhow::Context as _;
use effigy_capture::{FrameSource as _, Rigid3};
use effigy_fusion::{
    CleanConfig, CleanFrame, Cleaner, NormalMap, TsdfConfig, TsdfVolume,
    mesh::marching_cubes::marching_cubes, tsdf::DepthView,
};
use effigy_registration::smpl::{BodyParams, JOINT_COUNT, Poser, builtin};
use effigy_sim_sensor::{Scenario, SimulatedSensor};
use glam::Vec3;
use image::{ImageBuffer, Luma};
use serde::Serialize;

use super::{Row, in_turn::in_turn};
use crate::files;

/// A side of the grid that is meshed.
const GRID: usize = 128;

pub(super) fn rows(quick: bool, keep: Option<&Path>) -> anyhow::Result<Vec<Row>> {
    let rounds = if quick { 2 } else { 40 };
    let scenario = Scenario { seconds: 1.0, ..Scenario::default() };
    let mut sensor = SimulatedSensor::new(&scenario, builtin::body())?;
    let calibration = sensor.calibration().clone();
    let frame = sensor.next_frame()?.context("a second of frames has one")?;
    let mut cleaner = Cleaner::new(calibration.clone(), CleanConfig::default());
    let clean = cleaner.process(&frame)?;
    let (grid, volume) = (grid(), TsdfConfig::default());
    if let Some(folder) = keep {
        keep_inputs(
            folder,
            &clean,
            &calibration.depth.intrinsics,
            &grid,
            &volume,
        )?;
    }
    let depth_view = DepthView {
        points: &clean.vertices,
        normals: Some(&clean.normals),
        camera: &calibration.depth,
        volume_from_camera: Rigid3::IDENTITY,
    };
    let weight = |pixel: usize| if clean.person[pixel] { 1.0 } else { 0.0 };
    let mut tsdf = TsdfVolume::new(volume);
    let mut poser = Poser::new(builtin::body());
    let params = BodyParams {
        betas: [0.3; 10],
        theta: std::array::from_fn(|joint| Vec3::new(0.3, 0.1 * joint as f32, -0.2)),
        trans: Vec3::ZERO,
    };
    let secs = in_turn(
        rounds,
        [
            &mut || {
                // A frame of the right size is what it was made for.
                if let Ok(clean) = cleaner.process(&frame) {
                    cleaner.recycle(clean);
                }
            },
            &mut || {
                black_box(NormalMap::from_vertices(&clean.vertices));
            },
            &mut || tsdf.integrate(&depth_view, weight),
            &mut || {
                black_box(marching_cubes(&grid, [GRID; 3], Vec3::ZERO, 1.0));
            },
            &mut || {
                black_box(poser.pose(&params).joints[0]);
            },
        ],
    );
    let names = [
        "clean a frame, 640x576",
        "normals of a map, 640x576",
        "integrate a person into a volume",
        "marching cubes, 128^3",
        "pose the body",
    ];
    let rows = names.into_iter().zip(secs);
    Ok(rows
        .map(|(name, secs)| Row::new(name, secs * 1e3, "ms"))
        .collect())
}

/// A ball with a wavy surface.
fn grid() -> Vec<f32> {
    let middle = GRID as f32 / 2.0;
    let value = |index: usize| {
        let (x, rest) = (index % GRID, index / GRID);
        let place = Vec3::new(x as f32, (rest % GRID) as f32, (rest / GRID) as f32) - middle;
        let waves = (place * 0.3)
            .to_array()
            .map(f32::sin)
            .iter()
            .product::<f32>();
        place.length() - 0.62 * middle + 2.0 * waves
    };
    (0..GRID.pow(3)).map(value).collect()
}

/// What other programs need to know to do the same.
#[derive(Serialize)]
struct Inputs<'a> {
    depth_png: &'static str,
    metres_per_unit: f32,
    intrinsics: &'a effigy_capture::Intrinsics,
    voxel_m: f32,
    truncation_m: f32,
    grid_f32: &'static str,
    grid_side: usize,
    body_vertices: usize,
    joints: usize,
}

/// The person's cleaned depth as a 16-bit picture, the grid as raw floats (x fastest), and their description.
fn keep_inputs(
    folder: &Path,
    clean: &CleanFrame,
    intrinsics: &effigy_capture::Intrinsics,
    grid: &[f32],
    volume: &TsdfConfig,
) -> anyhow::Result<()> {
    const METRES_PER_UNIT: f32 = 0.0005;
    let depth = &clean.depth;
    let pixels = depth
        .metres
        .iter()
        .zip(&clean.person)
        .map(|(&metres, &person)| {
            if person && metres.is_finite() {
                (metres / METRES_PER_UNIT).round() as u16
            } else {
                0
            }
        });
    let (width, height) = (depth.width as u32, depth.height as u32);
    let picture = ImageBuffer::<Luma<u16>, _>::from_raw(width, height, pixels.collect::<Vec<_>>())
        .context("one value a pixel")?;
    let path = folder.join("depth.png");
    picture
        .save(&path)
        .with_context(|| path.display().to_string())?;
    let bytes: Vec<u8> = grid.iter().flat_map(|value| value.to_le_bytes()).collect();
    files::write(&folder.join("grid.f32"), bytes)?;
    let inputs = Inputs {
        depth_png: "depth.png",
        metres_per_unit: METRES_PER_UNIT,
        intrinsics,
        voxel_m: volume.voxel_size_m,
        truncation_m: volume.truncation_voxels * volume.voxel_size_m,
        grid_f32: "grid.f32",
        grid_side: GRID,
        body_vertices: builtin::body().vertex_count(),
        joints: JOINT_COUNT,
    };
    files::write_json(&folder.join("inputs.json"), &inputs)
}
