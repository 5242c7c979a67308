//! `effigy dataset`: simulated people to learn from and to measure with, made and looked at.

use std::{collections::BTreeMap, path::Path, sync::Arc};

use anyhow::bail;
use effigy_fusion::TriangleMesh;
use effigy_registration::{BodyModel, smpl::builtin};
use effigy_sim_sensor::dataset::{
    CapeImport, Dataset, DatasetPlan, DatasetPreset, Gender, MakeProgress, Manifest, Sequence,
    SequenceEntry, Split, import_cape, make,
};
use effigy_viewer::pictures::{Clay, ContactSheet, MeshView, Picture, PictureCamera, render_mesh};

use crate::{
    cli::{CapeGender, DatasetArgs, DatasetMakeArgs, DatasetViewArgs, DatasetWhat, ImportCapeArgs},
    interrupt,
    progress::Progress,
};

/// Moments of a sequence that a sheet shows.
const MOMENTS: usize = 4;
const TILE_PX: [u32; 2] = [260, 360];

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
    let plan = DatasetPlan::new(args.preset, args.seed);
    let progress = Progress::new("simulating", Some(plan.frame_count()));
    let go_on = |now: MakeProgress| {
        progress.advance(now.frames);
        !interrupt::requested()
    };
    let made = make(&plan, &builtin::body(), &args.out, &go_on)?;
    progress.finish();
    let Some(manifest) = made else {
        println!("stopped; the same command goes on from here");
        return Ok(());
    };
    println!("{}", summary(&args.out, &manifest));
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
        println!("stopped; the same command goes on from here");
        return Ok(());
    };
    println!("{}", summary(&args.out, &manifest));
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

/// A row a sequence; of each outfit at most `--rows`.
fn view(args: &DatasetViewArgs) -> anyhow::Result<()> {
    let body = match &args.body {
        Some(path) => Arc::new(BodyModel::load(path)?),
        None => builtin::body(),
    };
    let dataset = Dataset::open(&args.dataset, &body)?;
    println!("{}", summary(&args.dataset, dataset.manifest()));
    let mut shown: BTreeMap<&str, usize> = BTreeMap::new();
    let mut sheet = ContactSheet::new(MOMENTS + 1);
    for entry in &dataset.manifest().sequences {
        let rows = shown.entry(entry.plan.outfit.name()).or_default();
        if *rows < args.rows {
            *rows += 1;
            sheet = add_row(sheet, entry, &dataset.load(entry)?);
        }
    }
    sheet.save(&args.out)?;
    println!("{}", args.out.display());
    Ok(())
}

/// Moments from the front, and the last one's star pose.
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
        sheet = sheet.add(label, drawn(&sequence.posed_mesh(frame), TILE_PX));
    }
    sheet.add("star pose", drawn(&sequence.star_mesh(last), TILE_PX))
}

/// In clay, a little from the side and from above.
pub(super) fn drawn(mesh: &TriangleMesh, size_px: [u32; 2]) -> Picture {
    let camera = PictureCamera::around(&mesh.vertices, 0.4, 0.1, size_px);
    render_mesh(MeshView::from(mesh), &camera, Clay::default())
}
