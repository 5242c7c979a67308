//! `effigy evaluate skinning`: how far from their true places in star pose points of test people land.

mod region;
mod view;

use std::{collections::BTreeMap, f32::consts::FRAC_PI_4, fmt::Write as _, sync::Arc};

use anyhow::bail;
use effigy_avatar::{
    canonicalise::canonical_places,
    skinning::{ClosestBodyPoint, NetworkSkinning, SkinningNetworks, Warp, fold_extremities},
};
use effigy_fusion::clean::Cleaner;
use effigy_registration::{BodyModel, smpl::builtin};
use effigy_sim_sensor::dataset::{Dataset, SequenceEntry, Split};
use glam::Vec3;
use serde::Serialize;

use self::{
    region::Region,
    view::{Sensor, View},
};
use super::avatar::protocol_calibration;
use crate::{
    cli::EvaluateSkinningArgs,
    files, interrupt,
    machine::Machine,
    pipeline::{clock::Clock, settings::Settings},
    progress::Progress,
    say::say,
};

/// Changes when a key changes its meaning.
const SCHEMA: &str = "effigy.evaluate.skinning/1";

/// A way to find canonical places.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
enum Method {
    /// The true weights with the nearest body model's joints: what remains is not skinning's.
    TrueWeights,
    ClosestBodyPoint,
    /// Network that sees the cloud only.
    CloudOnly,
    /// Network that sees the cloud and the body.
    Network,
    /// Inverse skinning, then corrections by forward skinning, as the program does it.
    ClosestBodyPointRefined,
    NetworkRefined,
}

impl Method {
    const ALL: [Self; 6] = [
        Self::TrueWeights,
        Self::ClosestBodyPoint,
        Self::CloudOnly,
        Self::Network,
        Self::ClosestBodyPointRefined,
        Self::NetworkRefined,
    ];

    fn name(self) -> &'static str {
        match self {
            Self::TrueWeights => "true weights",
            Self::ClosestBodyPoint => "closest body point",
            Self::CloudOnly => "network, cloud only",
            Self::Network => "network, cloud and body",
            Self::ClosestBodyPointRefined => "closest body point, refined",
            Self::NetworkRefined => "network, refined",
        }
    }
}

/// Mean errors in millimetres.
#[derive(Clone, Debug, Serialize)]
struct Row {
    method: Method,
    sensor: Sensor,
    /// `all` for all outfits together.
    outfit: String,
    overall_mm: f64,
    armpit_mm: Option<f64>,
    inner_thigh_mm: Option<f64>,
    other_contact_mm: Option<f64>,
    /// Points in all, in armpits, at inner thighs.
    points: [u64; 3],
    /// For one view's points, on all cores.
    milliseconds_a_view: f64,
}

#[derive(Serialize)]
struct Report<'a> {
    schema: &'static str,
    machine: Machine,
    frames_a_sequence: usize,
    rows: &'a [Row],
}

/// Sums of errors and counts: armpit, inner thigh, other contact, free.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    regions: [(f64, u64); 4],
    views: u64,
    seconds: f64,
}

pub(super) fn run(args: &EvaluateSkinningArgs) -> anyhow::Result<()> {
    for file in args.json.iter().chain(&args.md) {
        files::check_writable(file)?;
    }
    let body = builtin::body();
    let dataset = Dataset::open(&args.data, &body)?;
    let networks = match &args.networks {
        Some(path) => SkinningNetworks::load(path, body.identity)?,
        None => SkinningNetworks::shipped(body.identity)?,
    };
    let networks = Arc::new(networks);
    let entries: Vec<&SequenceEntry> = dataset
        .manifest()
        .sequences
        .iter()
        .filter(|entry| entry.plan.split == Split::Test)
        .filter(|entry| entry.plan.outfit.name().contains(&args.outfit))
        .collect();
    if entries.is_empty() {
        bail!(
            "no test person of {} wears anything with `{}` in its name; `effigy dataset view` lists what there is",
            args.data.display(),
            args.outfit
        );
    }
    let progress = Progress::new("skinning", Some(entries.len() as u64));
    let mut sums = BTreeMap::new();
    for (number, entry) in entries.iter().enumerate() {
        if interrupt::requested() {
            break;
        }
        judge(&dataset, entry, &body, &networks, args.frames, &mut sums)?;
        progress.advance(number as u64 + 1);
    }
    progress.finish();
    let rows = rows(&sums);
    let table = markdown(&rows);
    say!("{}", table.trim_end());
    if let Some(path) = &args.md {
        files::write(path, &table)?;
    }
    if let Some(path) = &args.json {
        let report = Report {
            schema: SCHEMA,
            machine: Machine::this(),
            frames_a_sequence: args.frames,
            rows: &rows,
        };
        files::write_json(path, &report)?;
    }
    Ok(())
}

/// Outfit, sensor by place, method.
type Key = (String, usize, Method);

fn judge(
    dataset: &Dataset,
    entry: &SequenceEntry,
    body: &Arc<BodyModel>,
    networks: &Arc<SkinningNetworks>,
    frames: usize,
    sums: &mut BTreeMap<Key, Sums>,
) -> anyhow::Result<()> {
    let settings = Settings::default();
    let sequence = dataset.load(entry)?;
    let clock = Clock::start();
    let config = settings.canonicalise.closest_body_point.clone();
    let closest = ClosestBodyPoint::new(Arc::clone(body), &sequence.betas, config);
    let network = NetworkSkinning::new(Arc::clone(networks), Arc::clone(body), &sequence.betas);
    let mut cleaner = Cleaner::new(protocol_calibration(), settings.clean.clone());
    let places = crate::pipeline::evaluate::evenly_placed(sequence.frames.len(), frames);
    for (number, frame) in places.into_iter().enumerate() {
        for (which, sensor) in Sensor::ALL.into_iter().enumerate() {
            let yaw_rad = (number + entry.plan.subject as usize) as f32 * FRAC_PI_4;
            let view = View::new(&sequence, frame, yaw_rad, sensor, body, &mut cleaner)?;
            for method in Method::ALL {
                let start = clock.secs();
                let found = match method {
                    Method::TrueWeights => by_weights(&view, &view.weights, body),
                    Method::CloudOnly => {
                        by_weights(&view, &networks.weights_of_cloud(&view.points), body)
                    }
                    Method::ClosestBodyPoint => places_of(&view, &closest, body, None),
                    Method::Network => places_of(&view, &network, body, None),
                    Method::ClosestBodyPointRefined => {
                        places_of(&view, &closest, body, Some(&settings))
                    }
                    Method::NetworkRefined => places_of(&view, &network, body, Some(&settings)),
                };
                let seconds = clock.secs() - start;
                let outfits = [entry.plan.outfit.name().to_owned(), "all".to_owned()];
                for outfit in outfits {
                    let sums = sums.entry((outfit, which, method)).or_default();
                    sums.add(&view, &found, seconds);
                }
            }
        }
    }
    Ok(())
}

fn warp(view: &View, body: &BodyModel) -> Warp {
    let shaped = body.shaped_vertices(&view.params.betas);
    Warp::new(&view.params, &body.joints(&shaped))
}

fn by_weights(view: &View, weights: &[[f32; 24]], body: &BodyModel) -> Vec<Vec3> {
    let warp = warp(view, body);
    let place = |(&point, weights): (&Vec3, &[f32; 24])| {
        let mut weights = *weights;
        fold_extremities(&mut weights);
        warp.canonical_from_posed(&weights).transform_point3(point)
    };
    view.points.iter().zip(weights).map(place).collect()
}

/// Without settings by inverse skinning alone.
fn places_of(
    view: &View,
    skinning: &dyn effigy_avatar::skinning::Skinning,
    body: &BodyModel,
    refined: Option<&Settings>,
) -> Vec<Vec3> {
    let posed = body.pose(&view.params);
    let warp = warp(view, body);
    let steps = refined.map_or(0, |settings| settings.canonicalise.refine_steps);
    canonical_places(
        skinning,
        (&posed, &warp),
        &view.points,
        &view.normals,
        steps,
    )
}

impl Sums {
    fn add(&mut self, view: &View, found: &[Vec3], seconds: f64) {
        self.views += 1;
        self.seconds += seconds;
        let points = view.regions.iter().zip(&view.star).zip(found);
        for ((region, truth), found) in points {
            let which = match region {
                Region::Armpit => 0,
                Region::InnerThigh => 1,
                Region::OtherContact => 2,
                Region::Free => 3,
            };
            let (sum, count) = &mut self.regions[which];
            *sum += f64::from(found.distance(*truth)) * 1e3;
            *count += 1;
        }
    }

    fn mean(&self, which: usize) -> Option<f64> {
        let (sum, count) = self.regions[which];
        (count > 0).then(|| sum / count as f64)
    }
}

fn rows(sums: &BTreeMap<Key, Sums>) -> Vec<Row> {
    let row = |((outfit, sensor, method), sums): (&Key, &Sums)| {
        let total = sums
            .regions
            .iter()
            .fold((0.0, 0), |a, b| (a.0 + b.0, a.1 + b.1));
        Row {
            method: *method,
            sensor: Sensor::ALL[*sensor],
            outfit: outfit.clone(),
            overall_mm: total.0 / (total.1.max(1)) as f64,
            armpit_mm: sums.mean(0),
            inner_thigh_mm: sums.mean(1),
            other_contact_mm: sums.mean(2),
            milliseconds_a_view: 1e3 * sums.seconds / sums.views.max(1) as f64,
            points: [total.1, sums.regions[0].1, sums.regions[1].1],
        }
    };
    sums.iter().map(row).collect()
}

fn markdown(rows: &[Row]) -> String {
    let mut text = String::from(
        "| outfit | sensor | method | overall, mm | armpit, mm | inner thigh, mm | other contact, mm | points: all, armpit, thigh | ms a view |\n\
         |---|---|---|---|---|---|---|---|---|\n",
    );
    let number = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |x| format!("{x:.2}"));
    for row in rows {
        let [all, armpit, thigh] = row.points;
        let _written = writeln!(
            text,
            "| {} | {} | {} | {:.2} | {} | {} | {} | {all}, {armpit}, {thigh} | {:.0} |",
            row.outfit,
            row.sensor.name(),
            row.method.name(),
            row.overall_mm,
            number(row.armpit_mm),
            number(row.inner_thigh_mm),
            number(row.other_contact_mm),
            row.milliseconds_a_view,
        );
    }
    text
}
