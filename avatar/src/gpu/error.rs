//! Why a graphics card does not drive an avatar, or learn it.

use crate::sdf::SirenConfig;

/// What was refused beforehand, and what went wrong later; either way the processor can do it.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum GpuError {
    #[error("no graphics adapter was found: {why}")]
    NoAdapter { why: String },
    #[error("{adapter} speaks {backend} only; Vulkan, Metal or Direct3D 12 is needed to compute")]
    Backend { adapter: String, backend: String },
    #[error("{adapter} cannot be opened: {why}")]
    NoDevice { adapter: String, why: String },
    #[error("{adapter} allows {allowed} {what}, {needed} are needed")]
    Limit { adapter: String, what: &'static str, needed: u64, allowed: u64 },
    #[error("a field of kind {kind:?} is none that the kernels evaluate")]
    NotASiren { kind: String },
    #[error(
        "a field of {} layers, {} wide, is none that the kernels evaluate: at least 2, and a multiple of 16",
        config.layers,
        config.hidden
    )]
    FieldShape { config: SirenConfig },
    #[error("{adapter} was lost: {why}")]
    Lost { adapter: String, why: String },
    #[error("{adapter} failed: {why}")]
    Failed { adapter: String, why: String },
    #[error("{adapter} did not answer for {secs} s")]
    Silent { adapter: String, secs: u64 },
}
