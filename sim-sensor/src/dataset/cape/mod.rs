//! Real CAPE (cape.is.tue.mpg.de, under its own licence) as a data set like ours.
//!
//! In: the unpacked `cape_release` and an SMPL body. Out: the sequences MetaAvatar uses, split as it splits them,
//! every fifth frame. One file is read at a time, and one sequence is in memory for each thread.

use std::{collections::BTreeMap, path::Path, sync::Arc};

use effigy_capture::FrameId;
use effigy_registration::{
    BodyModel, RegistrationError,
    smpl::{BoneTransforms, JOINT_COUNT, npz, star_transforms},
};
use glam::Vec3;

use self::layout::{Layout, Recorded};
use super::{
    make::{MakeProgress, Work, make_all},
    manifest::Manifest,
    outfit_name::OutfitName,
    plan::{DatasetPlan, DatasetPreset, STEP_M, SequencePlan},
    sequence::{Sequence, SequenceFrame},
};
use crate::{error::SimError, person::best_betas};

mod genders;
mod layout;
mod splits;
#[cfg(test)]
mod tests;

/// SMPL's models, and those who are scanned.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Gender {
    Female,
    Male,
}

/// What is taken of CAPE.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CapeImport {
    /// One frame in so many; MetaAvatar takes every fifth, and every one to test interpolation.
    pub every: usize,
    /// Only subjects of this gender: SMPL has a body for each. Without it everybody is put on the same body.
    pub gender: Option<Gender>,
}

impl Default for CapeImport {
    fn default() -> Self {
        Self { every: 5, gender: None }
    }
}

/// CAPE's longest sequences have about a thousand frames.
const MOST_FRAMES: usize = 2000;
/// CAPE's posed surfaces are its canonical ones, posed: more than float16's rounding means another body.
const MOST_RESIDUAL_M: f32 = 0.01;

impl Gender {
    pub fn name(self) -> &'static str {
        match self {
            Self::Female => "female",
            Self::Male => "male",
        }
    }
}

/// Imports what is missing of CAPE and writes the manifest; `None` if `go_on` said no. As with [`super::make`], the
/// same command goes on with an interrupted import.
pub fn import_cape(
    folder: &Path,
    body: &Arc<BodyModel>,
    choice: &CapeImport,
    out: &Path,
    go_on: &(dyn Fn(MakeProgress) -> bool + Sync),
) -> Result<Option<Manifest>, SimError> {
    let layout = Layout::find(folder)?;
    let (plan, recorded) = plan(&layout, folder, choice)?;
    let one = |plan: &SequencePlan, next: &mut dyn FnMut() -> bool| {
        let files = &recorded[&plan.name];
        read_sequence(
            plan,
            files,
            &layout.minimal_body(&files.subject),
            body,
            next,
        )
    };
    make_all(
        &Work { plan: &plan, body: body.identity, folder: out, go_on },
        &one,
    )
}

/// The sequences MetaAvatar uses, and their files by name.
fn plan(
    layout: &Layout,
    folder: &Path,
    choice: &CapeImport,
) -> Result<(DatasetPlan, BTreeMap<String, Recorded>), SimError> {
    let mut sequences = Vec::new();
    let mut files = BTreeMap::new();
    let wrong = |problem: String| SimError::Dataset { path: folder.to_owned(), problem };
    for mut recorded in layout.sequences()? {
        let Recorded { subject, outfit, action, .. } = &recorded;
        let Some((split, role)) = splits::part_of(subject, outfit, action) else {
            continue;
        };
        if let Some(gender) = choice.gender
            && !layout.is_of(subject, gender)?
        {
            continue;
        }
        let number: u32 = subject.parse().map_err(|error| {
            wrong(format!(
                "expected subjects by number, found {subject} ({error})"
            ))
        })?;
        let name = format!("{}-{subject}-{outfit}-{action}", split.name());
        let outfit = OutfitName::try_from(outfit.clone()).map_err(wrong)?;
        let action = action.clone();
        recorded.frames = std::mem::take(&mut recorded.frames)
            .into_iter()
            .step_by(choice.every.max(1))
            .collect();
        let frames = recorded.frames.len();
        if !(1..=MOST_FRAMES).contains(&frames) {
            return Err(wrong(format!(
                "expected 1 to {MOST_FRAMES} frames of {name}, found {frames}; unpack it again, or take fewer"
            )));
        }
        sequences.push(SequencePlan {
            name: name.clone(),
            split,
            role,
            subject: number,
            outfit,
            action,
            scenario: None,
            frames: frames as u32,
            generator: 0,
        });
        files.insert(name, recorded);
    }
    if sequences.is_empty() {
        return Err(wrong(
            "expected sequences of MetaAvatar's subjects (`sequences/00032/shortlong_hips/*.npz`), found none".to_owned(),
        ));
    }
    let plan =
        DatasetPlan { preset: DatasetPreset::Cape, seed: 0, offset_step_m: STEP_M, sequences };
    Ok((plan, files))
}

/// Somebody's minimal body and what follows from it.
struct Wearer {
    minimal: Vec<Vec3>,
    betas: [f32; 10],
    rest_joints: [Vec3; JOINT_COUNT],
    /// From the person's own pelvis in zero pose to that of the nearest body model.
    to_params: Vec3,
}

impl Wearer {
    fn read(path: &Path, body: &BodyModel) -> Result<Self, SimError> {
        let array = npz::read_npy(path, "minimal").map_err(in_cape_terms)?;
        let minimal = vectors(&array.data);
        if minimal.len() != body.vertex_count() || array.data.len() % 3 != 0 {
            return Err(SimError::Dataset {
                path: path.to_owned(),
                problem: format!(
                    "expected the body's {} vertices, found shape {:?}; CAPE's bodies are SMPL's (6890 vertices)",
                    body.vertex_count(),
                    array.shape
                ),
            });
        }
        let betas = best_betas(body, &minimal);
        let rest_joints = body.joints(&minimal);
        let pelvis_of_betas = body.joints(&body.shaped_vertices(&betas))[0];
        Ok(Self { minimal, betas, rest_joints, to_params: rest_joints[0] - pelvis_of_betas })
    }
}

fn read_sequence(
    plan: &SequencePlan,
    recorded: &Recorded,
    minimal: &Path,
    body: &BodyModel,
    next: &mut dyn FnMut() -> bool,
) -> Result<Option<Sequence>, SimError> {
    let wearer = Wearer::read(minimal, body)?;
    let mut frames = Vec::with_capacity(recorded.frames.len());
    let mut lowest_m = f32::INFINITY;
    for path in &recorded.frames {
        if !next() {
            return Ok(None);
        }
        let (frame, lowest) = read_frame(path, &wearer, body)?;
        lowest_m = lowest_m.min(lowest);
        frames.push(frame);
    }
    for frame in &mut frames {
        // As everywhere in Effigy, the floor is at y = 0.
        frame.trans.y -= lowest_m;
        frame.params_trans.y -= lowest_m;
    }
    let vertices = body.vertex_count();
    Ok(Some(Sequence {
        plan: plan.clone(),
        betas: wearer.betas,
        rest_joints: wearer.rest_joints,
        weights: body.skinning.clone(),
        layers: vec![0; vertices],
        numbers: (0..vertices as u32).collect(),
        triangles: body.triangles.clone(),
        minimal: wearer.minimal,
        cloth: None,
        frames,
    }))
}

/// A frame and the height of its lowest point.
fn read_frame(
    path: &Path,
    wearer: &Wearer,
    body: &BodyModel,
) -> Result<(SequenceFrame, f32), SimError> {
    let mut file = npz::Npz::open(path).map_err(in_cape_terms)?;
    let mut array = |name, shape: &[Option<usize>]| {
        let array = file.shaped(name, shape).map_err(in_cape_terms)?;
        Ok::<Vec<Vec3>, SimError>(vectors(&array.data))
    };
    let count = body.vertex_count();
    let pose = array("pose", &[Some(3 * JOINT_COUNT)])?;
    let trans = array("transl", &[Some(3)])?[0];
    let mut at_rest = array("v_cano", &[Some(count), Some(3)])?;
    let posed = array("v_posed", &[Some(count), Some(3)])?;
    let theta = std::array::from_fn(|joint| pose[joint]);
    // CAPE keeps canonical surfaces without the pose's correctives, MetaAvatar's shape has them.
    body.add_pose_correctives(&mut at_rest, &theta);
    let bones = BoneTransforms::from_pose(&theta, &wearer.rest_joints).0;
    let skinned = |bones: &BoneTransforms| -> Vec<Vec3> {
        let pairs = at_rest.iter().zip(&body.skinning);
        pairs
            .map(|(&point, weights)| bones.blend(weights).transform_point3(point))
            .collect()
    };
    let squares = skinned(&bones).into_iter().zip(&posed);
    let sum: f32 = squares.map(|(a, b)| (a + trans).distance_squared(*b)).sum();
    let residual_m = (sum / count as f32).sqrt();
    if residual_m > MOST_RESIDUAL_M {
        return Err(SimError::Dataset {
            path: path.to_owned(),
            problem: format!(
                "v_cano posed lies {:.1} mm from v_posed (root mean square), expected less than {:.0}; is the body of \
                 the subject's gender? `--gender` takes only those of one",
                1e3 * residual_m,
                1e3 * MOST_RESIDUAL_M
            ),
        });
    }
    let lowest_m = posed
        .iter()
        .map(|point| point.y)
        .fold(f32::INFINITY, f32::min);
    let frame = SequenceFrame {
        id: FrameId(number_of(path)),
        theta,
        trans,
        params_trans: trans + wearer.to_params,
        star: skinned(&star_transforms(&wearer.rest_joints)),
        visible: vec![true; body.triangles.len()],
    };
    Ok((frame, lowest_m))
}

/// `shortlong_hips.000123.npz` is frame 123.
fn number_of(path: &Path) -> u64 {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let number = stem
        .rsplit('.')
        .next()
        .and_then(|digits| digits.parse().ok());
    number.unwrap_or(0)
}

fn vectors(values: &[f64]) -> Vec<Vec3> {
    let vector = |v: &[f64]| Vec3::new(v[0] as f32, v[1] as f32, v[2] as f32);
    values.chunks_exact(3).map(vector).collect()
}

/// What a reader of bodies says about a frame, in words that fit one.
fn in_cape_terms(error: RegistrationError) -> SimError {
    const ADVICE: &str =
        "unpack it again; a few of CAPE's frames are known to be broken: delete those";
    match error {
        RegistrationError::BodyArray { path, array, expected, found } => SimError::Dataset {
            path,
            problem: format!("array {array}: expected {expected}, found {found}; {ADVICE}"),
        },
        RegistrationError::BodyArrayMissing { path, array, found } => SimError::Dataset {
            path,
            problem: format!("expected array {array}, found only {found:?}; {ADVICE}"),
        },
        RegistrationError::BodyArchive { path, problem } => {
            SimError::Dataset { path, problem: format!("{problem}; {ADVICE}") }
        }
        RegistrationError::Io { path, source } => {
            SimError::Dataset { path, problem: format!("{source}; {ADVICE}") }
        }
        other => SimError::Motion(other),
    }
}
