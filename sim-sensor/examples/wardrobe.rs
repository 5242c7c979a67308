//! Draws simulated clothes and measures them: `wardrobe --out DIR [--seed N] [--fit X] [OUTFIT ..]`.
//!
//! For each outfit a contact sheet (four poses from the front and from the side, PNG and a smaller JPEG) and a row
//! of a table on standard output.

#![expect(clippy::print_stdout, reason = "a program whose result is a table")]

use std::{env, error::Error, fs, io::BufWriter, path::PathBuf, sync::Arc};

use effigy_capture::{Intrinsics, Rigid3};
use effigy_registration::{
    motion::{MotionPose, Routine},
    smpl::builtin,
};
use effigy_sim_sensor::{
    Outfit, Person, Room,
    cloth::{Behaviour, ClothConfig, ClothKind, Wear, rms_between_m, strays_m},
    person::sample_betas,
    render::Renderer,
};
use glam::{Quat, Vec3};
use image::{RgbImage, codecs::jpeg::JpegEncoder, imageops};

const RATE_HZ: f32 = 30.0;
const CELL: [u32; 2] = [400, 500];
/// What is done, for how many frames, and in which of them the picture is taken.
const ACTS: [(Routine, usize, usize); 4] = [
    (Routine::Stand, 30, 29),
    (Routine::RaiseArms, 120, 58),
    (Routine::Squat, 84, 44),
    (Routine::WalkInPlace, 120, 66),
];
/// Time to take a pose, and to hold it until clothes have settled.
const HOLD_FRAMES: [usize; 2] = [12, 60];

struct Options {
    out: PathBuf,
    seed: u64,
    fit: f32,
    kinds: Vec<ClothKind>,
}

/// What was measured of one outfit.
#[derive(Default)]
struct Findings {
    clearances_m: Vec<f32>,
    behaviour: Behaviour,
    /// The largest share of strained edges in one act.
    worst_act: f32,
    offsets_m: Vec<Vec<Vec3>>,
    frame_secs: Vec<f64>,
    /// Clothes held in one pose after different acts.
    settled: Vec<Vec<Vec3>>,
    /// From the last frame but one to the last, and as the solver has it.
    settled_moves_m: Vec<f32>,
    settled_speeds_m_s: Vec<f32>,
}

fn main() -> Result<(), Box<dyn Error>> {
    let options = options()?;
    fs::create_dir_all(&options.out)?;
    println!(
        "| outfit | points | deeper than 2 mm | deepest | strain > 15 % (worst act) | ms a frame (max) | offset varies, rms (p90) | history floor, rms (p90) | moves after 2 s (solver) |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    for &kind in &options.kinds {
        let (sheet, row) = study(&options, kind);
        println!("{row}");
        sheet.save(options.out.join(format!("{}.png", kind.name())))?;
        let small = imageops::resize(
            &sheet,
            1600,
            1600 * CELL[1] / (8 * CELL[0]),
            imageops::FilterType::Triangle,
        );
        let file = fs::File::create(options.out.join(format!("{}.jpg", kind.name())))?;
        small.write_with_encoder(JpegEncoder::new_with_quality(BufWriter::new(file), 82))?;
    }
    Ok(())
}

fn options() -> Result<Options, Box<dyn Error>> {
    let mut options = Options { out: PathBuf::from("."), seed: 1, fit: 0.8, kinds: Vec::new() };
    let mut args = env::args().skip(1);
    while let Some(arg) = args.next() {
        let mut value = || args.next().ok_or(format!("{arg} needs a value"));
        match arg.as_str() {
            "--out" => options.out = value()?.into(),
            "--seed" => options.seed = value()?.parse()?,
            "--fit" => options.fit = value()?.parse()?,
            name => {
                let kind = ClothKind::ALL.into_iter().find(|kind| kind.name() == name);
                options
                    .kinds
                    .push(kind.ok_or(format!("no outfit is called {name}"))?);
            }
        }
    }
    if options.kinds.is_empty() {
        options.kinds = ClothKind::ALL.to_vec();
    }
    Ok(options)
}

fn study(options: &Options, kind: ClothKind) -> (RgbImage, String) {
    let body = builtin::body();
    let betas = sample_betas(&body, options.seed);
    let person = Arc::new(Person::new(body, betas, Outfit::UNDER, options.seed));
    let rest = person.rest_body();
    let mut wear = Wear::new(
        person,
        kind,
        options.fit,
        options.seed,
        ClothConfig::default(),
    );
    let stance = Routine::Stand.motion(&rest, RATE_HZ, options.seed).poses[0];
    wear.start(&stance);
    let mut sheet = RgbImage::new(CELL[0] * 8, CELL[1]);
    let mut findings = Findings::default();
    for (column, (routine, frames, shown)) in ACTS.into_iter().enumerate() {
        let motion = routine.motion(&rest, RATE_HZ, options.seed);
        let mut act = Behaviour::default();
        for (number, pose) in motion.poses.iter().take(frames).enumerate() {
            let before = cpu_secs();
            wear.step(pose, RATE_HZ.recip());
            findings.frame_secs.push(cpu_secs() - before);
            findings.look_at(&wear, number);
            act.add_strains(&wear);
            if number == shown {
                for (view, turn_rad) in [0.0, 1.9].into_iter().enumerate() {
                    draw(&wear, turn_rad, &mut sheet, (2 * column + view) as u32);
                }
            }
        }
        findings.worst_act = findings.worst_act.max(act.strained_share());
        if column > 0 {
            findings.hold(wear.clone(), &stance);
        }
    }
    let points: Vec<_> = wear
        .garments()
        .iter()
        .map(|g| g.rest.points.len().to_string())
        .collect();
    (sheet, findings.row(kind, &points.join(" + ")))
}

impl Findings {
    fn look_at(&mut self, wear: &Wear, number: usize) {
        self.behaviour.add_strains(wear);
        if number.is_multiple_of(3) {
            let clearances_m = wear.clearances_m();
            self.behaviour.add_clearances(&clearances_m);
            self.clearances_m.extend(clearances_m);
            self.offsets_m.push(wear.offsets_in_star_pose_m());
        }
    }

    /// Takes the stance from wherever the act ended, and waits.
    fn hold(&mut self, mut wear: Wear, stance: &MotionPose) {
        let from = *wear.pose();
        for frame in 1..=HOLD_FRAMES[0] {
            let share = frame as f32 / HOLD_FRAMES[0] as f32;
            wear.step(&from.interpolate(stance, share), RATE_HZ.recip());
        }
        let places = |wear: &Wear| -> Vec<Vec3> { wear.points().flatten().copied().collect() };
        let mut before = Vec::new();
        for _ in 0..HOLD_FRAMES[1] {
            before = places(&wear);
            wear.step(stance, RATE_HZ.recip());
        }
        let after = places(&wear);
        self.settled_moves_m.push(rms_between_m(&before, &after));
        self.settled_speeds_m_s.extend(wear.speeds_m_s());
        self.settled.push(after);
    }

    fn row(&self, kind: ClothKind, points: &str) -> String {
        let rms = |values: &[f32]| {
            (values.iter().map(|v| v * v).sum::<f32>() / values.len() as f32).sqrt()
        };
        let p90 = |mut values: Vec<f32>| {
            values.sort_by(f32::total_cmp);
            values[values.len() * 9 / 10]
        };
        let strays = strays_m(&self.offsets_m);
        let [first, second] = [&self.settled[0], &self.settled[1]];
        let apart: Vec<f32> = first
            .iter()
            .zip(second)
            .map(|(a, b)| a.distance(*b))
            .collect();
        let mean_ms = 1e3 * self.frame_secs.iter().sum::<f64>() / self.frame_secs.len() as f64;
        let max_ms = 1e3 * self.frame_secs.iter().copied().fold(0.0, f64::max);
        format!(
            "| `{}` | {points} | {:.3} % | {:.1} mm | {:.2} ({:.2}) % | {mean_ms:.0} ({max_ms:.0}) | {:.1} ({:.1}) mm | {:.1} ({:.1}) mm | {:.1} ({:.1}) mm/s |",
            kind.name(),
            100.0 * self.behaviour.deep_share(),
            -1e3 * self.clearances_m.iter().copied().fold(0.0, f32::min),
            100.0 * self.behaviour.strained_share(),
            100.0 * self.worst_act,
            1e3 * rms(&strays),
            1e3 * p90(strays.clone()),
            1e3 * rms_between_m(first, second),
            1e3 * p90(apart),
            1e3 * RATE_HZ * rms(&self.settled_moves_m),
            1e3 * rms(&self.settled_speeds_m_s),
        )
    }
}

fn draw(wear: &Wear, turn_rad: f32, sheet: &mut RgbImage, column: u32) {
    let camera = Intrinsics {
        width: CELL[0],
        height: CELL[1],
        fx: 780.0,
        fy: 780.0,
        cx: CELL[0] as f32 * 0.5,
        cy: CELL[1] as f32 * 0.5,
    };
    let turn = Quat::from_rotation_y(turn_rad);
    let rotation = turn * Quat::from_rotation_x(std::f32::consts::PI - 0.08);
    let world_from_camera = Rigid3 { rotation, translation: turn * Vec3::new(0.0, 1.15, 3.5) };
    let mut renderer = Renderer::new(camera, world_from_camera, Room::Floor).two_sided();
    let surface = wear.surface();
    let materials = wear
        .garments()
        .iter()
        .map(|g| (g.rest.points.len(), g.pattern.material));
    let paint = wear.person().paint.clone().with_garments(materials);
    let view = renderer.render(&surface.posed, &paint, &surface.weights);
    for (pixel, color) in view.shaded().into_iter().enumerate() {
        let (x, y) = (pixel as u32 % CELL[0], pixel as u32 / CELL[0]);
        let color = if view.depth_m[pixel] > 0.0 {
            color
        } else {
            [236, 236, 232]
        };
        sheet.put_pixel(column * CELL[0] + x, y, image::Rgb(color));
    }
}

/// Processor time of this thread, where the system tells; other programs do not matter to it.
fn cpu_secs() -> f64 {
    let stat = fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    let nanoseconds = stat
        .split(' ')
        .next()
        .and_then(|text| text.parse::<f64>().ok());
    nanoseconds.unwrap_or(f64::NAN) * 1e-9
}
