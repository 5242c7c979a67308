//! The program as its users meet it: commands, exit codes, messages, files.

use std::{
    collections::BTreeMap,
    ffi::OsString,
    fs::{self, File},
    io::{self, BufRead as _, BufReader, Write as _},
    iter,
    path::Path,
    process::{Child, Command, Output, Stdio},
    thread,
    time::Duration,
};

use image::{ImageBuffer, Luma};
use zip::{ZipWriter, write::SimpleFileOptions};

/// Of clap: what was typed makes no sense.
const USAGE: i32 = 2;
/// Of the shell: ended by an interrupt.
const STOPPED: i32 = 130;
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

fn press_ctrl_c(run: &Child) {
    let id = run.id().to_string();
    let told = Command::new("kill")
        .args(["-INT", &id])
        .status()
        .expect("`kill` is there");
    assert!(told.success());
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

fn report(out: &Path) -> serde_json::Value {
    let text = fs::read(out.join("report.json")).expect("the run wrote a report");
    serde_json::from_slice(&text).expect("a report is JSON")
}

/// An archive of one array of zeros.
fn write_npz(path: &Path, name: &str, shape: &[usize]) -> io::Result<()> {
    let sizes: Vec<String> = shape.iter().map(ToString::to_string).collect();
    let sizes = sizes.join(", ");
    let mut header = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': ({sizes},), }}");
    // The format wants its data aligned to 64 bytes.
    header.extend(iter::repeat_n(' ', 63 - (header.len() + 10) % 64));
    header.push('\n');
    let count: usize = shape.iter().product();
    let mut archive = ZipWriter::new(File::create(path)?);
    archive.start_file(format!("{name}.npy"), SimpleFileOptions::default())?;
    archive.write_all(b"\x93NUMPY\x01\x00")?;
    archive.write_all(&(header.len() as u16).to_le_bytes())?;
    archive.write_all(header.as_bytes())?;
    archive.write_all(&vec![0; 8 * count])?;
    archive.finish()?;
    Ok(())
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
    for option in ["--poses", "--json"] {
        let demo = [
            "demo",
            "--headless",
            "--seconds",
            "60",
            option,
            "nowhere/x.json",
        ];
        assert_fails(&effigy(here, &demo), DATA, &["nowhere/x.json"]);
    }
    let simulate = ["simulate", "--seconds", "1", "--out", "nowhere/s.mcap"];
    assert_fails(&effigy(here, &simulate), DATA, &["nowhere/s.mcap"]);
}

#[test]
fn a_body_file_with_wrong_shapes_is_refused_by_name_shape_and_expectation() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    write_npz(&here.join("body.npz"), "v_template", &[30, 2]).unwrap();
    let demo = [
        "demo",
        "--headless",
        "--seconds",
        "1",
        "--out",
        "out",
        "--body",
        "body.npz",
    ];
    assert_fails(
        &effigy(here, &demo),
        DATA,
        &["body.npz", "v_template", "[30, 2]"],
    );
}

#[test]
fn frames_without_anybody_are_no_error_and_the_report_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    fs::create_dir(here.join("room")).unwrap();
    // Nothing measured at all, a wall, a wall so near that it is out of range.
    for (number, millimetres) in [0_u16, 2500, 2500, 100].into_iter().enumerate() {
        let depth = ImageBuffer::from_pixel(640, 480, Luma([millimetres]));
        depth.save(here.join(format!("room/{number}.png"))).unwrap();
    }
    let output = effigy(here, &["replay", "room", "--headless", "--out", "out"]);
    assert_succeeds(&output);
    let report = report(&here.join("out"));
    assert_eq!(report["frames"]["in"], 4);
    assert_eq!(report["frames"]["tracked"], 0);
    assert_eq!(report["frames"]["lost"], 4);
    assert!(report["avatar"].is_null());
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(said.contains("nobody was found"), "{said}");
}

#[test]
fn points_that_are_not_numbers_are_holes() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    let (width, height) = (64, 48);
    let head = format!(
        "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH {width}\n\
         HEIGHT {height}\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {}\nDATA ascii\n",
        width * height
    );
    fs::write(
        here.join("nan.pcd"),
        head + &"nan nan nan\n".repeat(width * height),
    )
    .unwrap();
    let output = effigy(here, &["replay", "nan.pcd", "--headless", "--out", "out"]);
    assert_succeeds(&output);
    assert_eq!(report(&here.join("out"))["frames"]["lost"], 1);
}

#[test]
fn an_image_of_another_size_is_an_error_that_names_it() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    fs::create_dir(here.join("room")).unwrap();
    for (number, width) in [640, 320].into_iter().enumerate() {
        let depth = ImageBuffer::from_pixel(width, 480, Luma([2500_u16]));
        depth.save(here.join(format!("room/{number}.png"))).unwrap();
    }
    assert_fails(
        &effigy(here, &["replay", "room", "--headless", "--out", "out"]),
        DATA,
        &["1.png", "320", "640"],
    );
}

#[test]
fn what_is_replayed_is_never_recorded_over() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    simulate(here, "s.mcap", "0.2");
    let before = fs::read(here.join("s.mcap")).unwrap();
    let replay = ["replay", "s.mcap", "--headless", "--record", "./s.mcap"];
    assert_fails(&effigy(here, &replay), DATA, &["s.mcap", "overwrite"]);
    assert!(before == fs::read(here.join("s.mcap")).unwrap());
}

#[test]
fn settings_that_mean_nothing_are_refused_with_what_was_expected() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    for (settings, expected) in [
        ("[fine_tune]\nsteps = 0\n", "at least 1"),
        ("[fine_tune]\ndoubt_m = nan\n", "expected metres"),
        ("[refine]\npasses = 4000000000\n", "at most 8"),
        ("[refine]\npasses = 1\nsteps = 0\n", "1 to 10000"),
        ("[keyframes]\ncount = 0\n", "1 to 64"),
        ("[clean]\nrange_m = [4.0, 0.5]\n", "nearest"),
        ("[clean]\nrang_m = [0.5, 4.0]\n", "rang_m"),
    ] {
        fs::write(here.join("settings.toml"), settings).unwrap();
        let demo = [
            "demo",
            "--headless",
            "--seconds",
            "60",
            "--config",
            "settings.toml",
        ];
        assert_fails(&effigy(here, &demo), DATA, &["settings.toml", expected]);
    }
    let none = ["demo", "--headless", "--keyframes", "0"];
    assert_fails(&effigy(here, &none), USAGE, &["1 to 64"]);
}

#[test]
fn a_reader_who_has_heard_enough_is_no_reason_to_fail() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    simulate(here, "s.mcap", "1");
    let mut run = Command::new(env!("CARGO_BIN_EXE_effigy"))
        .current_dir(here)
        .args(["info", "s.mcap"])
        .stderr(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    drop(run.stdout.take());
    let output = run.wait_with_output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && said.is_empty(), "{said}");
}

#[cfg(unix)]
#[test]
fn ctrl_c_ends_a_run_in_order_even_while_it_waits_for_an_avatar() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    simulate(here, "s.mcap", "4");
    fs::write(here.join("long.toml"), "[fine_tune]\nsteps = 1000000\n").unwrap();
    let mut run = Command::new(env!("CARGO_BIN_EXE_effigy"))
        .current_dir(here)
        .args([
            "replay",
            "s.mcap",
            "--headless",
            "--out",
            "out",
            "--keyframes",
            "2",
        ])
        .args(["--config", "long.toml"])
        .stderr(Stdio::piped())
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    // After the last frame it says what it waits for; until then lines begin with the number of frames.
    let mut said = BufReader::new(run.stderr.take().unwrap()).lines();
    let waits = |line: io::Result<String>| line.unwrap().starts_with("preview live");
    assert!(said.any(waits), "it waits for the avatar");
    press_ctrl_c(&run);
    let last_words: Vec<String> = said.map(Result::unwrap).collect();
    assert!(run.wait().unwrap().success(), "{last_words:?}");
    assert_eq!(report(&here.join("out"))["frames"]["in"], 120);
}

#[test]
fn figures_that_ctrl_c_cut_short_are_printed_and_not_called_whole() {
    let folder = tempfile::tempdir().unwrap();
    let arguments = ["bench", "--quick", "--only", "field,drive,fusion"];
    let run = Command::new(env!("CARGO_BIN_EXE_effigy"))
        .current_dir(folder.path())
        .args(arguments)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // Long enough to have begun, far too short to be done.
    thread::sleep(Duration::from_millis(300));
    press_ctrl_c(&run);
    let output = run.wait_with_output().unwrap();
    assert_fails(&output, STOPPED, &["stopped", "till then"]);
    assert!(String::from_utf8_lossy(&output.stdout).contains("| what | value |"));
}

#[test]
fn a_recording_that_ctrl_c_cut_short_says_how_much_of_it_there_is() {
    let folder = tempfile::tempdir().unwrap();
    let mut run = Command::new(env!("CARGO_BIN_EXE_effigy"))
        .current_dir(folder.path())
        .args(["simulate", "--seconds", "600", "--out", "s.mcap"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // The file is there once frames are written.
    while !folder.path().join("s.mcap").exists() {
        assert!(run.try_wait().unwrap().is_none(), "it ended without a file");
        thread::sleep(Duration::from_millis(20));
    }
    press_ctrl_c(&run);
    let output = run.wait_with_output().unwrap();
    assert_fails(&output, STOPPED, &["s.mcap holds the", "frames till then"]);
    assert_succeeds(&effigy(folder.path(), &["info", "s.mcap"]));
}

#[test]
fn a_scenario_file_is_simulated_and_a_wrong_one_named() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    let simulate = ["simulate", "--scenario", "s.json", "--out", "s.mcap"];
    let scenario =
        r#"{"version": 1, "sensor": "oak", "seconds": 0.2, "rate_hz": 10, "room": "empty"}"#;
    fs::write(here.join("s.json"), scenario).unwrap();
    let output = effigy(here, &simulate);
    assert_succeeds(&output);
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(said.contains("s.mcap: 2 frames"), "{said}");
    fs::write(here.join("s.json"), r#"{"version": 1, "sensr": "oak"}"#).unwrap();
    assert_fails(&effigy(here, &simulate), DATA, &["s.json", "sensr"]);
    let both = [&simulate[..], &["--seed", "3"]].concat();
    assert_fails(&effigy(here, &both), USAGE, &["--seed"]);
}

#[test]
fn a_live_run_that_was_recorded_repeats_itself() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    simulate(here, "s.mcap", "3");
    let live = ["replay", "s.mcap", "--realtime", "--record", "live.mcap"];
    run_quickly(here, &live, "live");
    run_quickly(here, &["replay", "live.mcap"], "again");
    assert!(poses(here, "live") == poses(here, "again"), "poses differ");
    // How many there are depends on how fast this machine is; none at all is possible.
    assert!(
        meshes(here, "live") == meshes(here, "again"),
        "meshes differ"
    );
}

#[test]
fn a_replay_repeats_when_the_avatar_took_over_not_when_it_would_have() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    simulate(here, "s.mcap", "3");
    // Much sooner than a replay does by itself.
    fs::write(
        here.join("soon.toml"),
        QUICK.to_owned() + "[schedule]\nswap_after_frames = 10\n",
    )
    .unwrap();
    let soon = [
        "replay",
        "s.mcap",
        "--record",
        "soon.mcap",
        "--config",
        "soon.toml",
    ];
    run(here, &soon, "soon");
    run_quickly(here, &["replay", "soon.mcap"], "again");
    let first = meshes(here, "soon");
    assert!((1..90).contains(&first.len()), "{} meshes", first.len());
    assert!(first == meshes(here, "again"), "meshes differ");
    assert!(poses(here, "soon") == poses(here, "again"), "poses differ");
}

#[test]
fn smoothing_calms_what_is_driven_not_what_is_tracked_and_a_preview_changes_no_avatar() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    simulate(here, "s.mcap", "3");
    const SOON: &str = "[schedule]\nswap_after_frames = 10\npreview_after_frames = 4\n";
    let smooth = "smooth = { one_euro = { rest_cutoff_hz = 0.1 } }\n";
    let replay = |name: &str, smooth: &str, preview_steps: u32| {
        let config = format!("{smooth}{QUICK}{SOON}[preview]\nsteps = {preview_steps}\n");
        fs::write(here.join("config.toml"), config).unwrap();
        run(here, &["replay", "s.mcap", "--config", "config.toml"], name);
    };
    replay("plain", "", 0);
    replay("smooth", smooth, 0);
    replay("preview", "", 2);
    assert!(
        poses(here, "plain") == poses(here, "smooth"),
        "poses differ"
    );
    let (plain, smooth) = (meshes(here, "plain"), meshes(here, "smooth"));
    assert!(!plain.is_empty() && plain.keys().eq(smooth.keys()));
    assert!(plain != smooth, "smoothing drives nothing");
    let shown = meshes(here, "preview");
    assert!(shown.len() > plain.len(), "a preview is shown before");
    for (name, mesh) in &plain {
        assert!(shown[name] == *mesh, "{name:?} differs after a preview");
    }
}

#[test]
fn keyframes_without_a_point_near_the_body_are_an_error_that_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    simulate(here, "s.mcap", "2");
    let config = format!("{QUICK}[canonicalise]\nmax_distance_to_body_m = 1e-7\n");
    fs::write(here.join("near.toml"), config).unwrap();
    let arguments = ["replay", "s.mcap", "--headless", "--keyframes", "2"];
    let files = ["--config", "near.toml", "--out", "out"];
    let output = effigy(here, &[&arguments[..], &files].concat());
    assert_fails(
        &output,
        DATA,
        &["can be learned from", "too far from the body", "better fit"],
    );
}

#[test]
fn the_papers_protocol_goes_from_a_data_set_to_tables_and_on_from_where_it_stopped() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    let make = ["dataset", "make", "--preset", "small", "--out", "small"];
    assert_succeeds(&effigy(here, &make));
    fs::write(here.join("quick.toml"), "[fine_tune]\nsteps = 2\n").unwrap();
    let evaluate = |tables: &str| {
        let files = ["--json", "rows.json", "--md", "rows.md", "--resume"];
        let what = [
            "evaluate",
            "--data",
            "small",
            "--quick",
            "--config",
            "quick.toml",
        ];
        let arguments = [&what[..], &files, &["--tables", tables]].concat();
        assert_succeeds(&effigy(here, &arguments));
        let text = fs::read(here.join("rows.json")).expect("the run wrote its rows");
        let report: serde_json::Value = serde_json::from_slice(&text).expect("they are JSON");
        report["rows"].as_array().expect("a list").clone()
    };
    let first = evaluate("few-shot");
    let methods = [
        "bare_body",
        "static",
        "occupancy",
        "scanimate",
        "no_meta_learning",
        "oracle",
        "effigy",
    ];
    for method in methods {
        let of: Vec<_> = first.iter().filter(|row| row["method"] == method).collect();
        assert_eq!(of.len(), 2, "{method}: a row for each task");
        // After two steps from nothing there may be no surface at all.
        let from_nothing = ["occupancy", "scanimate", "no_meta_learning"].contains(&method);
        assert!(
            from_nothing || of.iter().all(|row| row["d_f_cm"].is_f64()),
            "{method}"
        );
    }
    let both = evaluate("few-shot,ablation");
    assert_eq!(
        both[..first.len()],
        first[..],
        "what is there is kept, seconds and all"
    );
    let siren = both
        .iter()
        .find(|row| row["method"] == "siren")
        .expect("it was added");
    assert_eq!(
        (&siren["data"], &siren["poses"]),
        (&"4 frames".into(), &"true".into())
    );
    let table = fs::read_to_string(here.join("rows.md")).unwrap();
    assert!(
        table.contains("## ablation") && table.contains("## bars"),
        "{table}"
    );
}

/// Fine-tuning that takes next to no time.
const QUICK: &str = "[fine_tune]\nsteps = 4\n";

fn run_quickly(here: &Path, arguments: &[&str], name: &str) {
    fs::write(here.join("quick.toml"), QUICK).expect("the folder is this test's");
    run(
        here,
        &[arguments, &["--config", "quick.toml"]].concat(),
        name,
    );
}

#[test]
fn bench_measures_every_kernel_and_says_what_ratios_are_of() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let arguments = [
        "bench",
        "--quick",
        "--only",
        "field,drive,fusion",
        "--json",
        "b.json",
        "--keep",
        "kept",
    ];
    let output = effigy(folder.path(), &arguments);
    assert_succeeds(&output);
    let text = fs::read(folder.path().join("b.json")).expect("the figures were written");
    let results: serde_json::Value = serde_json::from_slice(&text).expect("they are JSON");
    let rows = results["rows"].as_array().expect("they have rows");
    assert!(rows.len() > 12, "{} rows", rows.len());
    for row in rows {
        assert!(row["value"].as_f64().expect("a number") > 0.0, "{row}");
        assert!(row["unit"].is_string() && row["name"].is_string(), "{row}");
        assert_eq!(
            row["ratio"].is_null(),
            row["compared_with"].is_null(),
            "{row}"
        );
    }
    for kept in ["depth.png", "grid.f32", "inputs.json"] {
        assert!(folder.path().join("kept").join(kept).exists(), "{kept}");
    }
    assert_fails(
        &effigy(folder.path(), &["bench", "--only", "nothing"]),
        USAGE,
        &["nothing"],
    );
}

/// Two keyframes; poses go to `name.json`, all else into the folder `name`.
fn run(here: &Path, arguments: &[&str], name: &str) {
    let poses = format!("{name}.json");
    let common = ["--headless", "--keyframes", "2", "--out", name];
    let files = ["--poses", &poses, "--meshes", name];
    assert_succeeds(&effigy(here, &[arguments, &common, &files].concat()));
}

fn poses(here: &Path, name: &str) -> Vec<u8> {
    fs::read(here.join(format!("{name}.json"))).expect("the run wrote its poses")
}

fn meshes(here: &Path, name: &str) -> BTreeMap<OsString, Vec<u8>> {
    let files = fs::read_dir(here.join(name)).expect("the run made its folder");
    let paths = files.map(|file| file.expect("it can be listed").path());
    let meshes = paths.filter(|path| path.extension().is_some_and(|ending| ending == "ply"));
    meshes
        .map(|path| {
            let name = path.file_name().expect("it is a file").to_owned();
            (name, fs::read(path).expect("it can be read"))
        })
        .collect()
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
    let frames = report(&here.join("out"))["frames"]["in"].as_u64().unwrap();
    assert!(
        (10..60).contains(&frames),
        "{frames} frames of 60 before the cut"
    );
}

/// A training of a few seconds: tiny networks, a handful of steps.
const TINY_TRAINING: &str = r"
[network]
heads = { low_rank = 4 }
[network.field]
hidden = 16
layers = 3
[reptile]
warm_up_steps = 3
outer_steps = 1
people = 2
inner_steps = 2
[joint]
people = 2
frames = 2
steps = 3
people_per_step = 2
frames_per_person = 1
[adapt]
outer_steps = 1
frames = 2
inner_steps = 2
";

#[test]
fn training_gives_the_same_network_twice_and_says_what_it_needs() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    fs::write(here.join("tiny.toml"), TINY_TRAINING).unwrap();
    for name in ["a", "b"] {
        let (field, prior) = (format!("{name}-sdf.st"), format!("{name}.st"));
        let tiny = ["--config", "tiny.toml"];
        let first = ["train", "sdf", "--out", &field];
        assert_succeeds(&effigy(here, &[&first[..], &tiny].concat()));
        let second = ["train", "hyper", "--start", &field, "--out", &prior];
        assert_succeeds(&effigy(here, &[&second[..], &tiny].concat()));
    }
    // Of a safetensors file what follows the header, whose entries have no fixed order.
    let numbers = |name: &str| {
        let bytes = fs::read(here.join(name)).unwrap();
        let header = u64::from_le_bytes(bytes[..8].try_into().unwrap());
        bytes[8 + usize::try_from(header).unwrap()..].to_vec()
    };
    assert!(numbers("a.st") == numbers("b.st"));
    assert!(here.join("a.joint.svg").exists() && here.join("a.curve.csv").exists());

    // A field of another size, no field at all, and a checkpoint that somebody may still want.
    let with_start = |start| effigy(here, &["train", "hyper", "--start", start, "--out", "c.st"]);
    assert_fails(&with_start("a-sdf.st"), 1, &["a-sdf.st", "--preset"]);
    assert_fails(&with_start("none.st"), 1, &["none.st", "effigy train sdf"]);
    fs::write(here.join("d.checkpoint"), "kept").unwrap();
    let again = effigy(here, &["train", "sdf", "--out", "d.st"]);
    assert_fails(&again, 1, &["d.checkpoint", "--resume"]);
}
