//! A sequence as an archive of arrays, and back.
//!
//! `docs/datasets.md` lists the arrays and how Python reads them. What changes from frame to frame is the surface in
//! star pose, in whole steps: the mean of a vertex's lower-numbered neighbours predicts it, and what is left of the
//! frame before predicts what is left.

use effigy_capture::FrameId;
use effigy_registration::smpl::{BodyIdentity, JOINT_COUNT, VertexWeights};
use glam::Vec3;

use super::{
    archive::{Packer, Unpacker},
    coding::{Predictor, differences, from_planes, sums, to_planes},
    earlier,
    plan::SequencePlan,
    sequence::{Sequence, SequenceFrame},
};

/// A surface stays within this many steps of the origin, so that no difference overflows.
const MOST_STEPS: f32 = (1 << 24) as f32;
const WEIGHT_STEPS: f32 = 65535.0;

/// The archive's bytes.
pub(super) fn pack(
    sequence: &Sequence,
    body: BodyIdentity,
    step_m: f32,
) -> Result<Vec<u8>, String> {
    let mut zip = Packer::new();
    let json = |error: serde_json::Error| error.to_string();
    let plan = serde_json::to_vec(&sequence.plan).map_err(json)?;
    let cloth = serde_json::to_vec(&sequence.cloth).map_err(json)?;
    zip.add("plan", &[plan.len() as u64], plan)?;
    zip.add("body", &[16], body.0)?;
    zip.add("cloth", &[cloth.len() as u64], cloth)?;
    add_person(&mut zip, sequence)?;
    add_surface(&mut zip, sequence)?;
    add_frames(&mut zip, sequence)?;
    add_moves(&mut zip, sequence, step_m)?;
    zip.finish()
}

/// The sequence in an archive, of this schema or of the one before, or what is wrong with it.
pub(super) fn unpack(bytes: &[u8]) -> Result<Sequence, String> {
    let mut zip = Unpacker::new(bytes)?;
    if zip.has("offset") {
        return earlier::unpack(&mut zip);
    }
    let zip = &mut zip;
    let plan = plan(zip)?;
    let cloth = serde_json::from_slice(&zip.array::<u8>("cloth", &[])?)
        .map_err(|error| format!("array cloth: {error}"))?;
    let betas = betas(zip)?;
    let rest_joints = zip.vectors("rest_joints", &[24, 3])?;
    let minimal = zip.vectors("minimal", &[])?;
    let layers = zip.array::<u8>("layers", &[])?;
    let vertices = layers.len();
    let bones = zip.array::<u8>("bones", &[vertices as u64, 4])?;
    let weights = zip.array::<u16>("weights", &[vertices as u64, 4])?;
    let weights: Vec<f32> = weights.into_iter().map(f32::from).collect();
    let numbers = read_numbers(zip, vertices)?;
    let triangles = read_triangles(zip, vertices)?;
    let mut frames = read_frames(zip, triangles.len())?;
    read_moves(zip, &triangles, vertices, &mut frames)?;
    Ok(Sequence {
        plan,
        betas,
        rest_joints: std::array::from_fn(|joint| rest_joints[joint]),
        weights: skinning(&bones, &weights)?,
        layers,
        numbers,
        triangles,
        minimal,
        cloth,
        frames,
    })
}

/// The body model that a sequence's person was made on; archives of earlier schemas do not say.
pub(super) fn body_of(bytes: &[u8]) -> Option<BodyIdentity> {
    let identity = Unpacker::new(bytes).ok()?.array::<u8>("body", &[16]).ok()?;
    identity.try_into().ok().map(BodyIdentity)
}

/// What a sequence was made from, without the sequence.
pub(super) fn plan_of(bytes: &[u8]) -> Option<SequencePlan> {
    plan(&mut Unpacker::new(bytes).ok()?).ok()
}

pub(super) fn plan(zip: &mut Unpacker<'_>) -> Result<SequencePlan, String> {
    serde_json::from_slice(&zip.array::<u8>("plan", &[])?)
        .map_err(|error| format!("array plan: {error}"))
}

/// The numbers of the frames, one at least.
pub(super) fn ids(zip: &mut Unpacker<'_>) -> Result<Vec<u64>, String> {
    let ids = zip.array::<u64>("id", &[])?;
    if ids.is_empty() {
        return Err("array id: expected at least one frame".to_owned());
    }
    Ok(ids)
}

/// The person's shape.
pub(super) fn betas(zip: &mut Unpacker<'_>) -> Result<[f32; 10], String> {
    let betas = zip.array::<f32>("betas", &[10])?;
    if betas.iter().any(|beta| !beta.is_finite()) {
        return Err("array betas: expected finite numbers".to_owned());
    }
    Ok(std::array::from_fn(|k| betas[k]))
}

/// Four bones and four weights a vertex; weights of any scale are made to sum to one.
pub(super) fn skinning(bones: &[u8], weights: &[f32]) -> Result<Vec<VertexWeights>, String> {
    if bones.iter().any(|&bone| usize::from(bone) >= JOINT_COUNT) {
        return Err("array bones: expected numbers below 24".to_owned());
    }
    let of_vertices = bones.chunks_exact(4).zip(weights.chunks_exact(4));
    of_vertices
        .map(|(bones, weights)| {
            let sum: f32 = weights.iter().sum();
            if !(sum > 0.0 && sum.is_finite()) || weights.iter().any(|&weight| weight < 0.0) {
                return Err(format!("array weights: expected shares, found {weights:?}"));
            }
            Ok(VertexWeights {
                bones: std::array::from_fn(|k| bones[k]),
                weights: std::array::from_fn(|k| weights[k] / sum),
            })
        })
        .collect()
}

fn add_person(zip: &mut Packer, sequence: &Sequence) -> Result<(), String> {
    zip.add("betas", &[10], sequence.betas)?;
    zip.add("rest_joints", &[24, 3], flat(&sequence.rest_joints))?;
    let minimal = &sequence.minimal;
    zip.add("minimal", &[minimal.len() as u64, 3], flat(minimal))
}

fn add_surface(zip: &mut Packer, sequence: &Sequence) -> Result<(), String> {
    let (v, t) = (
        sequence.weights.len() as u64,
        sequence.triangles.len() as u64,
    );
    let weights = &sequence.weights;
    zip.add("layers", &[v], sequence.layers.iter().copied())?;
    zip.add("bones", &[v, 4], weights.iter().flat_map(|w| w.bones))?;
    let shares = weights.iter().flat_map(|w| w.weights);
    let shares = shares.map(|share| (share * WEIGHT_STEPS).round() as u16);
    zip.add("weights", &[v, 4], shares)?;
    let mut numbers: Vec<i32> = sequence.numbers.iter().map(|&n| n as i32).collect();
    differences(&mut numbers, weights.len());
    add_planes(zip, "numbers", &[v], &numbers)?;
    let corner = |k: usize| sequence.triangles.iter().map(move |t| t[k] as i32);
    let mut corners: Vec<i32> = (0..3).flat_map(corner).collect();
    differences(&mut corners, sequence.triangles.len());
    add_planes(zip, "triangles", &[3, t], &corners)
}

fn add_frames(zip: &mut Packer, sequence: &Sequence) -> Result<(), String> {
    let frames = &sequence.frames;
    let f = frames.len() as u64;
    zip.add("id", &[f], frames.iter().map(|frame| frame.id.0))?;
    let theta = frames.iter().flat_map(|frame| flat(&frame.theta));
    zip.add("theta", &[f, 24, 3], theta)?;
    let trans = frames.iter().flat_map(|frame| frame.trans.to_array());
    zip.add("trans", &[f, 3], trans)?;
    let of_params = frames
        .iter()
        .flat_map(|frame| frame.params_trans.to_array());
    zip.add("params_trans", &[f, 3], of_params)?;
    let bytes = frames.len().div_ceil(8);
    let mut visible = vec![0_u8; sequence.triangles.len() * bytes];
    for (number, frame) in frames.iter().enumerate() {
        for (row, &seen) in visible.chunks_exact_mut(bytes).zip(&frame.visible) {
            row[number / 8] |= u8::from(seen) << (7 - number % 8);
        }
    }
    let shape = [sequence.triangles.len() as u64, bytes as u64];
    zip.add("visible", &shape, visible)
}

fn add_moves(zip: &mut Packer, sequence: &Sequence, step_m: f32) -> Result<(), String> {
    let (vertices, frames) = (sequence.weights.len(), sequence.frames.len());
    let mut steps = vec![0; vertices * 3 * frames];
    for (f, frame) in sequence.frames.iter().enumerate() {
        for (v, place) in frame.star.iter().enumerate() {
            for (axis, metres) in place.to_array().into_iter().enumerate() {
                let rounded = (metres / step_m).round();
                if rounded.is_nan() || rounded.abs() > MOST_STEPS {
                    return Err(format!("vertex {v} of frame {f} lies at {metres} m"));
                }
                steps[(v * 3 + axis) * frames + f] = rounded as i32;
            }
        }
    }
    Predictor::new(&sequence.triangles, vertices).take_away(&mut steps, 3 * frames);
    differences(&mut steps, frames);
    let rows = || steps.chunks_exact(frames.max(1));
    let first: Vec<i32> = rows().map(|row| row[0]).collect();
    let moves: Vec<i32> = rows().flat_map(|row| row[1..].iter().copied()).collect();
    let (v, f) = (vertices as u64, frames as u64);
    zip.add("step_m", &[1], [step_m])?;
    add_planes(zip, "surface", &[v, 3], &first)?;
    add_planes(zip, "moves", &[v, 3, f.saturating_sub(1)], &moves)
}

fn add_planes(zip: &mut Packer, name: &str, shape: &[u64], values: &[i32]) -> Result<(), String> {
    let (planes, bytes) = to_planes(values);
    zip.add(name, &[&[planes as u64], shape].concat(), bytes)
}

/// Numbers in planes; `shape` is that of the numbers.
fn read_planes(zip: &mut Unpacker<'_>, name: &str, shape: &[usize]) -> Result<Vec<i32>, String> {
    let bytes = zip.array::<u8>(name, &[])?;
    let count = shape.iter().try_fold(1_usize, |all, &n| all.checked_mul(n));
    count
        .and_then(|count| from_planes(&bytes, count))
        .ok_or_else(|| {
            let length = bytes.len();
            format!("array {name}: expected bytes for {shape:?} numbers, found {length} bytes")
        })
}

fn read_numbers(zip: &mut Unpacker<'_>, vertices: usize) -> Result<Vec<u32>, String> {
    let mut numbers = read_planes(zip, "numbers", &[vertices])?;
    sums(&mut numbers, vertices);
    Ok(numbers.into_iter().map(|n| n as u32).collect())
}

fn read_triangles(zip: &mut Unpacker<'_>, vertices: usize) -> Result<Vec<[u32; 3]>, String> {
    let (shape, _) = zip.shaped::<u8>("triangles")?;
    let count = shape.last().map_or(0, |&count| count as usize);
    let mut corners = read_planes(zip, "triangles", &[3, count])?;
    sums(&mut corners, count);
    let triangle = |t: usize| [0, 1, 2].map(|k| corners[k * count + t] as u32);
    let triangles: Vec<[u32; 3]> = (0..count).map(triangle).collect();
    if triangles.iter().flatten().any(|&v| v as usize >= vertices) {
        return Err(format!(
            "array triangles: expected numbers below {vertices}"
        ));
    }
    Ok(triangles)
}

/// Frames whose surfaces are still missing.
fn read_frames(zip: &mut Unpacker<'_>, triangles: usize) -> Result<Vec<SequenceFrame>, String> {
    let ids = ids(zip)?;
    let count = ids.len() as u64;
    let theta = zip.vectors("theta", &[count, 24, 3])?;
    let trans = zip.vectors("trans", &[count, 3])?;
    let params_trans = zip.vectors("params_trans", &[count, 3])?;
    let bytes = ids.len().div_ceil(8);
    let visible = zip.array::<u8>("visible", &[triangles as u64, bytes as u64])?;
    let seen = |f: usize| {
        let rows = visible.chunks_exact(bytes);
        rows.map(|row| row[f / 8] >> (7 - f % 8) & 1 == 1).collect()
    };
    let frame = |(f, id): (usize, u64)| SequenceFrame {
        id: FrameId(id),
        theta: std::array::from_fn(|joint| theta[f * JOINT_COUNT + joint]),
        trans: trans[f],
        params_trans: params_trans[f],
        star: Vec::new(),
        visible: seen(f),
    };
    Ok(ids.into_iter().enumerate().map(frame).collect())
}

fn read_moves(
    zip: &mut Unpacker<'_>,
    triangles: &[[u32; 3]],
    vertices: usize,
    frames: &mut [SequenceFrame],
) -> Result<(), String> {
    let count = frames.len();
    let step_m = zip.array::<f32>("step_m", &[1])?[0];
    if !(step_m > 0.0 && step_m <= 1.0) {
        return Err(format!("array step_m: expected 0 to 1 m, found {step_m}"));
    }
    let first = read_planes(zip, "surface", &[vertices, 3])?;
    let later = count.saturating_sub(1);
    let moves = read_planes(zip, "moves", &[vertices, 3, later])?;
    let row = |(r, first): (usize, &i32)| {
        let moves = &moves[r * later..][..later];
        std::iter::once(*first)
            .chain(moves.iter().copied())
            .take(count)
    };
    let mut steps: Vec<i32> = first.iter().enumerate().flat_map(row).collect();
    sums(&mut steps, count);
    Predictor::new(triangles, vertices).add(&mut steps, 3 * count);
    for (f, frame) in frames.iter_mut().enumerate() {
        let metres = |v: usize, axis: usize| steps[(v * 3 + axis) * count + f] as f32 * step_m;
        frame.star = (0..vertices)
            .map(|v| Vec3::from([0, 1, 2].map(|axis| metres(v, axis))))
            .collect();
    }
    Ok(())
}

fn flat(vectors: &[Vec3]) -> Vec<f32> {
    vectors.iter().flat_map(Vec3::to_array).collect()
}
