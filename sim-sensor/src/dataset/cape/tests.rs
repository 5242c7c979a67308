//! A miniature in CAPE's layout, on the built-in body, gives the samples a data set of ours gives.

use std::{
    fs,
    path::Path,
    sync::atomic::{AtomicU32, Ordering},
};

use effigy_fusion::mesh::normals::vertex_normals;
use effigy_registration::smpl::builtin;
use glam::Quat;
use npyz::WriterBuilder as _;

use super::*;
use crate::dataset::{Dataset, Role, Split, archive::Packer};

const FRAMES: u32 = 11;
/// Half a step in each of three directions; weights are rounded, too, and bones stretch steps a little.
const TOLERANCE_M: f32 = 0.6 * STEP_M * 1.74;

/// One subject to learn from, one to test on, one MetaAvatar does not use.
fn release(folder: &Path) {
    for (subject, sequence) in [
        ("00032", "shortlong_hips"),
        ("00122", "shortlong_squats"),
        ("00122", "shortlong_soccer"),
        ("00159", "longlong_hips"),
    ] {
        let body = folder.join("minimal_body_shape").join(subject);
        fs::create_dir_all(&body).unwrap();
        write_npy(
            &body.join(format!("{subject}_minimal.npy")),
            &minimal(subject),
        );
        let frames = folder.join("sequences").join(subject).join(sequence);
        fs::create_dir_all(&frames).unwrap();
        for number in 1..=FRAMES {
            let frame = RawFrame::new(subject, number);
            frame.write(&frames.join(format!("{sequence}.{number:06}.npz")));
        }
    }
    fs::create_dir_all(folder.join("misc")).unwrap();
    let genders = b"(dp0\nV00032\np1\nVmale\np2\nsV00122\np3\nVfemale\np4\ns.";
    fs::write(folder.join("misc/subj_genders.pkl"), genders).unwrap();
}

fn minimal(subject: &str) -> Vec<Vec3> {
    let body = builtin::body();
    let sign = if subject == "00122" { 1.0 } else { -1.0 };
    let mut vertices = body.shaped_vertices(&[sign, 0.5, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    for vertex in &mut vertices {
        // Nobody is exactly what betas say.
        vertex.z += 0.004 * (9.0 * vertex.y).sin();
    }
    vertices
}

/// A frame as CAPE tells it.
struct RawFrame {
    pose: [Vec3; JOINT_COUNT],
    transl: Vec3,
    v_cano: Vec<Vec3>,
    v_posed: Vec<Vec3>,
}

impl RawFrame {
    fn new(subject: &str, number: u32) -> Self {
        let body = builtin::body();
        let share = number as f32 / FRAMES as f32;
        let mut pose = [Vec3::ZERO; JOINT_COUNT];
        pose[0] = Vec3::Y * 0.3 * share;
        pose[1] = Vec3::X * -share;
        pose[4] = Vec3::X * 1.4 * share;
        pose[16] = Vec3::Z * -share;
        let mut v_cano = minimal(subject);
        let joints = body.joints(&v_cano);
        let normals = vertex_normals(&v_cano, &body.triangles);
        for (vertex, normal) in v_cano.iter_mut().zip(&normals) {
            *vertex += *normal * (0.012 + 0.006 * (20.0 * vertex.y + 3.0 * share).sin());
        }
        let transl = Vec3::new(0.1 * share, 0.4, -0.2);
        let mut v_posed = v_cano.clone();
        body.add_pose_correctives(&mut v_posed, &pose);
        let (bones, _) = BoneTransforms::from_pose(&pose, &joints);
        for (vertex, weights) in v_posed.iter_mut().zip(&body.skinning) {
            *vertex = bones.blend(weights).transform_point3(*vertex) + transl;
        }
        Self { pose, transl, v_cano, v_posed }
    }

    fn write(&self, path: &Path) {
        let flat =
            |vectors: &[Vec3]| -> Vec<f32> { vectors.iter().flat_map(Vec3::to_array).collect() };
        let count = self.v_cano.len() as u64;
        let mut zip = Packer::new();
        zip.add("pose", &[72], flat(&self.pose)).unwrap();
        zip.add("transl", &[3], self.transl.to_array()).unwrap();
        zip.add("v_cano", &[count, 3], flat(&self.v_cano)).unwrap();
        zip.add(
            "v_posed",
            &[self.v_posed.len() as u64, 3],
            flat(&self.v_posed),
        )
        .unwrap();
        fs::write(path, zip.finish().unwrap()).unwrap();
    }
}

/// In doubles, as CAPE's are.
fn write_npy(path: &Path, vectors: &[Vec3]) {
    let mut bytes = Vec::new();
    let mut writer = npyz::WriteOptions::new()
        .default_dtype()
        .shape(&[vectors.len() as u64, 3])
        .writer(&mut bytes)
        .begin_nd()
        .unwrap();
    writer
        .extend(vectors.iter().flat_map(|v| v.as_dvec3().to_array()))
        .unwrap();
    writer.finish().unwrap();
    fs::write(path, bytes).unwrap();
}

fn imported(release: &Path, out: &Path) -> Result<Option<Manifest>, SimError> {
    import_cape(
        release,
        &builtin::body(),
        &CapeImport::default(),
        out,
        &|_| true,
    )
}

#[test]
fn cape_gives_the_samples_our_own_data_sets_give() {
    let (raw, out) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    release(raw.path());
    let manifest = imported(raw.path(), out.path()).unwrap().unwrap();
    let parts: Vec<_> = manifest
        .sequences
        .iter()
        .map(|entry| (entry.plan.subject, entry.plan.split, entry.plan.role))
        .collect();
    assert_eq!(
        parts,
        [
            (32, Split::Train, Role::FineTune),
            (122, Split::Test, Role::Extrapolation),
            (122, Split::Test, Role::FineTune),
        ]
    );
    let body = builtin::body();
    let dataset = Dataset::open(out.path(), &body).unwrap();
    let sequence = dataset.load(&manifest.sequences[2]).unwrap();
    let ids: Vec<u64> = sequence.frames.iter().map(|frame| frame.id.0).collect();
    assert_eq!(ids, [1, 6, 11], "every fifth frame");
    let floor_m = (1..=FRAMES)
        .step_by(5)
        .flat_map(|number| RawFrame::new("00122", number).v_posed)
        .map(|point| point.y)
        .fold(f32::INFINITY, f32::min);
    let truth = RawFrame::new("00122", 6);
    let posed = sequence.posed_mesh(1);
    for (found, expected) in posed.vertices.iter().zip(&truth.v_posed) {
        let distance_m = found.distance(*expected - Vec3::Y * floor_m);
        assert!(distance_m < TOLERANCE_M, "{distance_m} m");
    }
    let minimal_body = sequence.minimal_body(&body).unwrap();
    let frame = &sequence.frames[1];
    assert_eq!(frame.theta, truth.pose);
    let naked = minimal_body.posed(&frame.theta, frame.trans);
    // Clothes are 6 to 18 mm thick here; blended bones thin them where joints bend.
    let pairs = naked.vertices.iter().zip(&posed.vertices);
    assert!(
        pairs
            .map(|(a, b)| a.distance(*b))
            .all(|m| (0.001..0.025).contains(&m))
    );
    let (depth, _) = sequence.protocol_depth(1, 0.8);
    assert!(depth.pixels().iter().filter(|&&raw| raw > 0).count() > 2000);
}

/// Bug 9 of the seed paper's code: canonical points in star pose, normals of the zero pose.
#[test]
fn normals_on_the_legs_are_turned_with_the_legs() {
    let (raw, out) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    release(raw.path());
    let manifest = imported(raw.path(), out.path()).unwrap().unwrap();
    let body = builtin::body();
    let dataset = Dataset::open(out.path(), &body).unwrap();
    let sequence = dataset.load(&manifest.sequences[0]).unwrap();
    let star = sequence.star_mesh(1);
    let truth = RawFrame::new("00032", 6);
    let mut at_rest = truth.v_cano.clone();
    body.add_pose_correctives(&mut at_rest, &truth.pose);
    let normals = vertex_normals(&at_rest, &body.triangles);
    let shin = |v: &usize| body.skinning[*v].weights[0] > 0.999 && body.skinning[*v].bones[0] == 4;
    let turn = Quat::from_rotation_z(std::f32::consts::FRAC_PI_4);
    let mut seen = 0;
    for v in (0..normals.len()).filter(shin) {
        // A quarter of a millimetre over edges of a centimetre turns normals by a degree or two.
        assert!(star.normals[v].dot(turn * normals[v]) > 0.995);
        seen += 1;
    }
    assert!(seen > 50, "{seen} vertices on one shin");
}

#[test]
fn only_one_gender_is_taken_if_asked_for() {
    let (raw, out) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    release(&raw.path().join("cape_release"));
    let choice = CapeImport { gender: Some(Gender::Female), ..CapeImport::default() };
    let all = |_: MakeProgress| true;
    let manifest = import_cape(raw.path(), &builtin::body(), &choice, out.path(), &all)
        .unwrap()
        .unwrap();
    assert!(
        manifest
            .sequences
            .iter()
            .all(|entry| entry.plan.subject == 122)
    );
    // The other people into the same folder, or everybody: its manifest would forget these.
    let others = CapeImport { gender: Some(Gender::Male), ..CapeImport::default() };
    let error = import_cape(raw.path(), &builtin::body(), &others, out.path(), &all)
        .unwrap_err()
        .to_string();
    assert!(error.contains("other sequences"), "{error}");
    fs::write(
        raw.path().join("cape_release/misc/subj_genders.pkl"),
        b"garbage",
    )
    .unwrap();
    let error = import_cape(raw.path(), &builtin::body(), &choice, out.path(), &all)
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("subj_genders.pkl") && error.contains("dictionary"),
        "{error}"
    );
}

#[test]
fn an_interrupted_import_goes_on() {
    let (raw, whole, torn) = (
        tempfile::tempdir().unwrap(),
        tempfile::tempdir().unwrap(),
        tempfile::tempdir().unwrap(),
    );
    release(raw.path());
    let expected = imported(raw.path(), whole.path()).unwrap().unwrap();
    let left = AtomicU32::new(5);
    let stop_soon = |_: MakeProgress| left.fetch_sub(1, Ordering::Relaxed) > 1;
    let choice = CapeImport::default();
    let stopped = import_cape(
        raw.path(),
        &builtin::body(),
        &choice,
        torn.path(),
        &stop_soon,
    )
    .unwrap();
    assert!(stopped.is_none());
    assert_eq!(
        imported(raw.path(), torn.path()).unwrap().unwrap(),
        expected
    );
}

#[test]
fn what_is_wrong_with_a_file_is_said_with_its_name() {
    let (raw, out) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let refusal = |release: &Path| imported(release, out.path()).unwrap_err().to_string();
    let error = refusal(raw.path());
    assert!(
        error.contains("sequences") && error.contains("cape_release"),
        "{error}"
    );

    release(raw.path());
    let path = raw
        .path()
        .join("sequences/00122/shortlong_squats/shortlong_squats.000006.npz");
    let said = |file: &str, words: &[&str]| {
        let error = refusal(raw.path());
        assert!(
            error.contains(file) && words.iter().all(|word| error.contains(word)),
            "{error}"
        );
    };
    let whole = fs::read(&path).unwrap();
    fs::write(&path, &whole[..whole.len() / 2]).unwrap();
    said("squats.000006.npz", &["delete"]);
    let frame = RawFrame::new("00122", 6);
    let few = frame.v_posed[..100].to_vec();
    RawFrame { v_posed: few, ..RawFrame::new("00122", 6) }.write(&path);
    said("squats.000006.npz", &["v_posed", "100", "expected shape"]);
    RawFrame { transl: Vec3::NAN, ..RawFrame::new("00122", 6) }.write(&path);
    said("squats.000006.npz", &["transl", "finite"]);
    let pushed = frame
        .v_posed
        .iter()
        .map(|&point| point + Vec3::X * 0.03)
        .collect();
    RawFrame { v_posed: pushed, ..RawFrame::new("00122", 6) }.write(&path);
    said("squats.000006.npz", &["30.0 mm", "gender"]);
    fs::write(&path, whole).unwrap();

    let body = raw
        .path()
        .join("minimal_body_shape/00122/00122_minimal.npy");
    write_npy(&body, &[Vec3::ZERO; 7]);
    said("00122_minimal.npy", &["7", "vertices"]);
    fs::remove_file(&body).unwrap();
    said("00122_minimal.npy", &["No such file"]);
}
