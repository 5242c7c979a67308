//! What tracking says about one frame.

use std::sync::Arc;

use effigy_capture::{FrameId, Rigid3, Timestamp};
use effigy_fusion::CleanFrame;

use crate::smpl::BodyParams;

/// The state of the followed body at one frame.
#[derive(Clone, Debug, PartialEq)]
#[expect(
    clippy::large_enum_variant,
    reason = "almost every frame is tracked, and one exists a frame"
)]
pub enum Tracking {
    Tracked {
        params: BodyParams,
        /// Of the inlier depth points to the body's surface, in metres.
        residual_rms_m: f32,
        /// 0 = held by the prior only, 1 = well observed; in SMPL joint order.
        joint_confidence: [f32; 24],
    },
    /// Somebody is in view, but too little of them to fit a whole body.
    Partial {
        since: Timestamp,
    },
    Lost {
        since: Timestamp,
    },
}

/// A clean frame and the body found in it.
#[derive(Clone, Debug)]
pub struct RegisteredFrame {
    pub clean: Arc<CleanFrame>,
    pub world_from_camera: Rigid3,
    pub tracking: Tracking,
}

impl RegisteredFrame {
    pub fn id(&self) -> FrameId {
        self.clean.id
    }

    /// The parameters, where there are any.
    pub fn params(&self) -> Option<&BodyParams> {
        match &self.tracking {
            Tracking::Tracked { params, .. } => Some(params),
            Tracking::Partial { .. } | Tracking::Lost { .. } => None,
        }
    }
}
