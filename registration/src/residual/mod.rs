//! What a good fit keeps small: one term a file, each with its analytic derivative.
//!
//! A term is made from what was observed and then frozen (matches, targets, active sets), so that within one
//! solver step its cost is a function of the body alone; `checker` holds each to finite differences.

mod depth_push;
mod floor;
mod inside_cloth;
mod joint_limits;
mod legs_apart;
mod point_to_plane;
mod pose_prior;
mod row;
mod shape_prior;
mod silhouette;
mod standing;
mod temporal;

pub(crate) use depth_push::{DepthPush, Push};
pub(crate) use floor::FloorTerm;
pub(crate) use inside_cloth::ClothSide;
pub(crate) use joint_limits::JointLimits;
pub(crate) use legs_apart::{LegContact, LegsApart, leg_contacts};
pub(crate) use point_to_plane::{Match, PointToPlane};
pub(crate) use pose_prior::PosePrior;
pub(crate) use row::{BLOCKS, CostSum, Row, RowSink};
pub(crate) use shape_prior::ShapePrior;
pub(crate) use silhouette::{Pull, Silhouette};
pub(crate) use standing::{Standing, sole_of_lower_foot};
pub(crate) use temporal::{Prediction, Temporal};

use crate::surface::PosedSurface;

/// Part of the energy: emits its residuals for a posed body, each with its derivative where the sink asks for it.
pub(crate) trait Term {
    fn emit(&self, body: &PosedSurface<'_>, sink: &mut dyn RowSink);
}

#[cfg(test)]
pub(crate) mod checker;
