//! What poses the avatar: the processor, or a graphics card where one is wished for and at hand.

use effigy_avatar::{Driver, LiveDriver};
use effigy_viewer::SnapshotSlot;
use serde::{Deserialize, Serialize};

use super::{clock::Clock, graphics_card::GraphicsCard, schedule::Schedule};

/// `[drive]` in the settings.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct DriveSettings {
    pub(crate) device: DriveOn,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum DriveOn {
    /// Live, on a graphics card if there is one. What must repeat itself to the last bit stays on the processor, and so
    /// does everything where the processor would have to play the card.
    #[default]
    Auto,
    Cpu,
    /// On whatever adapter there is, in whatever run; an error where there is none.
    Gpu,
}

/// What avatars are driven with from now on.
pub(crate) struct DriveDevice {
    card: GraphicsCard,
}

impl DriveDevice {
    /// The window's adapter is taken before any other.
    pub(crate) fn choose(
        wish: DriveOn,
        schedule: &Schedule,
        window: Option<&SnapshotSlot>,
    ) -> anyhow::Result<Self> {
        let is_live = matches!(schedule, Schedule::WhenReady);
        let card = match wish {
            DriveOn::Gpu => GraphicsCard::open(window)?,
            DriveOn::Auto if is_live => GraphicsCard::look_for(window)?,
            DriveOn::Auto | DriveOn::Cpu => GraphicsCard::none(),
        };
        Ok(Self { card })
    }

    /// `clock` tells whether a card that nobody asked for is worth it.
    pub(crate) fn driver(&mut self, cpu: Driver, clock: &Clock) -> LiveDriver {
        self.card.driver(cpu, clock)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_settings_know_three_devices_and_no_others() {
        let parsed = |text: &str| toml::from_str::<DriveSettings>(text).map(|drive| drive.device);
        assert_eq!(parsed("").unwrap(), DriveOn::Auto);
        assert_eq!(parsed("device = \"cpu\"").unwrap(), DriveOn::Cpu);
        assert_eq!(parsed("device = \"gpu\"").unwrap(), DriveOn::Gpu);
        let error = parsed("device = \"tpu\"").unwrap_err().to_string();
        assert!(error.contains("`auto`, `cpu`, `gpu`"), "{error}");
    }

    #[test]
    fn what_must_repeat_itself_looks_for_no_card() {
        for (wish, schedule) in [
            (DriveOn::Auto, Schedule::AfterFrames),
            (DriveOn::Auto, Schedule::AsRecorded([].into())),
            (DriveOn::Cpu, Schedule::WhenReady),
        ] {
            let device = DriveDevice::choose(wish, &schedule, None).unwrap();
            assert!(device.card.is_none(), "{wish:?}, {schedule:?}");
        }
    }
}
