//! Whom MetaAvatar learns from and whom it tests, action by action (seed paper, appendix F, and its job lists).

use crate::dataset::plan::{Role, Split};

const TRAIN: [&str; 10] = [
    "00032", "00096", "00127", "00145", "02474", "03223", "03284", "03331", "03383", "03394",
];

/// Whose actions are split by trial: the first is fine-tuned on, the second tested.
const BY_TRIAL: [(&str, [&str; 2]); 2] = [
    ("00134", ["longlong", "shortlong"]),
    ("03375", ["blazerlong", "longlong"]),
];

/// Subject, outfit, actions to fine-tune on, actions to test on.
#[rustfmt::skip]
const BY_ACTION: [(&str, &str, &[&str], &[&str]); 6] = [
    ("00122", "shortlong",
     &["ATUsquat", "chicken_wings", "pose_model", "punching", "shoulders_mill", "squats", "tilt_twist_left"],
     &["ballerina_spin", "soccer"]),
    ("00122", "shortshort",
     &["ATUsquat", "basketball", "chicken_wings", "flying_eagle", "hips", "pose_model", "punching", "shoulders_mill",
       "squats", "tilt_twist_left"],
     &["ballerina_spin", "bend_back_and_front", "soccer"]),
    ("00215", "jerseyshort",
     &["ATUsquat", "flying_eagle", "hips", "pose_model", "punching", "shoulders_mill", "squats", "tilt_twist_left"],
     &["basketball", "bend_back_and_front", "soccer"]),
    ("00215", "longshort",
     &["chicken_wings", "pose_model", "punching", "shoulders_mill", "squats"],
     &["bend_back_and_front", "tilt_twist_left"]),
    ("00215", "shortlong",
     &["chicken_wings", "flying_eagle", "hips", "punching", "shoulders_mill", "squats", "tilt_twist_left"],
     &["basketball", "bend_back_and_front", "soccer"]),
    ("00215", "poloshort",
     &["ATUsquat", "flying_eagle", "hips", "pose_model", "punching", "shoulders_mill", "squats", "tilt_twist_left"],
     &["ballerina_spin", "basketball", "bend_back_and_front", "soccer"]),
];

/// What a sequence is for; `None` if MetaAvatar does not use it.
pub(super) fn part_of(subject: &str, outfit: &str, action: &str) -> Option<(Split, Role)> {
    if TRAIN.contains(&subject) {
        return Some((Split::Train, Role::FineTune));
    }
    let by_trial = BY_TRIAL
        .iter()
        .find(|(who, outfits)| *who == subject && outfits.contains(&outfit));
    if by_trial.is_some() {
        let (_, trial) = action.rsplit_once('_')?;
        return match trial {
            "trial1" => Some((Split::Test, Role::FineTune)),
            "trial2" => Some((Split::Test, Role::Extrapolation)),
            _ => None,
        };
    }
    let (.., learned, tested) = BY_ACTION
        .iter()
        .find(|(who, worn, ..)| *who == subject && *worn == outfit)?;
    if learned.contains(&action) {
        Some((Split::Test, Role::FineTune))
    } else if tested.contains(&action) {
        Some((Split::Test, Role::Extrapolation))
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn test_people_are_split_by_action_or_by_trial_and_others_are_left_out() {
        let learned = Some((Split::Test, Role::FineTune));
        let tested = Some((Split::Test, Role::Extrapolation));
        assert_eq!(part_of("00122", "shortlong", "squats"), learned);
        assert_eq!(part_of("00122", "shortlong", "soccer"), tested);
        assert_eq!(part_of("00122", "shortlong", "hips"), None);
        assert_eq!(part_of("00122", "shortshort", "hips"), learned);
        assert_eq!(part_of("03375", "blazerlong", "punching_trial2"), tested);
        assert_eq!(part_of("00134", "longlong", "ATUsquat_trial1"), learned);
        assert_eq!(
            part_of("00159", "longlong", "hips"),
            None,
            "too little data"
        );
        assert_eq!(
            part_of("00032", "shortlong", "hips").unwrap().0,
            Split::Train
        );
    }

    #[test]
    fn nothing_is_both_learned_from_and_tested() {
        for (subject, outfit, learned, tested) in BY_ACTION {
            assert!(!TRAIN.contains(&subject));
            assert!(
                learned.iter().all(|action| !tested.contains(action)),
                "{subject} {outfit}"
            );
        }
    }
}
