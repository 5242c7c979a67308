//! `effigy dataset`: simulated people to learn from and to measure with, made and looked at.

use std::{collections::BTreeMap, f32::consts::PI, path::Path, sync::Arc};

use anyhow::{bail, ensure};
use effigy_fusion::TriangleMesh;
use effigy_registration::{BodyModel, smpl::builtin};
use effigy_sim_sensor::dataset::{
    CapeImport, ClothFacts, Dataset, DatasetPlan, DatasetPreset, Gender, MakeProgress, Manifest,
    Sequence, SequenceEntry, Split, import_cape, make,
};
use effigy_viewer::pictures::{
    Clay, ContactSheet, MeshView, Picture, PictureCamera, palette, render_mesh,
};
use image::imageops;

use crate::{
    cli::{CapeGender, DatasetArgs, DatasetMakeArgs, DatasetViewArgs, DatasetWhat, ImportCapeArgs},
    interrupt::{self, Stopped},
    progress::Progress,
    say::say,
};

/// Moments of a sequence that a sheet shows.
const MOMENTS: usize = 4;
const TILE_PX: [u32; 2] = [260, 360];
/// A little from the side and from above.
const FROM_FRONT_RAD: f32 = 0.4;
const FROM_BEHIND_RAD: f32 = FROM_FRONT_RAD + PI;
const ELEVATION_RAD: f32 = 0.1;

pub(crate) fn run(args: &DatasetArgs) -> anyhow::Result<()> {
    match &args.what {
        DatasetWhat::Make(args) => make_dataset(args),
        DatasetWhat::ImportCape(args) => import(args),
        DatasetWhat::View(args) => view(args),
    }
}

fn make_dataset(args: &DatasetMakeArgs) -> anyhow::Result<()> {
    if args.preset == DatasetPreset::Cape {
        bail!(
            "CAPE itself is not made but imported: `effigy dataset import-cape`; `cape-like` is ours"
        );
    }
    let mut plan = DatasetPlan::new(args.preset, args.seed);
    if !args.only.is_empty() {
        plan.keep_only(&args.only);
        ensure!(
            !plan.sequences.is_empty(),
            "--only {}: no sequence of this data set is called anything like it; names look like test-003-blazer-trousers-bend",
            args.only.join(",")
        );
    }
    let progress = Progress::new("simulating", Some(plan.frame_count()));
    let go_on = |now: MakeProgress| {
        progress.advance(now.frames);
        !interrupt::requested()
    };
    let made = make(&plan, &builtin::body(), &args.out, &go_on)?;
    progress.finish();
    let Some(manifest) = made else {
        return Err(Stopped::on_the_way().into());
    };
    say!(
        "{}{}",
        summary(&args.out, &manifest),
        cloth_table(&manifest)
    );
    Ok(())
}

fn import(args: &ImportCapeArgs) -> anyhow::Result<()> {
    let body = Arc::new(BodyModel::load(&args.body)?);
    let choice = CapeImport {
        every: args.every as usize,
        gender: args.gender.map(|gender| match gender {
            CapeGender::Female => Gender::Female,
            CapeGender::Male => Gender::Male,
        }),
    };
    let progress = Progress::new("importing", None);
    let go_on = |now: MakeProgress| {
        progress.advance(now.frames);
        !interrupt::requested()
    };
    let imported = import_cape(&args.release, &body, &choice, &args.out, &go_on)?;
    progress.finish();
    let Some(manifest) = imported else {
        return Err(Stopped::on_the_way().into());
    };
    say!("{}", summary(&args.out, &manifest));
    Ok(())
}

fn summary(folder: &Path, manifest: &Manifest) -> String {
    let people = |split| {
        let of_split = manifest
            .sequences
            .iter()
            .filter(|entry| entry.plan.split == split);
        let mut subjects: Vec<u32> = of_split.map(|entry| entry.plan.subject).collect();
        subjects.sort_unstable();
        subjects.dedup();
        subjects.len()
    };
    format!(
        "{}: {} sequences, {} frames, {:.1} MiB; {} people to learn from, {} to test on",
        folder.display(),
        manifest.sequences.len(),
        manifest.frames,
        manifest.bytes as f64 / (1 << 20) as f64,
        people(Split::Train),
        people(Split::Test),
    )
}

const CLOTH_HEADER: &str = "
| clothes | sequences | strained edges, mean (worst) | deep in the body, mean (worst) | strays, rms | history floor |
|---|---|---|---|---|---|
";

/// What the clothes of each outfit do, over its sequences; empty where none are simulated.
fn cloth_table(manifest: &Manifest) -> String {
    let mut outfits: BTreeMap<(&str, &str), Vec<ClothFacts>> = BTreeMap::new();
    for entry in &manifest.sequences {
        if let Some(facts) = entry.cloth {
            let outfit = (entry.plan.split.name(), entry.plan.outfit.name());
            outfits.entry(outfit).or_default().push(facts);
        }
    }
    let mut rows = Vec::new();
    for ((split, outfit), facts) in outfits {
        let mean = |of: fn(&ClothFacts) -> f32| {
            facts.iter().map(of).sum::<f32>() / facts.len().max(1) as f32
        };
        let worst = |of: fn(&ClothFacts) -> f32| facts.iter().map(of).fold(0.0, f32::max);
        let floors: Vec<f32> = facts.iter().filter_map(|f| f.history_floor_cm).collect();
        let floor = if floors.is_empty() {
            "-".to_owned()
        } else {
            format!("{:.2} cm", floors.iter().sum::<f32>() / floors.len() as f32)
        };
        rows.push(format!(
            "| {split} `{outfit}` | {} | {:.2} ({:.2}) % | {:.3} ({:.3}) % | {:.1} mm | {floor} |",
            facts.len(),
            100.0 * mean(|f| f.strained_share),
            100.0 * worst(|f| f.strained_share),
            100.0 * mean(|f| f.deep_share),
            100.0 * worst(|f| f.deep_share),
            mean(|f| f.strays_rms_mm),
        ));
    }
    if rows.is_empty() {
        return String::new();
    }
    format!("{CLOTH_HEADER}{}", rows.join("\n"))
}

/// A row a sequence; of each outfit at most `--rows`.
fn view(args: &DatasetViewArgs) -> anyhow::Result<()> {
    if args.rows == 0 {
        bail!("--rows is 0, expected at least 1");
    }
    let body = match &args.body {
        Some(path) => Arc::new(BodyModel::load(path)?),
        None => builtin::body(),
    };
    let dataset = Dataset::open(&args.dataset, &body)?;
    let manifest = dataset.manifest();
    say!(
        "{}{}",
        summary(&args.dataset, manifest),
        cloth_table(manifest)
    );
    let mut shown: BTreeMap<&str, usize> = BTreeMap::new();
    let mut sheet = ContactSheet::new(MOMENTS + 2);
    for entry in &dataset.manifest().sequences {
        let rows = shown.entry(entry.plan.outfit.name()).or_default();
        if entry.plan.name.contains(&args.only) && *rows < args.rows {
            *rows += 1;
            sheet = add_row(sheet, entry, &dataset.load(entry)?);
        }
    }
    if sheet.is_empty() {
        bail!(
            "no sequence of {} has `{}` in its name; the files there are called after their sequences",
            args.dataset.display(),
            args.only
        );
    }
    sheet.save(&args.out)?;
    say!("{}", args.out.display());
    Ok(())
}

/// Moments from the front, the last one also from behind, and its star pose.
fn add_row(mut sheet: ContactSheet, entry: &SequenceEntry, sequence: &Sequence) -> ContactSheet {
    let last = sequence.frames.len().saturating_sub(1);
    let plan = &entry.plan;
    for moment in 0..MOMENTS {
        let frame = last * moment / (MOMENTS - 1);
        let label = if moment == 0 {
            format!(
                "{} {}, {}",
                plan.split.name(),
                plan.subject,
                plan.outfit.name()
            )
        } else {
            format!("{} {frame}", plan.action)
        };
        sheet = sheet.add(label, in_color(sequence, frame, FROM_FRONT_RAD));
    }
    sheet = sheet.add("from behind", in_color(sequence, last, FROM_BEHIND_RAD));
    sheet.add("star pose", drawn(&sequence.star_mesh(last), TILE_PX))
}

/// As a colour camera sees somebody who stands some way around them.
fn in_color(sequence: &Sequence, frame: usize, azimuth_rad: f32) -> Picture {
    let mesh = sequence.posed_mesh(frame);
    let fine_px = TILE_PX.map(|side| side * 2);
    let camera = PictureCamera::around(&mesh.vertices, azimuth_rad, ELEVATION_RAD, fine_px);
    let view = sequence.in_color(&mesh, camera.intrinsics, camera.camera_from_world.inverse());
    let mut picture = Picture::new(fine_px[0], fine_px[1]);
    for ((pixel, color), depth_m) in picture.pixels_mut().zip(view.shaded()).zip(&view.depth_m) {
        *pixel = image::Rgb(if *depth_m > 0.0 {
            color
        } else {
            palette::PANEL
        });
    }
    imageops::thumbnail(&picture, TILE_PX[0], TILE_PX[1])
}

/// In clay.
pub(super) fn drawn(mesh: &TriangleMesh, size_px: [u32; 2]) -> Picture {
    let camera = PictureCamera::around(&mesh.vertices, FROM_FRONT_RAD, ELEVATION_RAD, size_px);
    render_mesh(MeshView::from(mesh), &camera, Clay::default())
}
