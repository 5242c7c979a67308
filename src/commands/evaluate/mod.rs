//! `effigy evaluate`: how good a part of the program is, on a fixed suite, as one file of numbers.

pub(crate) mod avatar;
mod skinning;
pub(crate) mod tracking;

use anyhow::bail;
use effigy_registration::smpl::builtin;
use serde::Serialize;

pub(crate) use self::avatar::{HEADLINE_SEEDS, Method, Table};
use self::tracking::{Case, Suite, Variant};
use crate::{
    cli::{EvaluateArgs, EvaluateTrackingArgs, EvaluateWhat, Protocol},
    files, interrupt,
    machine::Machine,
    pipeline::settings::Settings,
    progress::Progress,
    say::say,
};

/// Changes when a key changes its meaning.
const SCHEMA: &str = "effigy.evaluate.tracking/1";

pub(crate) fn run(args: &EvaluateArgs) -> anyhow::Result<()> {
    match (&args.what, &args.avatar.data, args.avatar.protocol) {
        (Some(EvaluateWhat::Tracking(args)), _, _) => evaluate_tracking(args),
        (Some(EvaluateWhat::Skinning(args)), _, _) => skinning::run(args),
        (None, Some(data), Protocol::Metavatar) => avatar::run(&args.avatar, data),
        (None, None, Protocol::Metavatar) => {
            bail!("name the data set with --data, or a suite: `effigy evaluate tracking`")
        }
    }
}

#[derive(Serialize)]
struct Report<'a> {
    schema: &'static str,
    machine: Machine,
    quick: bool,
    #[serde(flatten)]
    table: &'a tracking::Table,
}

fn evaluate_tracking(args: &EvaluateTrackingArgs) -> anyhow::Result<()> {
    files::check_writable(&args.json)?;
    let settings = Settings::load(args.config.as_deref())?;
    let cases = suite(args).cases();
    let variants: &[Variant] = if args.ablation {
        &Variant::ALL
    } else {
        &[Variant::Default]
    };
    let of_variant = |variant: Variant| -> Vec<Case> {
        let cases = cases.iter().filter(|case| variant.applies_to(case));
        cases.cloned().collect()
    };
    let suites: Vec<_> = variants
        .iter()
        .map(|&variant| (variant, of_variant(variant)))
        .collect();
    let count: usize = suites.iter().map(|(_, cases)| cases.len()).sum();
    let progress = Progress::new("tracking", Some(count as u64));
    let options = tracking::Options {
        clean: settings.clean,
        track: settings.track,
        smooth: settings.smooth.unwrap_or_default(),
        true_surface: false,
    };
    let mut table = tracking::Table::default();
    let mut before = 0;
    for (variant, cases) in &suites {
        table.append(tracking::evaluate(
            cases,
            &builtin::body(),
            (*variant, &options),
            &|done| {
                progress.advance((before + done) as u64);
                !interrupt::requested()
            },
        )?);
        before += cases.len();
    }
    progress.finish();
    // Whoever tunes on other people has no business with these.
    if args.people.is_empty() && !interrupt::requested() {
        table.append(tracking::explain_real_people(&builtin::body(), &options)?);
    }
    say!("{}", table.to_string().trim_end());
    let report =
        Report { schema: SCHEMA, machine: Machine::this(), quick: args.quick, table: &table };
    files::write_json(&args.json, &report)
}

/// The fixed suite, or what the arguments change of it.
fn suite(args: &EvaluateTrackingArgs) -> Suite {
    let mut suite = if args.quick {
        Suite::quick()
    } else {
        Suite::full()
    };
    if !args.people.is_empty() {
        suite.people.clone_from(&args.people);
    }
    if !args.sensor.is_empty() {
        suite.sensors.clone_from(&args.sensor);
    }
    if !args.outfit.is_empty() {
        suite.outfits.clone_from(&args.outfit);
        suite.in_cloth.clear();
    }
    suite
}
