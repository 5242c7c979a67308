//! `effigy train`: how the shipped prior is made.

use crate::cli::TrainArgs;

pub(crate) fn run(_args: &TrainArgs) -> anyhow::Result<()> {
    anyhow::bail!("not yet")
}
