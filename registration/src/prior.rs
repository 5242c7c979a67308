//! How people hold and bend their joints: mean, spread and limits of each axis-angle component.
//!
//! Limits are the clinical ranges of motion (Norkin and White, *Measurement of Joint Motion*; AAOS 1965: hip
//! flexion 120, extension 20, abduction 45, rotation 45; knee 0-135; elbow 0-150; shoulder 180; in degrees) put
//! into SMPL's axes and widened by some 10 degrees, because a body model's joints are not anatomical ones.
//! Means and spreads are rounded from everyday standing, walking and reaching; spines and collars share what one
//! anatomical joint does, so each gets little.

use crate::{
    smpl::JOINT_COUNT,
    state::{BodyState, axis_angle},
};

/// One joint's figures, in radians, by axis-angle component.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct JointPrior {
    pub(crate) mean: [f32; 3],
    pub(crate) sigma: [f32; 3],
    pub(crate) min: [f32; 3],
    pub(crate) max: [f32; 3],
}

/// In SMPL joint order; the root has none (its entry is never used).
pub(crate) const JOINT_PRIORS: [JointPrior; JOINT_COUNT] = {
    let mut all = [ROOT; JOINT_COUNT];
    all[1] = HIP;
    all[2] = mirrored(HIP);
    all[3] = SPINE;
    all[4] = KNEE;
    all[5] = mirrored(KNEE);
    all[6] = SPINE;
    all[7] = ANKLE;
    all[8] = mirrored(ANKLE);
    all[9] = SPINE;
    all[10] = FOOT;
    all[11] = mirrored(FOOT);
    all[12] = NECK;
    all[13] = COLLAR;
    all[14] = mirrored(COLLAR);
    all[15] = NECK;
    all[16] = SHOULDER;
    all[17] = mirrored(SHOULDER);
    all[18] = ELBOW;
    all[19] = mirrored(ELBOW);
    all[20] = WRIST;
    all[21] = mirrored(WRIST);
    all[22] = HAND;
    all[23] = mirrored(HAND);
    all
};

const ROOT: JointPrior = symmetric([1.0, 3.0, 1.0], [3.2, 3.2, 3.2]);
const SPINE: JointPrior = symmetric([0.15, 0.12, 0.10], [0.7, 0.5, 0.5]);
const NECK: JointPrior = symmetric([0.15, 0.20, 0.12], [0.8, 0.9, 0.6]);
const FOOT: JointPrior = symmetric([0.08, 0.05, 0.05], [0.5, 0.3, 0.3]);
const HAND: JointPrior = symmetric([0.05, 0.05, 0.08], [0.4, 0.4, 0.6]);
const WRIST: JointPrior = symmetric([0.15, 0.15, 0.2], [0.9, 0.8, 1.3]);
/// Bending the thigh forwards is -x, outwards (left) +z.
const HIP: JointPrior = JointPrior {
    mean: [-0.15, 0.0, 0.05],
    sigma: [0.6, 0.25, 0.2],
    min: [-2.4, -0.9, -0.6],
    max: [0.6, 0.9, 1.0],
};
/// Bending the shin backwards is +x.
const KNEE: JointPrior = JointPrior {
    mean: [0.25, 0.0, 0.0],
    sigma: [0.7, 0.1, 0.06],
    min: [-0.1, -0.4, -0.25],
    max: [2.6, 0.4, 0.25],
};
const ANKLE: JointPrior = JointPrior {
    mean: [0.0, 0.0, 0.0],
    sigma: [0.25, 0.12, 0.12],
    min: [-0.6, -0.5, -0.5],
    max: [0.9, 0.5, 0.5],
};
const COLLAR: JointPrior = JointPrior {
    mean: [0.0, 0.0, -0.05],
    sigma: [0.1, 0.12, 0.15],
    min: [-0.4, -0.5, -0.5],
    max: [0.4, 0.5, 0.8],
};
/// The arm along +x: lowering it is -z, bringing it forwards -y, x is its twist.
const SHOULDER: JointPrior = JointPrior {
    mean: [0.0, -0.2, -0.9],
    sigma: [0.5, 0.6, 0.8],
    min: [-1.9, -2.4, -1.9],
    max: [1.9, 1.2, 1.9],
};
/// Bending the forearm forwards is -y.
const ELBOW: JointPrior = JointPrior {
    mean: [0.0, -0.4, 0.0],
    sigma: [0.3, 0.7, 0.25],
    min: [-1.7, -2.8, -1.2],
    max: [1.7, 0.2, 1.2],
};

/// Half the squared distance of a pose from the means, in standard deviations: how unusual it is.
pub(crate) fn surprise(state: &BodyState) -> f32 {
    let mut sum = 0.0;
    for (joint, prior) in JOINT_PRIORS.iter().enumerate().skip(1) {
        let theta = axis_angle(state.rotations[joint]);
        for axis in 0..3 {
            sum += ((theta[axis] - prior.mean[axis]) / prior.sigma[axis]).powi(2);
        }
    }
    0.5 * sum
}

const fn symmetric(sigma: [f32; 3], limit: [f32; 3]) -> JointPrior {
    JointPrior { mean: [0.0; 3], sigma, min: [-limit[0], -limit[1], -limit[2]], max: limit }
}

/// The other side's joint: a mirror in x = 0 keeps a rotation's x component and turns the sign of y and z.
const fn mirrored(left: JointPrior) -> JointPrior {
    JointPrior {
        mean: [left.mean[0], -left.mean[1], -left.mean[2]],
        sigma: left.sigma,
        min: [left.min[0], -left.max[1], -left.max[2]],
        max: [left.max[0], -left.min[1], -left.min[2]],
    }
}
