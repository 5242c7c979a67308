//! In the place of `gpu.rs` where the program is built without the feature `gpu-drive`.

use std::sync::Arc;

use effigy_avatar::Avatar;
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
    eprintln!("effigy: no rows about a graphics card: built without the feature `gpu-drive`");
    Ok(Vec::new())
}
