//! In the place of `graphics_card.rs` where the program is built without the feature `gpu-drive`.

use anyhow::bail;
use effigy_avatar::{Driver, LiveDriver};
use effigy_viewer::SnapshotSlot;

use super::clock::Clock;

pub(crate) struct GraphicsCard;

impl GraphicsCard {
    pub(crate) fn none() -> Self {
        Self
    }

    pub(crate) fn open(_: Option<&SnapshotSlot>) -> anyhow::Result<Self> {
        bail!("drive.device is \"gpu\", but this program was built without the feature `gpu-drive`")
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
    pub(crate) fn driver(&mut self, cpu: Driver, _: &Clock) -> LiveDriver {
        LiveDriver::on_cpu(cpu)
    }
}
