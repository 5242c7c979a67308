//! One exposure.

use std::sync::Arc;

use crate::{
    image::{ColorImage, DepthImage},
    time::{FrameId, Timestamp},
};

/// One exposure: immutable, cheap to clone.
#[derive(Clone, Debug)]
pub struct Frame {
    pub id: FrameId,
    pub timestamp: Timestamp,
    pub depth: Arc<DepthImage>,
    pub color: Option<Arc<ColorImage>>,
}
