//! In the place of `gpu.rs` where the program is built without the feature `gpu`.

use std::sync::Arc;

use effigy_avatar::{Avatar, fine_tune::FineTuner};
use effigy_registration::BodyParams;

use super::Row;

#[expect(
    clippy::unnecessary_wraps,
    reason = "one interface with and without the feature"
)]
pub(super) fn rows(
    _: &Arc<Avatar>,
    _: impl FnOnce() -> anyhow::Result<Arc<Avatar>>,
    _: &dyn Fn(usize) -> BodyParams,
    _: bool,
) -> anyhow::Result<Vec<Row>> {
    eprintln!("effigy: no rows about a graphics card: built without the feature `gpu`");
    Ok(Vec::new())
}

#[expect(
    clippy::unnecessary_wraps,
    reason = "one interface with and without the feature"
)]
pub(super) fn step_rows(
    _: &str,
    _: &dyn Fn() -> anyhow::Result<FineTuner>,
    _: usize,
) -> anyhow::Result<Vec<Row>> {
    Ok(Vec::new())
}
