//! Draws simulated clothes and measures them: `wardrobe --out DIR [--seed N] [--fit X] [--quick] [OUTFIT ..]`.
//!
//! A contact sheet for each outfit (four poses, from the front and from the side) and a table on standard output.

use std::{env, error::Error, fs, path::PathBuf, sync::Arc, time::Instant};

use effigy_capture::{Intrinsics, Rigid3};
use effigy_registration::{
    motion::{Motion, Routine},
    smpl::builtin,
};
use effigy_sim_sensor::{
    Outfit, Person, Room,
    cloth::{ClothConfig, ClothKind, Wear, strays_m},
    person::sample_betas,
    render::Renderer,
};
use glam::{Quat, Vec3};

const RATE_HZ: f32 = 30.0;
const CELL: [u32; 2] = [300, 520];

struct Options {
    out: PathBuf,
    seed: u64,
    fit: f32,
    kinds: Vec<ClothKind>,
    /// Stop each movement when its picture is taken.
    quick: bool,
    config: ClothConfig,
}

fn main() -> Result<(), Box<dyn Error>> {
    let options = options()?;
    fs::create_dir_all(&options.out)?;
    println!(
        "outfit | points | deeper than 2 mm | strain > 15 % | ms a frame | stray mm (mean, p90)"
    );
    for &kind in &options.kinds {
        study(&options, kind)?;
    }
    Ok(())
}

fn options() -> Result<Options, Box<dyn Error>> {
    let mut options = Options {
        out: PathBuf::from("."),
        seed: 1,
        fit: 0.8,
        kinds: Vec::new(),
        quick: false,
        config: ClothConfig::default(),
    };
    let mut args = env::args().skip(1);
    while let Some(arg) = args.next() {
        let mut value = || args.next().ok_or(format!("{arg} needs a value"));
        match arg.as_str() {
            "--out" => options.out = value()?.into(),
            "--seed" => options.seed = value()?.parse()?,
            "--fit" => options.fit = value()?.parse()?,
            "--step-hz" => options.config.step_secs = 1.0 / value()?.parse::<f32>()?,
            "--iterations" => options.config.iterations = value()?.parse()?,
            "--quick" => options.quick = true,
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

#[expect(clippy::disallowed_methods, reason = "this example measures time")]
fn study(options: &Options, kind: ClothKind) -> Result<(), Box<dyn Error>> {
    let body = builtin::body();
    let betas = sample_betas(&body, options.seed);
    let person = Arc::new(Person::new(body, betas, Outfit::UNDER, options.seed));
    let tailoring = Instant::now();
    let mut wear = Wear::new(
        Arc::clone(&person),
        kind,
        options.fit,
        options.seed,
        options.config,
    );
    let tailoring_ms = tailoring.elapsed().as_secs_f64() * 1e3;
    let rest = person.rest_body();
    let acts = [
        Routine::Stand,
        Routine::RaiseArms,
        Routine::Squat,
        Routine::WalkInPlace,
    ];
    let mut motions = acts.map(|act| act.motion(&rest, RATE_HZ, options.seed));
    if env::var("ONLY_SQUAT").is_ok() {
        for m in [0, 1, 3] {
            motions[m].poses.truncate(2);
        }
    }
    let start = Instant::now();
    wear.start(&motions[0].poses[0]);
    let warm_up_ms = start.elapsed().as_secs_f64() * 1e3;
    let mut sheet = image::RgbImage::new(CELL[0] * 8, CELL[1]);
    let mut simulated_ms = 0.0;
    let mut frames = 0;
    let (mut deep, mut strained, mut points, mut edges) = (0, 0, 0, 0);
    let mut deepest_m = 0.0_f32;
    let mut star = Vec::new();
    let mut lines = Vec::new();
    for (column, motion) in motions.iter().enumerate() {
        let mut acts_strains = vec![Vec::new(); wear.garments().len()];
        let shown = (shown_secs(column, motion) * RATE_HZ) as usize;
        for (number, pose) in motion
            .poses
            .iter()
            .enumerate()
            .skip(usize::from(column > 0))
        {
            let before = Instant::now();
            wear.step(pose, RATE_HZ.recip());
            simulated_ms += before.elapsed().as_secs_f64() * 1e3;
            frames += 1;
            if number % 3 == 0 {
                for clearance in wear.clearances_m() {
                    points += 1;
                    deep += usize::from(clearance < -0.002);
                    deepest_m = deepest_m.min(clearance);
                }
                star.push(wear.garments_in_star_pose());
            }
            for (g, strains) in acts_strains.iter_mut().enumerate() {
                strains.extend(wear.strains_of(g));
            }
            for strain in wear.strains() {
                edges += 1;
                strained += usize::from(strain.abs() > 0.15);
            }
            if number == shown {
                if env::var("DUMP").is_ok() && column == 2 {
                    for (g, (garment, points)) in
                        wear.garments().iter().zip(wear.points()).enumerate()
                    {
                        let mut text = String::new();
                        for (s, [a, b]) in wear.strains_of(g).iter().zip(garment.rest.edge_ends()) {
                            let r = 0.5 * (garment.rest.points[a] + garment.rest.points[b]);
                            let d = garment.rest.points[a] - garment.rest.points[b];
                            let p = 0.5 * (points[a] + points[b]);
                            text += &format!(
                                "{s} {} {} {} {} {} {} {} {} {}\n",
                                r.x, r.y, r.z, p.x, p.y, p.z, d.x, d.y, d.z
                            );
                        }
                        fs::write(format!("/tmp/strain{g}.txt"), text)?;
                    }
                }
                for (view, turn) in [0.0_f32, 1.9].into_iter().enumerate() {
                    draw(&wear, turn, &mut sheet, (2 * column + view) as u32);
                }
                if options.quick {
                    break;
                }
            }
        }
        for (g, strains) in acts_strains.iter().enumerate() {
            let n = strains.len() as f32;
            lines.push(format!(
                "  act {column} {}: mean {:.3}, > 15 %: {:.2} %, < -15 %: {:.2} %",
                wear.garments()[g].pattern.name,
                strains.iter().sum::<f32>() / n,
                100.0 * strains.iter().filter(|s| **s > 0.15).count() as f32 / n,
                100.0 * strains.iter().filter(|s| **s < -0.15).count() as f32 / n
            ));
        }
    }
    for line in lines {
        eprintln!("{line}");
    }
    let mut strays = strays_m(&star);
    strays.sort_by(f32::total_cmp);
    let mean = strays.iter().sum::<f32>() / strays.len() as f32;
    println!(
        "{} | {:?} | {:.3} % (deepest {:.1} mm) | {:.2} % | {:.0} ms | {:.1}, {:.1} mm | cut {:.0} ms, warm-up {:.0} ms",
        kind.name(),
        wear.garments()
            .iter()
            .map(|g| g.rest.points.len())
            .collect::<Vec<_>>(),
        100.0 * deep as f32 / points as f32,
        deepest_m * 1e3,
        100.0 * strained as f32 / edges as f32,
        simulated_ms / f64::from(frames),
        mean * 1e3,
        strays[strays.len() * 9 / 10] * 1e3,
        tailoring_ms,
        warm_up_ms,
    );
    sheet.save(options.out.join(format!("{}.png", kind.name())))?;
    Ok(())
}

/// When to take the picture.
fn shown_secs(column: usize, motion: &Motion) -> f32 {
    motion.duration_secs() * [0.9, 0.25, 0.27, 0.5][column]
}

fn draw(wear: &Wear, turn_rad: f32, sheet: &mut image::RgbImage, column: u32) {
    let camera = Intrinsics {
        width: CELL[0],
        height: CELL[1],
        fx: 800.0,
        fy: 800.0,
        cx: CELL[0] as f32 * 0.5,
        cy: CELL[1] as f32 * 0.5,
    };
    let rotation =
        Quat::from_rotation_y(turn_rad) * Quat::from_rotation_x(std::f32::consts::PI - 0.05);
    let from = Quat::from_rotation_y(turn_rad) * Vec3::new(0.0, 1.15, 3.5);
    let world_from_camera = Rigid3 { rotation, translation: from };
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
