//! A sequence as an `.npz` archive, which `NumPy` opens too.
//!
//! Arrays: `plan` (JSON as bytes), `betas` [10], `rest_joints` [24, 3], `bones` and `weights` [V, 4], `layers` [V],
//! `triangles` [T, 3], `mean` [V, 3] (star pose, metres), and for the F frames `id` [F], `theta` [F, 24, 3], `trans`
//! and `params_trans` [F, 3], `offset` [F, V, 3] (16-bit steps of `offset_step_m` from `mean`) and `visible` [F, T].

use std::io::{Cursor, Read as _, Write as _};

use effigy_capture::FrameId;
use effigy_registration::smpl::{JOINT_COUNT, VertexWeights};
use glam::{DVec3, Vec3};
use npyz::{AutoSerialize, Deserialize, NpyFile, WriterBuilder as _};
use zip::{ZipArchive, ZipWriter, write::SimpleFileOptions};

use super::{
    plan::SequencePlan,
    sequence::{Sequence, SequenceFrame},
};

/// No array of a sequence is larger: 10,000 frames of 10,000 vertices would be.
const LARGEST_ARRAY_BYTES: u64 = 512 << 20;

/// The archive's bytes.
pub(super) fn pack(sequence: &Sequence, offset_step_m: f32) -> Result<Vec<u8>, String> {
    let vertices = sequence.weights.len();
    let mean = mean_surface(sequence);
    let plan = serde_json::to_vec(&sequence.plan).map_err(|error| error.to_string())?;
    let mut zip = Packer::new();
    let (v, t, f) = (
        vertices as u64,
        sequence.triangles.len() as u64,
        sequence.frames.len() as u64,
    );
    let frames = &sequence.frames;
    zip.add("plan", &[plan.len() as u64], plan)?;
    zip.add("offset_step_m", &[1], [offset_step_m])?;
    zip.add("betas", &[10], sequence.betas)?;
    zip.add("rest_joints", &[24, 3], flat(&sequence.rest_joints))?;
    zip.add(
        "bones",
        &[v, 4],
        sequence.weights.iter().flat_map(|w| w.bones),
    )?;
    zip.add(
        "weights",
        &[v, 4],
        sequence.weights.iter().flat_map(|w| w.weights),
    )?;
    zip.add("layers", &[v], sequence.layers.iter().copied())?;
    zip.add(
        "triangles",
        &[t, 3],
        sequence.triangles.iter().flatten().copied(),
    )?;
    zip.add("mean", &[v, 3], flat(&mean))?;
    zip.add("id", &[f], frames.iter().map(|frame| frame.id.0))?;
    zip.add(
        "theta",
        &[f, 24, 3],
        frames.iter().flat_map(|frame| flat(&frame.theta)),
    )?;
    zip.add(
        "trans",
        &[f, 3],
        frames.iter().flat_map(|frame| frame.trans.to_array()),
    )?;
    let params_trans = frames
        .iter()
        .flat_map(|frame| frame.params_trans.to_array());
    zip.add("params_trans", &[f, 3], params_trans)?;
    let visible = frames.iter().flat_map(|frame| &frame.visible);
    zip.add("visible", &[f, t], visible.map(|&seen| u8::from(seen)))?;
    let mut offsets = Vec::with_capacity(frames.len() * vertices * 3);
    for (star, mean) in frames.iter().flat_map(|frame| frame.star.iter().zip(&mean)) {
        let steps = ((*star - *mean) / offset_step_m).round();
        let largest = f32::from(i16::MAX);
        if steps.is_nan() || steps.abs().max_element() > largest {
            return Err(format!(
                "a vertex moves by {} m in star pose",
                star.distance(*mean)
            ));
        }
        offsets.extend(steps.to_array().map(|step| step as i16));
    }
    zip.add("offset", &[f, v, 3], offsets)?;
    zip.finish()
}

/// The sequence in an archive, or what is wrong with it.
pub(super) fn unpack(bytes: &[u8]) -> Result<Sequence, String> {
    let mut zip = Unpacker::new(bytes)?;
    let plan: SequencePlan = serde_json::from_slice(&zip.array::<u8>("plan", &[])?)
        .map_err(|error| format!("array plan: {error}"))?;
    let step = *zip
        .array::<f32>("offset_step_m", &[1])?
        .first()
        .ok_or("offset_step_m is empty")?;
    let betas = zip.array::<f32>("betas", &[10])?;
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
    if bones.iter().any(|&bone| usize::from(bone) >= JOINT_COUNT) {
        return Err("array bones: expected numbers below 24".to_owned());
    }
    let triangle_count = triangles.len() as u64 / 3;
    let ids = zip.array::<u64>("id", &[])?;
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
    let weights = bones
        .chunks_exact(4)
        .zip(weights.chunks_exact(4))
        .map(|(bones, weights)| VertexWeights {
            bones: std::array::from_fn(|k| bones[k]),
            weights: std::array::from_fn(|k| weights[k]),
        });
    Ok(Sequence {
        frames: frames.collect(),
        plan,
        betas: std::array::from_fn(|k| betas[k]),
        rest_joints: std::array::from_fn(|joint| rest_joints[joint]),
        weights: weights.collect(),
        layers,
        triangles: triangles
            .chunks_exact(3)
            .map(|t| [t[0], t[1], t[2]])
            .collect(),
    })
}

/// Each vertex's mean place over the frames.
fn mean_surface(sequence: &Sequence) -> Vec<Vec3> {
    let count = sequence.frames.len().max(1) as f64;
    (0..sequence.weights.len())
        .map(|v| {
            let sum: DVec3 = sequence
                .frames
                .iter()
                .map(|frame| frame.star[v].as_dvec3())
                .sum();
            (sum / count).as_vec3()
        })
        .collect()
}

fn flat(vectors: &[Vec3]) -> Vec<f32> {
    vectors.iter().flat_map(Vec3::to_array).collect()
}

struct Packer(ZipWriter<Cursor<Vec<u8>>>);

impl Packer {
    fn new() -> Self {
        Self(ZipWriter::new(Cursor::new(Vec::new())))
    }

    fn add<T: AutoSerialize>(
        &mut self,
        name: &str,
        shape: &[u64],
        values: impl IntoIterator<Item = T>,
    ) -> Result<(), String> {
        let mut npy = Vec::new();
        let mut writer = npyz::WriteOptions::new()
            .default_dtype()
            .shape(shape)
            .writer(&mut npy)
            .begin_nd()
            .map_err(|error| error.to_string())?;
        writer.extend(values).map_err(|error| error.to_string())?;
        writer.finish().map_err(|error| error.to_string())?;
        // One date for all: the same sequence gives the same bytes.
        let options = SimpleFileOptions::default().last_modified_time(zip::DateTime::default());
        self.0
            .start_file(format!("{name}.npy"), options)
            .map_err(|error| error.to_string())?;
        self.0.write_all(&npy).map_err(|error| error.to_string())
    }

    fn finish(self) -> Result<Vec<u8>, String> {
        let cursor = self.0.finish().map_err(|error| error.to_string())?;
        Ok(cursor.into_inner())
    }
}

struct Unpacker<'a>(ZipArchive<Cursor<&'a [u8]>>);

impl<'a> Unpacker<'a> {
    fn new(bytes: &'a [u8]) -> Result<Self, String> {
        let archive = ZipArchive::new(Cursor::new(bytes));
        archive
            .map(Self)
            .map_err(|error| format!("no archive of arrays ({error})"))
    }

    /// An array of numbers; an empty `shape` fits any.
    fn array<T: Deserialize>(&mut self, name: &str, shape: &[u64]) -> Result<Vec<T>, String> {
        let wrong = |problem: String| format!("array {name}: {problem}");
        let entry = self
            .0
            .by_name(&format!("{name}.npy"))
            .map_err(|e| wrong(e.to_string()))?;
        let mut bytes = Vec::new();
        entry
            .take(LARGEST_ARRAY_BYTES + 1)
            .read_to_end(&mut bytes)
            .map_err(|error| wrong(error.to_string()))?;
        if bytes.len() as u64 > LARGEST_ARRAY_BYTES {
            return Err(wrong(format!(
                "expected at most {LARGEST_ARRAY_BYTES} bytes, found more"
            )));
        }
        let file = NpyFile::new(&bytes[..]).map_err(|error| wrong(error.to_string()))?;
        let found = file.shape().to_vec();
        let count = found.iter().try_fold(1_u64, |all, &n| all.checked_mul(n));
        let fits = shape.is_empty() || found == shape;
        if !fits || count.is_none_or(|count| count > bytes.len() as u64) {
            return Err(wrong(format!("expected shape {shape:?}, found {found:?}")));
        }
        file.into_vec().map_err(|error| wrong(error.to_string()))
    }

    /// An array whose last axis is x, y, z; every number finite.
    fn vectors(&mut self, name: &str, shape: &[u64]) -> Result<Vec<Vec3>, String> {
        let values = self.array::<f32>(name, shape)?;
        if values.len() % 3 != 0 || values.iter().any(|value| !value.is_finite()) {
            return Err(format!("array {name}: expected triples of finite numbers"));
        }
        Ok(values
            .chunks_exact(3)
            .map(|v| Vec3::new(v[0], v[1], v[2]))
            .collect())
    }
}
