//! Body models from files: `.npz` in SMPL's layout.

use std::path::Path;

use glam::Vec3;

use super::{
    BodyIdentity, BodyModel, JOINT_COUNT, PARENTS, PoseDirection, SparseRow, VertexWeights,
    identity,
    npz::{Array, Npz},
};
use crate::RegistrationError;

/// Three times the vertices of SMPL.
const MOST_VERTICES: usize = 20_000;
const MOST_TRIANGLES: usize = 2 * MOST_VERTICES;
const BETAS: usize = 10;
const POSE_INPUTS: usize = 9 * (JOINT_COUNT - 1);
/// Pose offsets below a hundredth of a millimetre are left out.
const SMALLEST_OFFSET_M: f32 = 1e-5;
/// How far from one the weights of a vertex or the regressor row of a joint may sum.
const SUM_TOLERANCE: f64 = 0.01;

impl BodyModel {
    /// Reads `v_template`, `shapedirs` (the first ten), `posedirs`, `J_regressor` (dense, or as the columns
    /// `J_regressor_data`, `_indices`, `_indptr`), `weights` (cut to each vertex's four largest),
    /// `kintree_table` and `f`.
    pub fn load(path: &Path) -> Result<Self, RegistrationError> {
        let mut file = Npz::open(path)?;
        let template = template(&mut file)?;
        let count = template.len();
        check_tree(&mut file)?;
        let mut body = Self {
            identity: BodyIdentity([0; 16]),
            shape_dirs: shape_dirs(&mut file, count)?,
            pose_dirs: pose_dirs(&mut file, count)?,
            joint_regressor: joint_regressor(&mut file, count)?,
            skinning: skinning(&mut file, count)?,
            triangles: triangles(&mut file, count)?,
            template,
        };
        body.identity = identity::of(&body);
        Ok(body)
    }
}

fn template(file: &mut Npz) -> Result<Vec<Vec3>, RegistrationError> {
    const NAME: &str = "v_template";
    let array = file.shaped(NAME, &[None, Some(3)])?;
    let count = array.shape[0];
    if !(1..=MOST_VERTICES).contains(&count) {
        let expected = format!("1 to {MOST_VERTICES} vertices");
        return Err(file.wrong(NAME, &expected, count.to_string()));
    }
    Ok(array
        .data
        .chunks_exact(3)
        .map(|v| vector(v[0], v[1], v[2]))
        .collect())
}

fn check_tree(file: &mut Npz) -> Result<(), RegistrationError> {
    const NAME: &str = "kintree_table";
    let array = file.shaped(NAME, &[Some(2), Some(JOINT_COUNT)])?;
    for (joint, &expected_parent) in PARENTS.iter().enumerate().skip(1) {
        let (parent, child) = (array.data[joint], array.data[JOINT_COUNT + joint]);
        if parent != expected_parent as f64 || child != joint as f64 {
            let expected = format!("joint {joint} with parent {expected_parent}");
            return Err(file.wrong(
                NAME,
                &expected,
                format!("joint {child} with parent {parent}"),
            ));
        }
    }
    Ok(())
}

fn shape_dirs(file: &mut Npz, count: usize) -> Result<Vec<Vec<Vec3>>, RegistrationError> {
    const NAME: &str = "shapedirs";
    let array = file.shaped(NAME, &[Some(count), Some(3), None])?;
    let betas = array.shape[2];
    if betas < BETAS {
        let expected = format!("at least {BETAS} shapes");
        return Err(file.wrong(NAME, &expected, betas.to_string()));
    }
    let direction = |beta| (0..count).map(|i| direction(&array, i, beta)).collect();
    Ok((0..BETAS).map(direction).collect())
}

fn pose_dirs(file: &mut Npz, count: usize) -> Result<Vec<PoseDirection>, RegistrationError> {
    let array = file.shaped("posedirs", &[Some(count), Some(3), Some(POSE_INPUTS)])?;
    let sparse = |input| {
        let (vertices, offsets) = (0..count)
            .map(|i| (i as u32, direction(&array, i, input)))
            .filter(|(_, offset)| offset.length() >= SMALLEST_OFFSET_M)
            .unzip();
        PoseDirection { vertices, offsets }
    };
    Ok((0..POSE_INPUTS).map(sparse).collect())
}

/// `array[vertex, :, k]` of an array [V, 3, K].
fn direction(array: &Array, vertex: usize, k: usize) -> Vec3 {
    let at = |axis: usize| array.data[(vertex * 3 + axis) * array.shape[2] + k];
    vector(at(0), at(1), at(2))
}

fn joint_regressor(file: &mut Npz, count: usize) -> Result<Vec<SparseRow>, RegistrationError> {
    const NAME: &str = "J_regressor";
    let rows = if file.has(NAME) {
        let array = file.shaped(NAME, &[Some(JOINT_COUNT), Some(count)])?;
        let row = |row: &[f64]| {
            let (indices, weights) = (0..)
                .zip(row)
                .filter(|(_, w)| **w != 0.0)
                .map(|(i, w)| (i, *w as f32))
                .unzip();
            SparseRow { indices, weights }
        };
        array.data.chunks_exact(count).map(row).collect()
    } else if file.has("J_regressor_indptr") {
        sparse_columns(file, count)?
    } else {
        // Names the array that is missing.
        return file.array(NAME).map(|_| Vec::new());
    };
    for (joint, row) in rows.iter().enumerate() {
        let sum: f64 = row.weights.iter().map(|w| f64::from(*w)).sum();
        if (sum - 1.0).abs() > SUM_TOLERANCE {
            let found = format!("joint {joint} with a sum of {sum}");
            return Err(file.wrong(NAME, "rows that sum to one", found));
        }
    }
    Ok(rows)
}

/// The compressed sparse columns of a [24, V] matrix, as `scipy.sparse` names them.
fn sparse_columns(file: &mut Npz, count: usize) -> Result<Vec<SparseRow>, RegistrationError> {
    const INDICES: &str = "J_regressor_indices";
    const STARTS: &str = "J_regressor_indptr";
    let data = file.shaped("J_regressor_data", &[None])?;
    let indices = file.shaped(INDICES, &[Some(data.shape[0])])?;
    let starts = file.shaped(STARTS, &[Some(count + 1)])?;
    let mut rows = vec![SparseRow::default(); JOINT_COUNT];
    for (vertex, span) in starts.data.windows(2).enumerate() {
        let span = span[0] as usize..span[1] as usize;
        if span.start > span.end || span.end > data.data.len() {
            let expected = format!("rising starts up to {}", data.data.len());
            return Err(file.wrong(STARTS, &expected, format!("{span:?} at column {vertex}")));
        }
        for entry in span {
            let Some(row) = rows.get_mut(indices.data[entry] as usize) else {
                let found = format!("{} at entry {entry}", indices.data[entry]);
                return Err(file.wrong(INDICES, "rows below 24", found));
            };
            row.indices.push(vertex as u32);
            row.weights.push(data.data[entry] as f32);
        }
    }
    Ok(rows)
}

fn skinning(file: &mut Npz, count: usize) -> Result<Vec<VertexWeights>, RegistrationError> {
    const NAME: &str = "weights";
    let array = file.shaped(NAME, &[Some(count), Some(JOINT_COUNT)])?;
    let mut rows = Vec::with_capacity(count);
    for (vertex, row) in array.data.chunks_exact(JOINT_COUNT).enumerate() {
        let sum: f64 = row.iter().sum();
        if (sum - 1.0).abs() > SUM_TOLERANCE || row.iter().any(|w| *w < -SUM_TOLERANCE) {
            let found = format!("vertex {vertex} with weights that sum to {sum}");
            return Err(file.wrong(NAME, "shares that sum to one", found));
        }
        rows.push(four_largest(row));
    }
    Ok(rows)
}

fn four_largest(row: &[f64]) -> VertexWeights {
    let mut order: Vec<usize> = (0..row.len()).collect();
    order.sort_by(|&a, &b| row[b].total_cmp(&row[a]).then(a.cmp(&b)));
    let kept: f64 = order[..4].iter().map(|&j| row[j].max(0.0)).sum();
    let mut cut = VertexWeights::default();
    for (slot, &joint) in order[..4].iter().enumerate() {
        cut.bones[slot] = joint as u8;
        cut.weights[slot] = (row[joint].max(0.0) / kept) as f32;
    }
    cut
}

fn triangles(file: &mut Npz, count: usize) -> Result<Vec<[u32; 3]>, RegistrationError> {
    const NAME: &str = "f";
    let array = file.shaped(NAME, &[None, Some(3)])?;
    if !(1..=MOST_TRIANGLES).contains(&array.shape[0]) {
        let expected = format!("1 to {MOST_TRIANGLES} triangles");
        return Err(file.wrong(NAME, &expected, array.shape[0].to_string()));
    }
    let exists = |corner: &f64| (0.0..count as f64).contains(corner) && corner.fract() == 0.0;
    if let Some(place) = array.data.iter().position(|corner| !exists(corner)) {
        let expected = format!("vertex numbers below {count}");
        let found = format!("{} in triangle {}", array.data[place], place / 3);
        return Err(file.wrong(NAME, &expected, found));
    }
    Ok(array
        .data
        .chunks_exact(3)
        .map(|t| [t[0] as u32, t[1] as u32, t[2] as u32])
        .collect())
}

fn vector(x: f64, y: f64, z: f64) -> Vec3 {
    Vec3::new(x as f32, y as f32, z as f32)
}
