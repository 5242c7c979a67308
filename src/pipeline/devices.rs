//! What poses the avatar and what learns it: the processor, or a graphics card where one is wished for and at hand.

use effigy_avatar::{Driver, LiveDriver};
use effigy_viewer::SnapshotSlot;
use serde::{Deserialize, Serialize};

use super::{
    clock::Clock,
    graphics_card::{GraphicsCard, LentCard, Purpose},
    schedule::Schedule,
};

/// `[drive]` and `[learn]` in the settings: what poses the avatar, and what computes the steps of fine-tuning.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct DeviceSettings {
    pub(crate) device: ComputeOn,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum ComputeOn {
    /// Live, on a graphics card if there is one. What must repeat itself to the last bit stays on the processor, and so
    /// does everything where the processor would have to play the card.
    #[default]
    Auto,
    Cpu,
    /// On whatever adapter there is, in whatever run; an error where there is none.
    Gpu,
}

/// Who wants a graphics card, and what for.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Wishes {
    pub(crate) drive: ComputeOn,
    pub(crate) learn: ComputeOn,
}

/// What avatars are driven with and learned with from now on.
pub(crate) struct Devices {
    drive: GraphicsCard,
    learn: GraphicsCard,
}

impl Devices {
    /// The window's adapter is taken before any other.
    pub(crate) fn choose(
        wishes: Wishes,
        schedule: &Schedule,
        window: Option<&SnapshotSlot>,
    ) -> anyhow::Result<Self> {
        let is_live = matches!(schedule, Schedule::WhenReady);
        let card = |wish, purpose| match wish {
            ComputeOn::Gpu => GraphicsCard::open(purpose, window),
            ComputeOn::Auto if is_live => GraphicsCard::look_for(purpose, window),
            ComputeOn::Auto | ComputeOn::Cpu => Ok(GraphicsCard::none()),
        };
        Ok(Self {
            drive: card(wishes.drive, Purpose::Drive)?,
            learn: card(wishes.learn, Purpose::Learn)?,
        })
    }

    /// `clock` tells whether a card that nobody asked for is worth it.
    pub(crate) fn driver(&mut self, cpu: Driver, clock: &Clock) -> LiveDriver {
        self.drive.driver(cpu, clock)
    }

    /// What an avatar may be learned with; not a card that is still being opened: the next avatar can have it.
    pub(crate) fn card_to_learn_with(&mut self) -> LentCard {
        self.learn.lent()
    }

    /// The card gave up, or was given up: avatars are learned without it from now on.
    pub(crate) fn learn_without_card(&mut self) {
        self.learn.give_up();
    }
}

impl Drop for Devices {
    /// Nobody may be inside a graphics driver when the program ends.
    fn drop(&mut self) {
        self.learn.wait_for_borrowers();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_settings_know_three_devices_and_no_others() {
        let parsed =
            |text: &str| toml::from_str::<DeviceSettings>(text).map(|settings| settings.device);
        assert_eq!(parsed("").unwrap(), ComputeOn::Auto);
        assert_eq!(parsed("device = \"cpu\"").unwrap(), ComputeOn::Cpu);
        assert_eq!(parsed("device = \"gpu\"").unwrap(), ComputeOn::Gpu);
        let error = parsed("device = \"tpu\"").unwrap_err().to_string();
        assert!(error.contains("`auto`, `cpu`, `gpu`"), "{error}");
    }

    #[test]
    fn what_must_repeat_itself_looks_for_no_card() {
        for (wish, schedule) in [
            (ComputeOn::Auto, Schedule::AfterFrames),
            (ComputeOn::Auto, Schedule::AsRecorded([].into())),
            (ComputeOn::Cpu, Schedule::WhenReady),
        ] {
            let wishes = Wishes { drive: wish, learn: wish };
            let devices = Devices::choose(wishes, &schedule, None).unwrap();
            let none = devices.drive.is_none() && devices.learn.is_none();
            assert!(none, "{wish:?}, {schedule:?}");
        }
    }
}
