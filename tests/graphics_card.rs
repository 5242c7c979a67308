//! The program with a graphics card, and asked for one where there is none.

use std::{fs, path::Path, process::Command};

/// Tracking for some frames, an avatar that has hardly learned, and some more frames that drive it.
const SETTINGS: &str = "[fine_tune]\nsteps = 4\n[map]\nmodes = 0\n[preview]\nsteps = 0\n\
    [schedule]\nswap_after_frames = 55\n";

/// Replays what was simulated, driven and learned by `device`; what it said, or what went wrong.
fn replay(here: &Path, device: &str, backend: Option<&str>) -> Result<String, String> {
    let wished = format!("device = \"{device}\"\n");
    let settings = format!("{SETTINGS}[drive]\n{wished}[learn]\n{wished}");
    fs::write(here.join("settings.toml"), settings).expect("the folder is this test's");
    let mut command = Command::new(env!("CARGO_BIN_EXE_effigy"));
    command
        .current_dir(here)
        .args(["replay", "s.mcap", "--headless", "--keyframes", "2"])
        .args(["--config", "settings.toml", "--out", device]);
    if let Some(backend) = backend {
        command.env("WGPU_BACKEND", backend);
    }
    let output = command
        .output()
        .expect("the program was built beside this test");
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!said.contains("panicked"), "{said}");
    if output.status.success() {
        Ok(String::from_utf8_lossy(&output.stdout).into_owned())
    } else {
        Err(said)
    }
}

fn simulate(here: &Path) {
    let output = Command::new(env!("CARGO_BIN_EXE_effigy"))
        .current_dir(here)
        .args(["simulate", "--out", "s.mcap", "--seconds", "3"])
        .args(["--motion", "turn-around"])
        .output()
        .expect("the program was built beside this test");
    assert!(output.status.success());
}

fn report(here: &Path, device: &str) -> serde_json::Value {
    let text = fs::read(here.join(device).join("report.json")).expect("the run wrote a report");
    serde_json::from_slice(&text).expect("a report is JSON")
}

#[test]
fn runs_say_what_drove_and_learned_and_a_card_that_is_not_there_is_missed() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    simulate(here);

    replay(here, "auto", None).unwrap();
    let by_cpu = report(here, "auto");
    assert_eq!(
        (&by_cpu["drive"]["device"], &by_cpu["fine_tune"]["device"]),
        (&"CPU, full field".into(), &"CPU".into()),
        "a replay repeats itself"
    );
    assert!(by_cpu["drive"]["gave_up"].is_null() && by_cpu["fine_tune"]["gave_up"].is_null());

    let elsewhere = if cfg!(windows) { "metal" } else { "dx12" };
    let said = replay(here, "gpu", Some(elsewhere)).unwrap_err();
    println!("{said}");
    assert!(said.contains("drive.device is \"gpu\""), "{said}");

    match replay(here, "gpu", None) {
        Ok(said) => {
            let by_card = report(here, "gpu");
            let (drive, fine_tune) = (&by_card["drive"], &by_card["fine_tune"]);
            let device = drive["device"].as_str().unwrap();
            println!("driven by {device}");
            assert!(!device.starts_with("CPU") && device.ends_with(", full field"));
            assert!(said.contains(device) && drive["gave_up"].is_null());
            let name = device.trim_end_matches(", full field");
            assert_eq!(fine_tune["device"], name);
            assert!(fine_tune["gave_up"].is_null());
            let loss = |of: &serde_json::Value| of["fine_tune"]["loss"].as_f64().unwrap();
            let (ours, twin) = (loss(&by_card), loss(&by_cpu));
            assert!((ours / twin - 1.0).abs() < 1e-2, "{ours} {twin}");
        }
        Err(said) => {
            println!("no graphics card here: {said}");
            assert!(said.contains("drive.device is \"gpu\""), "{said}");
        }
    }
}
