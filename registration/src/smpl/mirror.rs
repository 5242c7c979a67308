//! The other side of the body.

use std::sync::OnceLock;

use super::{JOINT_COUNT, builtin};

/// For each joint the one on the other side; joints on the midline are their own.
pub const MIRROR_JOINT: [usize; JOINT_COUNT] = [
    0, 2, 1, 3, 5, 4, 6, 8, 7, 9, 11, 10, 12, 14, 13, 15, 17, 16, 19, 18, 21, 20, 23, 22,
];

/// For each vertex of the built-in body the one on the other side; vertices on the midline are their own.
pub fn builtin_vertices() -> &'static [u32] {
    static MIRROR: OnceLock<Vec<u32>> = OnceLock::new();
    MIRROR.get_or_init(builtin::mirror_map)
}
