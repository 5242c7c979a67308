//! Sequences of schema `effigy.dataset/1`: `mean` [V, 3] in metres, `offset` [F, V, 3] in 16-bit steps from it, weights
//! as floats, `visible` a byte a triangle; no numbers of vertices, no history floors.

use effigy_capture::FrameId;
use effigy_registration::smpl::JOINT_COUNT;
use glam::Vec3;

use super::{
    archive::Unpacker,
    packing::{betas, ids, plan, skinning},
    sequence::{Sequence, SequenceFrame},
};

/// The sequence in an archive, or what is wrong with it.
pub(super) fn unpack(zip: &mut Unpacker<'_>) -> Result<Sequence, String> {
    let plan = plan(zip)?;
    let step = *zip
        .array::<f32>("offset_step_m", &[1])?
        .first()
        .ok_or("offset_step_m is empty")?;
    if !(step > 0.0 && step <= 1.0) {
        return Err(format!(
            "array offset_step_m: expected 0 to 1 m, found {step}"
        ));
    }
    let betas = betas(zip)?;
    let rest_joints = zip.vectors("rest_joints", &[24, 3])?;
    let mean = zip.vectors("mean", &[])?;
    let vertices = mean.len() as u64;
    let bones = zip.array::<u8>("bones", &[vertices, 4])?;
    let weights = zip.array::<f32>("weights", &[vertices, 4])?;
    let layers = zip.array::<u8>("layers", &[vertices])?;
    let triangles = zip.array::<u32>("triangles", &[])?;
    if triangles.len() % 3 != 0 || triangles.iter().any(|&v| u64::from(v) >= vertices) {
        return Err(format!(
            "array triangles: expected triples below {vertices}"
        ));
    }
    let triangle_count = triangles.len() as u64 / 3;
    let ids = ids(zip)?;
    let count = ids.len() as u64;
    let theta = zip.vectors("theta", &[count, 24, 3])?;
    let trans = zip.vectors("trans", &[count, 3])?;
    let params_trans = zip.vectors("params_trans", &[count, 3])?;
    let visible = zip.array::<u8>("visible", &[count, triangle_count])?;
    let offsets = zip.array::<i16>("offset", &[count, vertices, 3])?;
    let frames = ids.iter().enumerate().map(|(f, &id)| {
        let offsets = &offsets[f * mean.len() * 3..][..mean.len() * 3];
        let offsets = offsets
            .chunks_exact(3)
            .map(|o| Vec3::from([o[0], o[1], o[2]].map(f32::from)));
        SequenceFrame {
            id: FrameId(id),
            theta: std::array::from_fn(|joint| theta[f * JOINT_COUNT + joint]),
            trans: trans[f],
            params_trans: params_trans[f],
            star: offsets
                .zip(&mean)
                .map(|(offset, mean)| *mean + offset * step)
                .collect(),
            visible: visible[f * triangle_count as usize..][..triangle_count as usize]
                .iter()
                .map(|&seen| seen != 0)
                .collect(),
        }
    });
    let weights = skinning(&bones, &weights)?;
    Ok(Sequence {
        frames: frames.collect(),
        plan,
        betas,
        rest_joints: std::array::from_fn(|joint| rest_joints[joint]),
        weights,
        layers,
        numbers: (0..vertices as u32).collect(),
        minimal: Vec::new(),
        cloth: None,
        triangles: triangles
            .chunks_exact(3)
            .map(|t| [t[0], t[1], t[2]])
            .collect(),
    })
}
