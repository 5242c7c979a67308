//! Arrays in an `.npz` archive, as `NumPy` writes and opens them.

use std::io::{Cursor, Read as _, Write as _};

use effigy_registration::smpl::npz::header_nests;
use glam::Vec3;
use npyz::{AutoSerialize, Deserialize, NpyFile, WriterBuilder as _};
use zip::{ZipArchive, ZipWriter, write::SimpleFileOptions};

/// No array of a sequence is larger: 1,000 frames of 10,000 vertices, two bytes a number, would be half of it.
const LARGEST_ARRAY_BYTES: u64 = 128 << 20;

pub(super) struct Packer(ZipWriter<Cursor<Vec<u8>>>);

impl Packer {
    pub(super) fn new() -> Self {
        Self(ZipWriter::new(Cursor::new(Vec::new())))
    }

    pub(super) fn add<T: AutoSerialize>(
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
        let options = SimpleFileOptions::default()
            .last_modified_time(zip::DateTime::default())
            .compression_level(Some(9));
        self.0
            .start_file(format!("{name}.npy"), options)
            .map_err(|error| error.to_string())?;
        self.0.write_all(&npy).map_err(|error| error.to_string())
    }

    pub(super) fn finish(self) -> Result<Vec<u8>, String> {
        let cursor = self.0.finish().map_err(|error| error.to_string())?;
        Ok(cursor.into_inner())
    }
}

pub(super) struct Unpacker<'a>(ZipArchive<Cursor<&'a [u8]>>);

impl<'a> Unpacker<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Result<Self, String> {
        let archive = ZipArchive::new(Cursor::new(bytes));
        archive
            .map(Self)
            .map_err(|error| format!("no archive of arrays ({error})"))
    }

    pub(super) fn has(&self, name: &str) -> bool {
        self.0.index_for_name(&format!("{name}.npy")).is_some()
    }

    /// An array of numbers; an empty `shape` fits any.
    pub(super) fn array<T: Deserialize>(
        &mut self,
        name: &str,
        shape: &[u64],
    ) -> Result<Vec<T>, String> {
        let (found, values) = self.shaped(name)?;
        if shape.is_empty() || found == shape {
            return Ok(values);
        }
        Err(format!(
            "array {name}: expected shape {shape:?}, found {found:?}"
        ))
    }

    /// An array of numbers and its shape.
    pub(super) fn shaped<T: Deserialize>(
        &mut self,
        name: &str,
    ) -> Result<(Vec<u64>, Vec<T>), String> {
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
        // Versions 2 and 3 declare up to 4 GB of header, which the reader would make room for.
        if bytes.get(6).is_some_and(|&version| version != 1) {
            return Err(wrong("expected version 1 of NumPy's format".to_owned()));
        }
        if header_nests(&bytes) {
            return Err(wrong("its header nests deeper than an array's".to_owned()));
        }
        let file = NpyFile::new(&bytes[..]).map_err(|error| wrong(error.to_string()))?;
        let shape = file.shape().to_vec();
        if file.order() == npyz::Order::Fortran && shape.len() > 1 {
            return Err(wrong("expected rows first, found columns first".to_owned()));
        }
        // What the header says must be there before room is made for it.
        let count = shape.iter().try_fold(1_u64, |all, &n| all.checked_mul(n));
        if count.is_none_or(|count| count > bytes.len() as u64) {
            let length = bytes.len();
            return Err(wrong(format!(
                "shape {shape:?} does not fit into {length} bytes"
            )));
        }
        let values = file.into_vec().map_err(|error| wrong(error.to_string()))?;
        Ok((shape, values))
    }

    /// An array whose last axis is x, y, z; every number finite.
    pub(super) fn vectors(&mut self, name: &str, shape: &[u64]) -> Result<Vec<Vec3>, String> {
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
