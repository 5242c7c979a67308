//! Which depth point lies on which part of the body, and where the body contradicts the picture.

mod contradict;
mod grid;
mod nearest;
mod visibility;

pub(crate) use contradict::{Contradictions, contradictions};
pub(crate) use nearest::{MatchConfig, Matcher};
pub(crate) use visibility::{Agreement, Renderer, Visibility};
