//! The 24 joints of SMPL.

pub const JOINT_COUNT: usize = 24;

/// The parent of each joint; the pelvis has none and names itself.
pub const PARENTS: [usize; JOINT_COUNT] = [
    0, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19, 20, 21,
];

/// Whose vertices MetaAvatar measures: the body without ankles, feet, neck, head, wrists and hands.
pub const MEASURED_JOINTS: [u8; 14] = [0, 1, 2, 3, 4, 5, 6, 9, 13, 14, 16, 17, 18, 19];

#[rustfmt::skip]
pub const JOINT_NAMES: [&str; JOINT_COUNT] = [
    "pelvis", "left_hip", "right_hip", "spine1", "left_knee", "right_knee", "spine2", "left_ankle",
    "right_ankle", "spine3", "left_foot", "right_foot", "neck", "left_collar", "right_collar", "head",
    "left_shoulder", "right_shoulder", "left_elbow", "right_elbow", "left_wrist", "right_wrist",
    "left_hand", "right_hand",
];
