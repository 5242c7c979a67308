//! The hash that tells bodies apart.

use bytemuck::cast_slice;
use glam::Vec3;
use sha2::{Digest as _, Sha256};

use super::{BodyIdentity, BodyModel};

/// The first 16 bytes of SHA-256 over every array's length and bits, in the order of `BodyModel`.
pub(super) fn of(body: &BodyModel) -> BodyIdentity {
    let mut hash = Sha256::new();
    let mut add = |bytes: &[u8]| {
        hash.update((bytes.len() as u64).to_le_bytes());
        hash.update(bytes);
    };
    let vectors = |vectors: &[Vec3]| -> Vec<u8> { cast_slice(vectors).to_vec() };
    add(&vectors(&body.template));
    for direction in &body.shape_dirs {
        add(&vectors(direction));
    }
    for direction in &body.pose_dirs {
        add(cast_slice(&direction.vertices));
        add(&vectors(&direction.offsets));
    }
    for row in &body.joint_regressor {
        add(cast_slice(&row.indices));
        add(cast_slice(&row.weights));
    }
    for row in &body.skinning {
        add(&row.bones);
        add(cast_slice(&row.weights));
    }
    add(cast_slice(&body.triangles));
    let digest = hash.finalize();
    BodyIdentity(std::array::from_fn(|i| digest[i]))
}
