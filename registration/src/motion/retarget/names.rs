//! Which joint of a foreign skeleton plays which part.

use crate::smpl::JOINT_COUNT;

/// For each SMPL joint the joint of another skeleton that plays its part, if any.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct JointMap(pub [Option<usize>; JOINT_COUNT]);

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
            "leftfemur",
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
            "lefttibia",
        ],
    ),
    (7, &["leftankle", "leftfoot"]),
    (
        10,
        &[
            "lefttoebase",
            "lefttoe",
            "lefttoe0",
            "lefttoes",
            "leftball",
            "leftfoot",
        ],
    ),
    (
        16,
        &[
            "leftarm",
            "leftupperarm",
            "leftuparm",
            "leftshldr",
            "leftshoulder",
            "lefthumerus",
        ],
    ),
    (
        18,
        &[
            "leftforearm",
            "leftelbow",
            "leftlowerarm",
            "leftlowarm",
            "leftradius",
        ],
    ),
    (20, &["lefthand", "leftwrist", "leftpalm"]),
    (13, &["leftcollar", "leftclavicle", "leftshoulder"]),
    (12, &["neck", "neck1", "lowerneck"]),
    (15, &["head"]),
];

/// Skeletons whose names follow no pattern, normalised.
const ALIASES: &[(&str, &str)] = &[
    // Cesium's sample man.
    ("skeletontorsojoint1", "hips"),
    ("skeletonneckjoint1", "neck"),
    ("skeletonneckjoint2", "head"),
    ("legjointl1", "leftupleg"),
    ("legjointl2", "leftleg"),
    ("legjointl3", "leftankle"),
    ("legjointl5", "lefttoe"),
    ("legjointr1", "rightupleg"),
    ("legjointr2", "rightleg"),
    ("legjointr3", "rightankle"),
    ("legjointr5", "righttoe"),
    ("skeletonarmjointl4", "leftarm"),
    ("skeletonarmjointl3", "leftforearm"),
    ("skeletonarmjointl2", "lefthand"),
    ("skeletonarmjointr", "rightarm"),
    ("skeletonarmjointr2", "rightforearm"),
    ("skeletonarmjointr3", "righthand"),
];

impl JointMap {
    /// Or the first required SMPL joint that nothing plays.
    pub fn find(names: &[&str], parents: &[Option<usize>]) -> Result<Self, usize> {
        let names: Vec<String> = names.iter().map(|name| normalised(name)).collect();
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
        share_spine(parents, &mut map);
        match REQUIRED.iter().find(|&&joint| map[joint].is_none()) {
            Some(&missing) => Err(missing),
            None => Ok(Self(map)),
        }
    }

    /// The names by which a joint may be found, for error messages.
    pub fn known_names(joint: usize) -> String {
        let on_left = NAMES
            .iter()
            .find(|(left, _)| sides(*left).iter().any(|(j, _)| *j == joint));
        on_left.map_or_else(String::new, |(_, names)| names.join(", "))
    }
}

/// A left joint stands for its right twin too, which SMPL numbers next.
fn sides(joint: usize) -> Vec<(usize, &'static str)> {
    match joint {
        0 | 12 | 15 => vec![(joint, "left")],
        _ => vec![(joint, "left"), (joint + 1, "right")],
    }
}

/// Spreads whatever lies between pelvis and neck over SMPL's three spine joints.
fn share_spine(parents: &[Option<usize>], map: &mut [Option<usize>; JOINT_COUNT]) {
    let Some(top) = map[12].or(map[15]).or(map[13]).or(map[16]) else {
        return;
    };
    let mut chain = Vec::new();
    let mut at = parents[top];
    while let Some(joint) = at.filter(|&joint| Some(joint) != map[0]) {
        chain.push(joint);
        at = parents[joint];
    }
    chain.reverse();
    for (k, smpl) in [3, 6, 9].into_iter().enumerate() {
        map[smpl] = chain
            .get(((k + 1) * chain.len()).div_ceil(3).max(1) - 1)
            .copied();
    }
}

/// Lower case, without a file's prefix ("mixamorig:", "Bip01 ", "DEF-"), sides written out in front.
fn normalised(name: &str) -> String {
    let name = name.rsplit(':').next().unwrap_or(name).to_ascii_lowercase();
    let plain: String = name
        .trim_start_matches("bip01")
        .trim_start_matches("def-")
        .trim_start_matches("mixamorig")
        .chars()
        .filter(char::is_ascii_alphanumeric)
        .collect();
    if let Some((_, known)) = ALIASES.iter().find(|(alias, _)| *alias == plain) {
        return (*known).to_owned();
    }
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
