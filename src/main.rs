//! Effigy: one depth camera in, a live avatar out.

#![expect(clippy::print_stderr, reason = "a program talks to its user")]

mod cli;
mod commands;
mod files;
mod interrupt;
mod machine;
mod pipeline;
mod progress;
mod report;
mod say;
#[cfg(feature = "window")]
mod window;

use std::{io::IsTerminal as _, process::ExitCode};

use clap::Parser as _;

use cli::{Cli, Command};

fn main() -> ExitCode {
    let cli = Cli::parse();
    tracing_subscriber::fmt()
        .with_env_filter(
            tracing_subscriber::EnvFilter::try_from_env("EFFIGY_LOG")
                .unwrap_or_else(|_| tracing_subscriber::EnvFilter::new("warn")),
        )
        .with_writer(std::io::stderr)
        .without_time()
        .with_target(false)
        .with_ansi(std::io::stderr().is_terminal())
        .init();
    match run(cli) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("effigy: {}", one_line(&error));
            if error.is::<interrupt::Stopped>() {
                ExitCode::from(interrupt::EXIT_INTERRUPTED)
            } else {
                ExitCode::FAILURE
            }
        }
    }
}

/// The error and its causes; many an error already says what caused it.
fn one_line(error: &anyhow::Error) -> String {
    error.chain().fold(String::new(), |line, cause| {
        let cause = cause.to_string();
        if line.is_empty() {
            cause
        } else if line.contains(&cause) {
            line
        } else {
            format!("{line}: {cause}")
        }
    })
}

fn run(cli: Cli) -> anyhow::Result<()> {
    interrupt::install()?;
    match cli.command.unwrap_or_default() {
        Command::Demo(args) => commands::demo::run(&args),
        Command::Simulate(args) => commands::simulate::run(&args),
        Command::Replay(args) => commands::replay::run(&args),
        Command::Import(args) => commands::import::run(&args),
        Command::Info(args) => commands::info::run(&args),
        Command::Settings(args) => commands::settings::run(&args),
        Command::Export(args) => commands::export::run(&args),
        Command::Dataset(args) => commands::dataset::run(&args),
        Command::Train(args) => commands::train::run(&args),
        Command::Evaluate(args) => commands::evaluate::run(&args).and_then(|()| whole()),
        Command::Bench(args) => commands::bench::run(&args).and_then(|()| whole()),
    }
}

/// Tables that Ctrl-C cut short are printed, but nobody shall take them for whole ones.
fn whole() -> anyhow::Result<()> {
    if interrupt::requested() {
        return Err(interrupt::Stopped::early().into());
    }
    Ok(())
}
