//! Rules no compiler checks: who may depend on whom, and that every file opens with a sentence about itself.

use std::{
    fs,
    path::{Path, PathBuf},
};

/// Each crate, and the crates of ours it may name. A new arrow is a design decision: record it.
const MAY_DEPEND_ON: &[(&str, &[&str])] = &[
    ("capture", &[]),
    ("fusion", &["capture"]),
    ("registration", &["capture", "fusion"]),
    ("sim-sensor", &["capture", "fusion", "registration"]),
    ("avatar", &["capture", "fusion", "registration"]),
    ("viewer", &["capture", "fusion", "registration", "avatar"]),
];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

#[test]
fn crates_depend_only_downstream() {
    for (name, allowed) in MAY_DEPEND_ON {
        let manifest = fs::read_to_string(root().join(name).join("Cargo.toml")).unwrap();
        for line in manifest
            .lines()
            .filter_map(|line| line.strip_prefix("effigy-"))
        {
            let dependency = line.split(['.', ' ', '=']).next().unwrap();
            assert!(
                allowed.contains(&dependency),
                "{name} may not depend on {dependency}"
            );
        }
    }
}

#[test]
fn files_introduce_themselves() {
    let mut silent = Vec::new();
    for name in MAY_DEPEND_ON
        .iter()
        .map(|(name, _)| *name)
        .chain(["src", "tests"])
    {
        visit(&root().join(name), &mut |path, text| {
            if !text.starts_with("//!") {
                silent.push(path.to_path_buf());
            }
        });
    }
    assert!(
        silent.is_empty(),
        "these files do not open with a `//!` sentence: {silent:?}"
    );
}

/// Notes that nobody has who has the sources.
#[test]
fn nothing_leans_on_papers_that_are_not_here() {
    let elsewhere = ["seed-systems", "design.md", "ml-backend.md", "style.md"];
    for (name, _) in MAY_DEPEND_ON {
        visit(&root().join(name), &mut |path, text| {
            for words in elsewhere {
                assert!(!text.contains(words), "{} names {words}", path.display());
            }
        });
    }
}

fn visit(folder: &Path, check: &mut dyn FnMut(&Path, &str)) {
    for entry in fs::read_dir(folder).expect("the folder is part of the workspace") {
        let path = entry.expect("the folder can be listed").path();
        if path.is_dir() {
            visit(&path, check);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            check(&path, &fs::read_to_string(&path).expect("sources are text"));
        }
    }
}
