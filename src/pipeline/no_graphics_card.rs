//! In the place of `graphics_card.rs` where the program is built without the feature `gpu`.

use anyhow::bail;
use effigy_avatar::{Driver, LiveDriver, fine_tune::FineTuner};
use effigy_viewer::SnapshotSlot;

use super::clock::Clock;

pub(crate) struct GraphicsCard;

#[derive(Clone)]
pub(crate) struct LentCard;

impl LentCard {
    pub(crate) fn none() -> Self {
        Self
    }

    #[expect(
        clippy::unused_self,
        reason = "one interface with and without the feature"
    )]
    pub(crate) fn help(&self, _: &mut FineTuner, _: &Clock) {}
}

impl GraphicsCard {
    pub(crate) fn none() -> Self {
        Self
    }

    pub(crate) fn open(_: Option<&SnapshotSlot>) -> anyhow::Result<Self> {
        bail!(
            "drive.device or learn.device is \"gpu\", but this program was built without the feature `gpu`"
        )
    }

    #[expect(
        clippy::unnecessary_wraps,
        reason = "one interface with and without the feature"
    )]
    pub(crate) fn look_for(_: Option<&SnapshotSlot>) -> anyhow::Result<Self> {
        Ok(Self)
    }

    #[cfg(test)]
    #[expect(
        clippy::unused_self,
        reason = "one interface with and without the feature"
    )]
    pub(crate) fn is_none(&self) -> bool {
        true
    }

    #[expect(
        clippy::unused_self,
        reason = "one interface with and without the feature"
    )]
    pub(crate) fn driver(&mut self, cpu: Driver, _: bool, _: &Clock) -> LiveDriver {
        LiveDriver::on_cpu(cpu)
    }

    #[expect(
        clippy::unused_self,
        reason = "one interface with and without the feature"
    )]
    pub(crate) fn lent(&mut self, _: bool) -> LentCard {
        LentCard
    }
}
