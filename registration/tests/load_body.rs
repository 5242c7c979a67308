//! Body files in SMPL's `.npz` layout load, and broken ones say what is wrong with them.

use std::{
    fs::File,
    io::Write as _,
    path::{Path, PathBuf},
};

use effigy_registration::{
    RegistrationError,
    smpl::{BodyModel, JOINT_COUNT, PARENTS},
};
use npyz::WriterBuilder as _;
use zip::{ZipWriter, write::SimpleFileOptions};

const VERTICES: usize = 30;

/// A miniature body: arrays by name, in row-major order, with their shapes.
#[derive(Clone)]
struct Arrays(Vec<(&'static str, Vec<u64>, Vec<f64>)>);

#[test]
fn miniature_body_loads_with_its_numbers() {
    let folder = tempfile::tempdir().unwrap();
    let arrays = miniature();
    let body = BodyModel::load(&arrays.write(folder.path())).unwrap();
    assert_eq!(body.vertex_count(), VERTICES);
    assert_eq!(body.shape_dirs.len(), 10);
    assert_eq!(body.template[7].to_array(), [7.0, 0.5, -0.25]);
    // shapedirs[v, a, k] = v + 100 a + k / 10
    assert_eq!(body.shape_dirs[3][2].to_array(), [2.3, 102.3, 202.3]);
    assert_eq!(body.pose_dirs[5].vertices, [4], "one entry is not zero");
    assert_eq!(body.pose_dirs[5].offsets[0].to_array(), [0.0, 0.5, 0.0]);
    assert_eq!(body.joint_regressor[9].indices, [9]);
    assert_eq!(body.triangles[0], [0, 1, 2]);
    // Five weights of 0.3, 0.25, 0.2, 0.15, 0.1: the last is cut, the others share its part.
    assert_eq!(body.skinning[0].bones, [4, 3, 2, 1]);
    assert!((body.skinning[0].weights[0] - 0.3 / 0.9).abs() < 1e-6);
}

#[test]
fn column_major_and_sparse_arrays_mean_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let arrays = miniature();
    let plain = BodyModel::load(&arrays.write(folder.path())).unwrap();
    let columns = BodyModel::load(&arrays.write_as(folder.path(), npyz::Order::Fortran)).unwrap();
    assert_eq!(plain.identity, columns.identity);
    let mut sparse = arrays.without("J_regressor");
    let starts = (0..=VERTICES).map(|v| v.min(JOINT_COUNT) as f64).collect();
    let rows: Vec<f64> = (0..JOINT_COUNT).map(|j| j as f64).collect();
    let count = JOINT_COUNT as u64;
    sparse
        .0
        .push(("J_regressor_data", vec![count], vec![1.0; JOINT_COUNT]));
    sparse.0.push(("J_regressor_indices", vec![count], rows));
    sparse
        .0
        .push(("J_regressor_indptr", vec![VERTICES as u64 + 1], starts));
    let sparse = BodyModel::load(&sparse.write(folder.path())).unwrap();
    assert_eq!(plain.identity, sparse.identity);
}

#[test]
fn identity_changes_with_any_number() {
    let folder = tempfile::tempdir().unwrap();
    let plain = BodyModel::load(&miniature().write(folder.path())).unwrap();
    for array in ["v_template", "shapedirs", "posedirs"] {
        let mut changed = miniature();
        changed.get(array).2[20] += 0.001;
        let changed = BodyModel::load(&changed.write(folder.path())).unwrap();
        assert_ne!(plain.identity, changed.identity, "{array}");
    }
}

#[test]
fn missing_array_is_named() {
    for (array, _, _) in miniature().0 {
        let message = message(&miniature().without(array));
        assert!(message.contains(&format!("{array:?}")), "{message}");
    }
}

#[test]
fn wrong_shape_names_array_expected_and_found() {
    let mut arrays = miniature();
    let posedirs = arrays.get("posedirs");
    *posedirs = ("posedirs", vec![30, 3, 459], vec![0.0; 30 * 3 * 459]);
    let message = message(&arrays);
    for part in ["body.npz", "posedirs", "[30, 3, 207]", "[30, 3, 459]"] {
        assert!(message.contains(part), "{part} is not in: {message}");
    }
}

#[test]
fn not_a_number_is_found_with_its_place() {
    let mut arrays = miniature();
    arrays.get("weights").2[25] = f64::NAN;
    let message = message(&arrays);
    assert!(
        message.contains("weights") && message.contains("NaN at flat index 25"),
        "{message}"
    );
}

#[test]
fn wrong_values_are_refused() {
    let cases: [(&str, usize, f64); 5] = [
        ("kintree_table", 6, 2.0),
        ("f", 4, 30.0),
        ("f", 4, -1.0),
        ("weights", 3, 0.9),
        ("J_regressor", 0, 3.0),
    ];
    for (array, place, value) in cases {
        let mut arrays = miniature();
        arrays.get(array).2[place] = value;
        let message = message(&arrays);
        assert!(message.contains(array), "{message}");
    }
}

#[test]
fn other_files_are_refused_with_a_remedy() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("body.pkl");
    std::fs::write(&path, b"\x80\x02ccopy_reg").unwrap();
    let error = BodyModel::load(&path).unwrap_err();
    assert!(matches!(error, RegistrationError::BodyArchive { .. }));
    assert!(error.to_string().contains("converted"), "{error}");
    let error = BodyModel::load(&folder.path().join("nowhere.npz")).unwrap_err();
    assert!(matches!(error, RegistrationError::Io { .. }));
}

#[test]
fn cut_files_are_refused_without_panic() {
    let folder = tempfile::tempdir().unwrap();
    let path = miniature().write(folder.path());
    let whole = std::fs::read(&path).unwrap();
    for share in 1..16 {
        std::fs::write(&path, &whole[..whole.len() * share / 16]).unwrap();
        assert!(BodyModel::load(&path).is_err());
    }
}

#[test]
fn absurd_headers_do_not_take_memory() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("body.npz");
    let header = "{'descr': '<f8', 'fortran_order': False, 'shape': (4000000000000000, 3), }\n";
    let mut many = b"\x93NUMPY\x01\x00".to_vec();
    many.extend((header.len() as u16).to_le_bytes());
    many.extend(header.bytes());
    let mut long = b"\x93NUMPY\x02\x00".to_vec();
    long.extend(u32::MAX.to_le_bytes());
    for bytes in [many, long] {
        let mut archive = ZipWriter::new(File::create(&path).unwrap());
        archive
            .start_file("v_template.npy", SimpleFileOptions::default())
            .unwrap();
        archive.write_all(&bytes).unwrap();
        archive.finish().unwrap();
        let error = BodyModel::load(&path).unwrap_err();
        assert!(
            matches!(error, RegistrationError::BodyArray { .. }),
            "{error}"
        );
    }
}

fn message(arrays: &Arrays) -> String {
    let folder = tempfile::tempdir().expect("a temporary file");
    BodyModel::load(&arrays.write(folder.path()))
        .expect_err("refused")
        .to_string()
}

fn miniature() -> Arrays {
    let v = VERTICES as u64;
    let template = (0..VERTICES).flat_map(|i| [i as f64, 0.5, -0.25]).collect();
    let shapes = (0..VERTICES)
        .flat_map(|i| (0..3).map(move |a| (i, a)))
        .flat_map(|(i, a)| {
            (0..12).map(move |k| i as f64 + 100.0 * f64::from(a) + f64::from(k) / 10.0)
        })
        .collect();
    let mut poses = vec![0.0; VERTICES * 3 * 207];
    poses[(4 * 3 + 1) * 207 + 5] = 0.5;
    let mut regressor = vec![0.0; JOINT_COUNT * VERTICES];
    let mut weights = vec![0.0; VERTICES * JOINT_COUNT];
    for joint in 0..JOINT_COUNT {
        regressor[joint * VERTICES + joint] = 1.0;
    }
    for row in weights.chunks_exact_mut(JOINT_COUNT) {
        row[..5].copy_from_slice(&[0.1, 0.15, 0.2, 0.25, 0.3]);
    }
    let mut tree: Vec<f64> = PARENTS.iter().map(|&parent| parent as f64).collect();
    tree[0] = f64::from(u32::MAX);
    tree.extend((0..JOINT_COUNT).map(|joint| joint as f64));
    let faces = (0..28)
        .flat_map(|i| [f64::from(i), f64::from(i + 1), f64::from(i + 2)])
        .collect();
    Arrays(vec![
        ("v_template", vec![v, 3], template),
        ("shapedirs", vec![v, 3, 12], shapes),
        ("posedirs", vec![v, 3, 207], poses),
        ("J_regressor", vec![24, v], regressor),
        ("weights", vec![v, 24], weights),
        ("kintree_table", vec![2, 24], tree),
        ("f", vec![28, 3], faces),
    ])
}

impl Arrays {
    fn get(&mut self, array: &str) -> &mut (&'static str, Vec<u64>, Vec<f64>) {
        self.0
            .iter_mut()
            .find(|entry| entry.0 == array)
            .expect("a temporary file")
    }

    fn without(&self, array: &str) -> Self {
        Self(
            self.0
                .iter()
                .filter(|entry| entry.0 != array)
                .cloned()
                .collect(),
        )
    }

    fn write(&self, folder: &Path) -> PathBuf {
        self.write_as(folder, npyz::Order::C)
    }

    fn write_as(&self, folder: &Path, order: npyz::Order) -> PathBuf {
        let path = folder.join("body.npz");
        let mut archive = ZipWriter::new(File::create(&path).expect("a temporary file"));
        for (name, shape, data) in &self.0 {
            archive
                .start_file(format!("{name}.npy"), SimpleFileOptions::default())
                .expect("a temporary file");
            let mut bytes = Vec::new();
            let mut writer = npyz::WriteOptions::new()
                .default_dtype()
                .shape(shape)
                .order(order)
                .writer(&mut bytes)
                .begin_nd()
                .expect("a temporary file");
            writer
                .extend(in_order(data, shape, order))
                .expect("a temporary file");
            writer.finish().expect("a temporary file");
            archive.write_all(&bytes).expect("a temporary file");
        }
        archive.finish().expect("a temporary file");
        path
    }
}

/// Row-major numbers in this order.
fn in_order(data: &[f64], shape: &[u64], order: npyz::Order) -> Vec<f64> {
    if order == npyz::Order::C {
        return data.to_vec();
    }
    let shape: Vec<usize> = shape.iter().map(|&n| n as usize).collect();
    (0..data.len())
        .map(|mut place| {
            let index: Vec<usize> = shape
                .iter()
                .map(|n| {
                    let i = place % n;
                    place /= n;
                    i
                })
                .collect();
            data[index.iter().zip(&shape).fold(0, |at, (i, n)| at * n + i)]
        })
        .collect()
}
