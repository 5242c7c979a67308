//! The program as its users meet it: commands, exit codes, messages, files.

use std::{
    fs,
    path::Path,
    process::{Command, Output},
};

/// Of clap: what was typed makes no sense.
const USAGE: i32 = 2;
/// Of `main`: what was typed made sense, but the data did not.
const DATA: i32 = 1;

fn effigy(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_effigy"))
        .current_dir(folder)
        .args(arguments)
        .output()
        .expect("the program was built beside this test")
}

fn assert_fails(output: &Output, code: i32, needles: &[&str]) {
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{message}");
    for needle in needles {
        assert!(message.contains(needle), "no '{needle}' in: {message}");
    }
    assert!(!message.contains("panicked"), "{message}");
}

fn assert_succeeds(output: &Output) {
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{message}");
}

fn simulate(folder: &Path, name: &str, seconds: &str) {
    let arguments = [
        "simulate",
        "--out",
        name,
        "--seconds",
        seconds,
        "--motion",
        "turn-around",
    ];
    assert_succeeds(&effigy(folder, &arguments));
}

#[test]
fn what_makes_no_sense_is_a_usage_error_that_names_the_choices() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    assert_fails(&effigy(here, &["dance"]), USAGE, &["dance"]);
    let unknown_sensor = ["simulate", "--out", "s.mcap", "--sensor", "kodak"];
    assert_fails(
        &effigy(here, &unknown_sensor),
        USAGE,
        &["kodak", "azure", "d435", "oak"],
    );
}

#[test]
fn broken_files_are_data_errors_that_name_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    fs::write(here.join("noise.mcap"), b"this is no recording").unwrap();
    fs::write(here.join("noise.effigy"), b"this is no avatar").unwrap();
    fs::write(here.join("noise.npz"), b"this is no body").unwrap();
    let headless = ["--headless", "--out", "out"];
    let replay = |file: &'static str| [&["replay", file][..], &headless].concat();
    assert_fails(&effigy(here, &replay("noise.mcap")), DATA, &["noise.mcap"]);
    assert_fails(
        &effigy(here, &replay("absent.mcap")),
        DATA,
        &["absent.mcap"],
    );
    let export = ["export", "noise.effigy", "--glb", "out.glb"];
    assert_fails(&effigy(here, &export), DATA, &["noise.effigy"]);
    let body = [
        "demo",
        "--headless",
        "--out",
        "out",
        "--seconds",
        "1",
        "--body",
        "noise.npz",
    ];
    assert_fails(&effigy(here, &body), DATA, &["noise.npz"]);
}

#[test]
fn unwritable_outputs_are_refused_before_the_work_begins() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    fs::write(here.join("file"), b"in the way").unwrap();
    let demo = ["demo", "--headless", "--seconds", "60", "--out", "file/out"];
    assert_fails(&effigy(here, &demo), DATA, &["file/out"]);
    let simulate = ["simulate", "--seconds", "1", "--out", "nowhere/s.mcap"];
    assert_fails(&effigy(here, &simulate), DATA, &["nowhere/s.mcap"]);
}

#[test]
fn two_replays_of_a_recording_track_the_same_to_the_last_bit() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    simulate(here, "s.mcap", "1.5");
    for run in ["one", "two"] {
        let poses = format!("{run}.json");
        let arguments = [
            "replay",
            "s.mcap",
            "--headless",
            "--out",
            run,
            "--poses",
            &poses,
        ];
        assert_succeeds(&effigy(here, &arguments));
    }
    let poses = |run: &str| fs::read_to_string(here.join(format!("{run}.json"))).unwrap();
    assert_eq!(poses("one"), poses("two"));
    assert!(poses("one").contains("\"state\":\"tracked\""));
}

#[test]
fn a_recording_cut_off_plays_up_to_the_cut_and_says_what_is_missing() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    simulate(here, "whole.mcap", "2");
    let whole = fs::read(here.join("whole.mcap")).unwrap();
    fs::write(here.join("cut.mcap"), &whole[..whole.len() * 6 / 10]).unwrap();
    let output = effigy(here, &["replay", "cut.mcap", "--headless", "--out", "out"]);
    assert_succeeds(&output);
    assert!(String::from_utf8_lossy(&output.stderr).contains("cut.mcap"));
    let report: serde_json::Value =
        serde_json::from_slice(&fs::read(here.join("out/report.json")).unwrap()).unwrap();
    let frames = report["frames"]["in"].as_u64().unwrap();
    assert!(
        (10..60).contains(&frames),
        "{frames} frames of 60 before the cut"
    );
}
