//! Arrays of numbers out of an `.npz` archive, each checked and bounded before it is believed.

use std::{
    fs::File,
    io::{BufReader, Read as _},
    path::{Path, PathBuf},
};

use npyz::{NpyFile, Order};
use zip::ZipArchive;

use crate::RegistrationError;

/// The largest array that is read: pose directions of 20,000 vertices in doubles take 100 MB.
const LARGEST_ARRAY_BYTES: u64 = 128 << 20;
/// Array headers are about a hundred bytes.
const LARGEST_HEADER_BYTES: usize = 64 << 10;

/// An open archive.
pub struct Npz {
    path: PathBuf,
    archive: ZipArchive<BufReader<File>>,
}

/// A real array in row-major order.
pub struct Array {
    pub shape: Vec<usize>,
    pub data: Vec<f64>,
}

impl Npz {
    pub fn open(path: &Path) -> Result<Self, RegistrationError> {
        let file = File::open(path)
            .map_err(|source| RegistrationError::Io { path: path.to_owned(), source })?;
        let archive = ZipArchive::new(BufReader::new(file)).map_err(|error| {
            RegistrationError::BodyArchive { path: path.to_owned(), problem: error.to_string() }
        })?;
        Ok(Self { path: path.to_owned(), archive })
    }

    pub fn has(&self, array: &str) -> bool {
        self.archive.index_for_name(&file_name(array)).is_some()
    }

    /// The array of this name; every number is finite.
    pub fn array(&mut self, array: &'static str) -> Result<Array, RegistrationError> {
        let bytes = self.bytes(array)?;
        let parsed =
            parse(&bytes).map_err(|found| self.wrong(array, "an array of numbers", found))?;
        if let Some(place) = parsed.data.iter().position(|value| !value.is_finite()) {
            let found = format!("{} at flat index {place}", parsed.data[place]);
            return Err(self.wrong(array, "finite numbers", found));
        }
        Ok(parsed)
    }

    /// As [`Self::array`], of a shape in which `None` stands for any length.
    pub fn shaped(
        &mut self,
        array: &'static str,
        shape: &[Option<usize>],
    ) -> Result<Array, RegistrationError> {
        let parsed = self.array(array)?;
        let fits = parsed.shape.len() == shape.len()
            && parsed
                .shape
                .iter()
                .zip(shape)
                .all(|(n, want)| want.is_none_or(|w| w == *n));
        if fits {
            return Ok(parsed);
        }
        let lengths: Vec<String> = shape
            .iter()
            .map(|n| n.map_or_else(|| "any".to_owned(), |n| n.to_string()))
            .collect();
        let expected = format!("shape [{}]", lengths.join(", "));
        Err(self.wrong(array, &expected, format!("shape {:?}", parsed.shape)))
    }

    pub fn wrong(&self, array: &'static str, expected: &str, found: String) -> RegistrationError {
        let (path, expected) = (self.path.clone(), expected.to_owned());
        RegistrationError::BodyArray { path, array, expected, found }
    }

    fn bytes(&mut self, array: &'static str) -> Result<Vec<u8>, RegistrationError> {
        let Some(index) = self.archive.index_for_name(&file_name(array)) else {
            let found = self
                .archive
                .file_names()
                .take(32)
                .map(str::to_owned)
                .collect();
            return Err(RegistrationError::BodyArrayMissing {
                path: self.path.clone(),
                array,
                found,
            });
        };
        let damaged = |problem: String| RegistrationError::BodyArchive {
            path: self.path.clone(),
            problem: format!("array {array:?}: {problem}"),
        };
        let entry = self
            .archive
            .by_index(index)
            .map_err(|error| damaged(error.to_string()))?;
        let mut bytes = Vec::new();
        // The size an archive declares may lie: what is unpacked is what is counted.
        entry
            .take(LARGEST_ARRAY_BYTES + 1)
            .read_to_end(&mut bytes)
            .map_err(|error| damaged(error.to_string()))?;
        if bytes.len() as u64 > LARGEST_ARRAY_BYTES {
            let found = format!("more than {LARGEST_ARRAY_BYTES} bytes");
            return Err(self.wrong(array, "an array of a body's size", found));
        }
        Ok(bytes)
    }
}

/// The one array of an `.npy` file, under a name for errors; every number is finite.
pub fn read_npy(path: &Path, name: &'static str) -> Result<Array, RegistrationError> {
    let io = |source| RegistrationError::Io { path: path.to_owned(), source };
    let file = File::open(path).map_err(io)?;
    let mut bytes = Vec::new();
    file.take(LARGEST_ARRAY_BYTES)
        .read_to_end(&mut bytes)
        .map_err(io)?;
    let wrong = |expected: &str, found: String| {
        let (path, expected) = (path.to_owned(), expected.to_owned());
        RegistrationError::BodyArray { path, array: name, expected, found }
    };
    let parsed = parse(&bytes).map_err(|found| wrong("an array of numbers", found))?;
    match parsed.data.iter().find(|value| !value.is_finite()) {
        Some(value) => Err(wrong("finite numbers", value.to_string())),
        None => Ok(parsed),
    }
}

fn file_name(array: &str) -> String {
    format!("{array}.npy")
}

/// The array in these bytes, or what is there instead.
fn parse(bytes: &[u8]) -> Result<Array, String> {
    // Versions 2 and 3 declare up to 4 GB of header, which the reader would make room for.
    if bytes.len() >= 12 && bytes[6] >= 2 {
        let declared = u32::from_le_bytes([bytes[8], bytes[9], bytes[10], bytes[11]]) as usize;
        if declared > LARGEST_HEADER_BYTES {
            return Err(format!("a header of {declared} bytes"));
        }
    }
    if header_nests(bytes) {
        return Err("a header that nests deeper than an array's".to_owned());
    }
    let file = NpyFile::new(bytes).map_err(|error| format!("no NumPy array ({error})"))?;
    let lengths: Option<Vec<usize>> = file
        .shape()
        .iter()
        .map(|&n| usize::try_from(n).ok())
        .collect();
    let count = lengths
        .as_ref()
        .and_then(|n| n.iter().try_fold(1, |all: usize, &n| all.checked_mul(n)));
    let (Some(shape), Some(count)) = (lengths, count.filter(|&count| count <= bytes.len())) else {
        return Err(format!("shape {:?} in {} bytes", file.shape(), bytes.len()));
    };
    let order = file.order();
    let kind = file.dtype().descr();
    let data = numbers(file).map_err(|error| format!("{kind} data ({error})"))?;
    if data.len() != count {
        return Err(format!("{} numbers for shape {shape:?}", data.len()));
    }
    let data = if order == Order::Fortran {
        row_major(&data, &shape)
    } else {
        data
    };
    Ok(Array { shape, data })
}

/// Whether an `.npy` file's header has more brackets than the dictionary, the shape and a plain type need: the reader takes
/// time exponential in how deep they nest.
pub fn header_nests(bytes: &[u8]) -> bool {
    const BRACKETS: usize = 8;
    // After the magic number: version, minor version, length (two bytes in version 1, four later), text to a line's end.
    let start = if bytes.get(6) == Some(&1) { 10 } else { 12 };
    let text = bytes.get(start..).unwrap_or_default();
    let text = text.split(|&byte| byte == b'\n').next().unwrap_or_default();
    let opens = |byte: &&u8| matches!(byte, b'[' | b'(' | b'{');
    text.iter().filter(opens).count() > BRACKETS
}

fn numbers(file: NpyFile<&[u8]>) -> Result<Vec<f64>, String> {
    macro_rules! try_as {
        ($file:ident, $($kind:ty),+) => {$(
            let $file = match $file.try_data::<$kind>() {
                Ok(data) => {
                    let values: std::io::Result<Vec<$kind>> = data.collect();
                    let values = values.map_err(|error| error.to_string())?;
                    return Ok(values.into_iter().map(|value| value as f64).collect());
                }
                Err(file) => file,
            };
        )+};
    }
    try_as!(file, f32, i32, u32, i64, u64, u16, i16, u8, i8);
    let data = file.data::<f64>().map_err(|error| error.to_string())?;
    data.collect::<std::io::Result<Vec<f64>>>()
        .map_err(|error| error.to_string())
}

/// Column-major numbers in row-major order.
fn row_major(data: &[f64], shape: &[usize]) -> Vec<f64> {
    let mut index = vec![0; shape.len()];
    let mut out = Vec::with_capacity(data.len());
    for _ in 0..data.len() {
        let at = (0..shape.len())
            .rev()
            .fold(0, |at, axis| at * shape[axis] + index[axis]);
        out.push(data[at]);
        for axis in (0..shape.len()).rev() {
            index[axis] += 1;
            if index[axis] < shape[axis] {
                break;
            }
            index[axis] = 0;
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Version 1 of the format, with this header.
    fn npy(header: &str, data: &[u8]) -> Vec<u8> {
        let length = u16::try_from(header.len() + 1).unwrap();
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend(length.to_le_bytes());
        bytes.extend(header.bytes().chain([b'\n']));
        bytes.extend(data);
        bytes
    }

    #[test]
    fn headers_that_nest_are_not_read() {
        let header = |descr: &str| {
            format!("{{'descr': {descr}, 'fortran_order': False, 'shape': (1, 2), }}")
        };
        let data = [1.0_f32, 2.0].map(f32::to_le_bytes).concat();
        let array = parse(&npy(&header("'<f4'"), &data)).unwrap();
        assert_eq!((array.shape, array.data), (vec![1, 2], vec![1.0, 2.0]));
        // Each level would double the time: this one would take for ever.
        for (open, close) in [("[", "]"), ("(", ",)"), ("{", ":0}")] {
            let nested = format!("{}'<f4'{}", open.repeat(60), close.repeat(60));
            let problem = parse(&npy(&header(&nested), &data)).err().unwrap();
            assert!(problem.contains("nests"), "{problem}");
        }
    }
}
