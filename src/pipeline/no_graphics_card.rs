//! In the place of `graphics_card.rs` where the program is built without the feature `gpu`.

use anyhow::bail;
use effigy_avatar::{Driver, LiveDriver, fine_tune::FineTuner};
use effigy_viewer::SnapshotSlot;

use super::clock::Clock;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Purpose {
    Drive,
    Learn,
}

pub(crate) struct GraphicsCard;

pub(crate) struct LentCard;

#[expect(
    clippy::unused_self,
    reason = "one interface with and without the feature"
)]
impl LentCard {
    pub(crate) fn help(&self, _: &mut FineTuner, _: &Clock) {}
}

#[expect(
    clippy::unused_self,
    clippy::unnecessary_wraps,
    reason = "one interface with and without the feature"
)]
impl GraphicsCard {
    pub(crate) fn none() -> Self {
        Self
    }

    pub(crate) fn open(purpose: Purpose, _: Option<&SnapshotSlot>) -> anyhow::Result<Self> {
        let setting = match purpose {
            Purpose::Drive => "drive.device",
            Purpose::Learn => "learn.device",
        };
        bail!("{setting} is \"gpu\", but this program was built without the feature `gpu`")
    }

    pub(crate) fn look_for(_: Purpose, _: Option<&SnapshotSlot>) -> anyhow::Result<Self> {
        Ok(Self)
    }

    #[cfg(test)]
    pub(crate) fn is_none(&self) -> bool {
        true
    }

    pub(crate) fn driver(&mut self, cpu: Driver, _: &Clock) -> LiveDriver {
        LiveDriver::on_cpu(cpu)
    }

    pub(crate) fn lent(&mut self) -> LentCard {
        LentCard
    }

    pub(crate) fn give_up(&mut self) {}

    pub(crate) fn wait_for_borrowers(&self) {}
}
