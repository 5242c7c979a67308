//! `effigy bench`: how fast this machine is at what a user waits for, and how far the kernels are from its limits.

mod chain;
mod drive;
mod field;
mod fusion;
#[cfg_attr(not(feature = "gpu"), path = "no_gpu.rs")]
mod gpu;
mod in_turn;

use std::fmt::Write as _;

use anyhow::Context as _;
use serde::Serialize;

use crate::{
    cli::BenchArgs,
    files, interrupt,
    machine::{Machine, peak_memory_mb},
    say::say,
};

/// Changes when a key changes its meaning.
const SCHEMA: &str = "effigy.bench/1";

/// What is measured together.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum Part {
    /// The field's kernel and a whole fine-tuning step
    Field,
    /// The avatar in pose after pose, and meshing it
    Drive,
    /// Cleaning, normals, volume, marching cubes, the body
    Fusion,
    /// A recorded person through the whole program, as if live
    Chain,
}

impl Part {
    const ALL: [Self; 4] = [Self::Field, Self::Drive, Self::Fusion, Self::Chain];
}

/// One figure.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Row {
    name: String,
    value: f64,
    unit: &'static str,
    /// How often this goes into what `compared_with` says, measured in turn in this run; above one is better.
    ratio: Option<f64>,
    compared_with: Option<&'static str>,
}

impl Row {
    fn new(name: impl Into<String>, value: f64, unit: &'static str) -> Self {
        Self { name: name.into(), value, unit, ratio: None, compared_with: None }
    }

    fn against(self, compared_with: &'static str, ratio: f64) -> Self {
        Self { ratio: Some(ratio), compared_with: Some(compared_with), ..self }
    }
}

#[derive(Serialize)]
struct Results {
    schema: &'static str,
    version: &'static str,
    machine: Machine,
    /// Everything runs on the processor but what names an adapter.
    device: &'static str,
    quick: bool,
    rows: Vec<Row>,
}

pub(crate) fn run(args: &BenchArgs) -> anyhow::Result<()> {
    if let Some(path) = &args.json {
        files::check_writable(path)?;
    }
    if let Some(folder) = &args.keep {
        std::fs::create_dir_all(folder)
            .with_context(|| format!("{}: cannot make this folder", folder.display()))?;
    }
    let parts = if args.only.is_empty() {
        &Part::ALL[..]
    } else {
        &args.only
    };
    let mut rows = Vec::new();
    for part in parts {
        if interrupt::requested() {
            break;
        }
        rows.extend(match part {
            Part::Field => field::rows(args.quick)?,
            Part::Drive => drive::rows(args.quick)?,
            Part::Fusion => fusion::rows(args.quick, args.keep.as_deref())?,
            Part::Chain => chain::rows(args.quick)?,
        });
    }
    rows.extend(peak_memory_mb().map(|peak| Row::new("peak memory of this run", peak, "MB")));
    let machine = Machine::this();
    say!("{}", table(&machine, &rows));
    if let Some(path) = &args.json {
        let (quick, version) = (args.quick, env!("CARGO_PKG_VERSION"));
        let results = Results { schema: SCHEMA, version, machine, device: "cpu", quick, rows };
        files::write_json(path, &results)?;
    }
    Ok(())
}

fn table(machine: &Machine, rows: &[Row]) -> String {
    let cpu = machine.cpu.as_deref().unwrap_or(machine.arch);
    let mut text = format!(
        "{cpu}, {} threads; everything runs on the processor but what names an adapter\n\n| what | value | | ratio |\n|---|---|---|---|\n",
        machine.threads
    );
    for Row { name, value, unit, ratio, compared_with } in rows {
        let digits = match *value {
            100.0.. => 0,
            value if value > 0.0 && value < 0.01 => 5,
            _ => 2,
        };
        let against = match (ratio, compared_with) {
            (Some(ratio), Some(with)) => format!("{ratio:.2} x {with}"),
            _ => String::new(),
        };
        // Writing to a string cannot fail.
        _ = writeln!(text, "| {name} | {value:.digits$} | {unit} | {against} |");
    }
    text
}
