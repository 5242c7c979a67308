//! Tracks simulated people through sensor noise and cleaning, and prints how far the fitted bodies are from the true
//! ones: `cargo run --release -p effigy-tests --example tracking_table -- [motion,..] [outfit,..] [seconds] [seed] [png folder]`.

#![expect(clippy::print_stdout, reason = "the table is for people")]

use std::sync::Arc;

use effigy_capture::FrameSource as _;
use effigy_fusion::clean::{CleanConfig, Cleaner};
use effigy_registration::{
    BodyModel, RegisteredFrame, TrackConfig, Tracker, Tracking,
    motion::Routine,
    smpl::{JOINT_NAMES, builtin},
};
use effigy_sim_sensor::{GroundTruth, MotionChoice, OutfitKind, Scenario, SimulatedSensor, Truth};
use glam::Vec3;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let argument = |i: usize, default: &str| {
        arguments
            .get(i)
            .cloned()
            .unwrap_or_else(|| default.to_owned())
    };
    let seconds: f32 = argument(2, "6").parse().expect("seconds is a number");
    let seed: u64 = argument(3, "1").parse().expect("seed is a number");
    let pictures = arguments.get(4).cloned();
    println!(
        "{:<14} {:<8} {:>5} {:>6} {:>6} {:>6} {:>6} {:>6} {:>6} {:>6} {:>6} {:>6} {:>7} {:>7} {:>7} {:>7}",
        "motion",
        "outfit",
        "track",
        "mpjpe",
        "v2v",
        "p95",
        "max",
        "last",
        "head",
        "hands",
        "feet",
        "resid",
        "cpu avg",
        "ms p50",
        "ms p95",
        "ms max"
    );
    for motion in argument(0, "turn_around,walk_in_place,squat,raise_arms,wave,mixture").split(',')
    {
        for outfit in argument(1, "demo").split(',') {
            let scenario = Scenario {
                seed,
                seconds,
                sensor: parse(&std::env::var("SENSOR").unwrap_or_else(|_| "azure".to_owned())),
                motion: MotionChoice::Routine(parse::<Routine>(motion)),
                outfit: parse::<OutfitKind>(outfit),
                ..Scenario::default()
            };
            run(&scenario, motion, outfit, pictures.as_deref());
        }
    }
}

fn parse<T: serde::de::DeserializeOwned>(name: &str) -> T {
    serde_json::from_value(serde_json::Value::String(name.to_owned())).expect("a known name")
}

#[derive(Default)]
struct Row {
    frames: usize,
    mpjpe: Vec<f32>,
    v2v: Vec<f32>,
    head: Vec<f32>,
    hands: Vec<f32>,
    feet: Vec<f32>,
    residual: Vec<f32>,
    milliseconds: Vec<f32>,
    /// Summed differences found minus true, world axes, mm.
    joint_errors: [Vec3; 24],
    cpu_ms: f32,
}

#[expect(clippy::disallowed_methods, reason = "this example measures time")]
fn run(scenario: &Scenario, motion: &str, outfit: &str, pictures: Option<&str>) {
    let body = builtin::body();
    let mut sensor = SimulatedSensor::new(scenario, Arc::clone(&body)).expect("a valid scenario");
    let truth = Truth::new(scenario, Arc::clone(&body)).expect("a valid scenario");
    let calibration = sensor.calibration().clone();
    let cleaning: CleanConfig = std::env::var("CLEAN")
        .map(|json| serde_json::from_str(&json).expect("settings"))
        .unwrap_or_default();
    let mut cleaner = Cleaner::new(calibration.clone(), cleaning);
    // Settings to try, as JSON: CONFIG='{"rounds": 5}'.
    let config: TrackConfig = std::env::var("CONFIG")
        .map(|json| serde_json::from_str(&json).expect("settings"))
        .unwrap_or_default();
    let mut tracker = Tracker::new(Arc::clone(&body), calibration.depth, config, None);
    let verbose = std::env::var("VERBOSE").is_ok();
    let every: u64 = std::env::var("EVERY")
        .ok()
        .and_then(|n| n.parse().ok())
        .unwrap_or(15);
    let start: u64 = std::env::var("START")
        .ok()
        .and_then(|n| n.parse().ok())
        .unwrap_or(0);
    let mut row = Row::default();
    while let Some(frame) = sensor.next_frame().expect("the simulator delivers") {
        if frame.id.0 < start {
            continue;
        }
        let clean = Arc::new(cleaner.process(&frame).expect("sizes agree"));
        let start = std::time::Instant::now();
        let cpu_start = cpu_ms();
        let registered = tracker.process(Arc::clone(&clean));
        row.cpu_ms += cpu_ms() - cpu_start;
        let ms = start.elapsed().as_secs_f32() * 1e3;
        let at = truth.at(frame.id);
        row.frames += 1;
        row.milliseconds.push(ms);
        row.add(&body, &registered, &at);
        if verbose {
            describe(&registered, &row, frame.id.0, &tracker);
        }
        if let Some(folder) = pictures
            && frame.id.0.is_multiple_of(every)
        {
            let name = format!("{folder}/{motion}_{outfit}_{:04}.png", frame.id.0);
            draw(&body, &registered, &calibration.depth.intrinsics, &name);
        }
    }
    if std::env::var("JOINTS").is_ok() {
        for (joint, sum) in row.joint_errors.iter().enumerate() {
            let mean = *sum / row.v2v.len().max(1) as f32;
            println!(
                "    {:<16} {:6.1} {:6.1} {:6.1} mm",
                JOINT_NAMES[joint], mean.x, mean.y, mean.z
            );
        }
    }
    row.print(motion, outfit);
    if verbose {
        println!("betas true  {:?}", truth.person().betas);
        println!("betas found {:?}", tracker.betas());
        let mut shape = effigy_registration::BodyParams::ZERO;
        shape.betas = tracker.betas();
        let found = body.pose(&shape);
        shape.betas = truth.person().betas;
        let real = body.pose(&shape);
        let height = |v: &[Vec3]| {
            v.iter().map(|v| v.y).fold(f32::MIN, f32::max)
                - v.iter().map(|v| v.y).fold(f32::MAX, f32::min)
        };
        println!(
            "height found {} true {}",
            height(&found.vertices),
            height(&real.vertices)
        );
    }
}

fn describe(registered: &RegisteredFrame, row: &Row, id: u64, tracker: &Tracker) {
    let ms = row.milliseconds.last().unwrap_or(&0.0);
    match &registered.tracking {
        Tracking::Tracked { residual_rms_m, .. } => println!(
            "  {id:4} v2v {:6.1} mpjpe {:6.1} rms {:5.1} hands {:5.1} {ms:6.1} ms  beta0 {:.2}",
            row.v2v.last().unwrap_or(&0.0),
            row.mpjpe.last().unwrap_or(&0.0),
            residual_rms_m * 1e3,
            row.hands.last().unwrap_or(&0.0),
            tracker.betas()[0],
        ),
        other => println!("  {id:4} {other:?} {ms:6.1} ms"),
    }
}

impl Row {
    fn add(&mut self, body: &BodyModel, registered: &RegisteredFrame, truth: &GroundTruth) {
        let Tracking::Tracked { params, residual_rms_m, .. } = &registered.tracking else {
            return;
        };
        let fitted = body.pose(params);
        let to_truth = truth.world_from_camera * registered.world_from_camera.inverse();
        let distance = |a: &[Vec3], b: &[Vec3], i: usize| (to_truth * a[i]).distance(b[i]) * 1e3;
        let mean = |a: &[Vec3], b: &[Vec3], which: &[usize]| {
            which.iter().map(|&i| distance(a, b, i)).sum::<f32>() / which.len() as f32
        };
        let all: Vec<usize> = (0..fitted.vertices.len()).collect();
        self.v2v
            .push(mean(&fitted.vertices, &truth.minimal.vertices, &all));
        let joints = |which: &[usize]| mean(&fitted.joints, &truth.minimal.joints, which);
        self.mpjpe.push(joints(&(0..24).collect::<Vec<_>>()));
        for joint in 0..24 {
            self.joint_errors[joint] +=
                (to_truth * fitted.joints[joint] - truth.minimal.joints[joint]) * 1e3;
        }
        self.head.push(joints(&[15]));
        self.hands.push(joints(&[20, 21]));
        self.feet.push(joints(&[7, 8]));
        self.residual.push(residual_rms_m * 1e3);
    }

    fn print(mut self, motion: &str, outfit: &str) {
        let tracked = 100.0 * self.v2v.len() as f32 / self.frames as f32;
        let mean = |v: &[f32]| v.iter().sum::<f32>() / v.len().max(1) as f32;
        let last = mean(&self.v2v[self.v2v.len() / 2..]);
        let mut v2v = self.v2v.clone();
        println!(
            "{motion:<14} {outfit:<8} {tracked:5.0} {:6.1} {:6.1} {:6.1} {:6.1} {last:6.1} {:6.1} {:6.1} {:6.1} {:6.1} {:7.1} {:7.1} {:7.1} {:7.1}",
            mean(&self.mpjpe),
            mean(&self.v2v),
            percentile(&mut v2v, 0.95),
            percentile(&mut v2v, 1.0),
            mean(&self.head),
            mean(&self.hands),
            mean(&self.feet),
            mean(&self.residual),
            self.cpu_ms / self.frames as f32,
            percentile(&mut self.milliseconds, 0.5),
            percentile(&mut self.milliseconds, 0.95),
            percentile(&mut self.milliseconds, 1.0),
        );
    }
}

/// Time this thread has had the processor, as Linux counts it.
fn cpu_ms() -> f32 {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    let nanoseconds: f64 = text
        .split(' ')
        .next()
        .and_then(|n| n.parse().ok())
        .unwrap_or(0.0);
    (nanoseconds * 1e-6) as f32
}

fn percentile(values: &mut [f32], share: f32) -> f32 {
    values.sort_by(f32::total_cmp);
    values
        .get(((values.len().max(1) - 1) as f32 * share) as usize)
        .copied()
        .unwrap_or(f32::NAN)
}

fn draw(
    body: &BodyModel,
    registered: &RegisteredFrame,
    camera: &effigy_capture::Intrinsics,
    name: &str,
) {
    use effigy_fusion::mesh::z_buffer::Rasterizer;
    let clean = &registered.clean;
    let (width, height) = (clean.depth.width, clean.depth.height);
    let mut picture = image::RgbImage::new(2 * width as u32, height as u32);
    for y in 0..height {
        for x in 0..width {
            let i = y * width + x;
            let n = clean.normals.normals[i];
            let shade = if n.is_finite() {
                (-n.z).clamp(0.0, 1.0) * 200.0 + 30.0
            } else {
                0.0
            };
            let pixel = if clean.person[i] {
                [shade as u8, (shade * 0.8) as u8, (shade * 0.5) as u8]
            } else {
                [(shade * 0.3) as u8; 3]
            };
            picture.put_pixel(x as u32, y as u32, image::Rgb(pixel));
            picture.put_pixel((x + width) as u32, y as u32, image::Rgb(pixel));
        }
    }
    if let Some(params) = registered.params() {
        let camera_from_world = registered.world_from_camera.inverse();
        let vertices: Vec<Vec3> = body
            .pose(params)
            .vertices
            .iter()
            .map(|v| camera_from_world * *v)
            .collect();
        let mut rasterizer = Rasterizer::new(*camera);
        let raster = rasterizer.draw(&vertices, &body.triangles);
        for i in 0..width * height {
            if let Some((triangle, _)) = raster.hit(i) {
                let [a, b, c] = body.triangles[triangle as usize].map(|v| vertices[v as usize]);
                let n = (b - a).cross(c - a).normalize_or_zero();
                let shade = n.z.abs() * 200.0 + 30.0;
                let pixel = [(shade * 0.4) as u8, (shade * 0.7) as u8, shade as u8];
                let (x, y) = (i % width, i / width);
                picture.put_pixel((x + width) as u32, y as u32, image::Rgb(pixel));
            }
        }
    }
    picture.save(name).expect("the folder is there");
}
