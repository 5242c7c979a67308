//! Which joint of a foreign skeleton plays which part.

use crate::smpl::JOINT_COUNT;

use super::BvhClip;

/// For each SMPL joint the source joint that plays its part, if any.
pub(super) struct JointMap(pub(super) [Option<usize>; JOINT_COUNT]);

/// Without these there is no motion to speak of; hands, toes and collars may be missing.
const REQUIRED: [usize; 11] = [0, 1, 2, 4, 5, 7, 8, 16, 17, 18, 19];

/// Names for the left side and the middle, best first, normalised. The order of joints matters:
/// "leftshoulder" is an upper arm only where nothing better is, and "leftfoot" an ankle likewise.
const NAMES: &[(usize, &[&str])] = &[
    (0, &["hips", "hip", "pelvis", "root"]),
    (
        1,
        &[
            "leftupleg",
            "leftthigh",
            "leftupperleg",
            "leftbuttock",
            "lefthip",
        ],
    ),
    (
        4,
        &[
            "leftleg",
            "leftknee",
            "leftlowerleg",
            "leftlowleg",
            "leftshin",
            "leftcalf",
        ],
    ),
    (7, &["leftankle", "leftfoot"]),
    (
        10,
        &["lefttoebase", "lefttoe", "lefttoes", "leftball", "leftfoot"],
    ),
    (
        16,
        &[
            "leftarm",
            "leftupperarm",
            "leftuparm",
            "leftshldr",
            "leftshoulder",
        ],
    ),
    (
        18,
        &["leftforearm", "leftelbow", "leftlowerarm", "leftlowarm"],
    ),
    (20, &["lefthand", "leftwrist"]),
    (13, &["leftcollar", "leftclavicle", "leftshoulder"]),
    (12, &["neck", "neck1"]),
    (15, &["head"]),
];

impl JointMap {
    /// Or the first required SMPL joint that nothing plays.
    pub(super) fn find(clip: &BvhClip) -> Result<Self, usize> {
        let names: Vec<String> = clip.joints.iter().map(|j| normalised(&j.name)).collect();
        let mut map = [None; JOINT_COUNT];
        let mut used = vec![false; names.len()];
        for &(joint, candidates) in NAMES {
            for (target, prefix) in sides(joint) {
                let of_side = |name: &&str| name.replacen("left", prefix, 1);
                let found = candidates
                    .iter()
                    .find_map(|name| names.iter().position(|n| *n == of_side(name)))
                    .filter(|&found| !used[found]);
                if let Some(found) = found {
                    map[target] = Some(found);
                    used[found] = true;
                }
            }
        }
        share_spine(clip, &mut map);
        match REQUIRED.iter().find(|&&joint| map[joint].is_none()) {
            Some(&missing) => Err(missing),
            None => Ok(Self(map)),
        }
    }
}

/// The names by which a joint may be found, for error messages.
pub(super) fn known_names(joint: usize) -> String {
    let on_left = NAMES
        .iter()
        .find(|(left, _)| sides(*left).iter().any(|(j, _)| *j == joint));
    on_left.map_or_else(String::new, |(_, names)| names.join(", "))
}

/// A left joint stands for its right twin too, which SMPL numbers next.
fn sides(joint: usize) -> Vec<(usize, &'static str)> {
    match joint {
        0 | 12 | 15 => vec![(joint, "left")],
        _ => vec![(joint, "left"), (joint + 1, "right")],
    }
}

/// Spreads whatever lies between pelvis and neck over SMPL's three spine joints.
fn share_spine(clip: &BvhClip, map: &mut [Option<usize>; JOINT_COUNT]) {
    let Some(top) = map[12].or(map[15]).or(map[13]).or(map[16]) else {
        return;
    };
    let mut chain = Vec::new();
    let mut at = clip.joints[top].parent;
    while let Some(joint) = at.filter(|&joint| Some(joint) != map[0]) {
        chain.push(joint);
        at = clip.joints[joint].parent;
    }
    chain.reverse();
    for (k, smpl) in [3, 6, 9].into_iter().enumerate() {
        map[smpl] = chain
            .get(((k + 1) * chain.len()).div_ceil(3).max(1) - 1)
            .copied();
    }
}

/// Lower case, without a file's prefix ("mixamorig:", "Bip01 "), sides written out in front.
fn normalised(name: &str) -> String {
    let name = name.rsplit(':').next().unwrap_or(name).to_ascii_lowercase();
    let plain: String = name
        .trim_start_matches("bip01")
        .trim_start_matches("mixamorig")
        .chars()
        .filter(char::is_ascii_alphanumeric)
        .collect();
    for (short, long) in [("l", "left"), ("r", "right")] {
        if plain.starts_with(long) {
            return plain;
        }
        // "lShldr", "l_thigh", "LThumb": one letter, then a word that starts a body part.
        if let Some(part) = plain.strip_prefix(short) {
            let is_part = NAMES.iter().any(|(_, names)| {
                names
                    .iter()
                    .any(|known| known.strip_prefix("left") == Some(part))
            });
            if is_part {
                return format!("{long}{part}");
            }
        }
        // "thigh_l", "foot.R".
        if let Some(part) = plain
            .strip_suffix(short)
            .filter(|_| name.len() > plain.len())
        {
            return format!("{long}{part}");
        }
    }
    plain
}
