//! `effigy settings`: everything that `--config` takes.

use anyhow::Context as _;

use crate::{cli::SettingsArgs, pipeline::settings::Settings, say::say};

pub(crate) fn run(args: &SettingsArgs) -> anyhow::Result<()> {
    say!(
        "{}",
        text(&Settings::load(args.config.as_deref())?)?.trim_end()
    );
    Ok(())
}

/// As TOML; what has no default is left out.
fn text(settings: &Settings) -> anyhow::Result<String> {
    toml::to_string(settings).context("settings are plain data")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_printed_is_read_back() {
        let printed = text(&Settings::default()).unwrap();
        let back: Settings = toml::from_str(&printed).unwrap();
        assert_eq!(text(&back).unwrap(), printed);
        for key in ["[fine_tune]", "steps = 150", "[track.energy]", "[drive]"] {
            assert!(printed.contains(key), "{key} is not in {printed}");
        }
    }
}
