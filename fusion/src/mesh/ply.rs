//! PLY 1.0 files, ASCII and binary little-endian: positions, normals, 8-bit colours, polygons.
//!
//! Other elements and properties are skipped. Memory stays within a few times the file's size, whatever
//! its header claims.

use std::{fmt::Write as _, fs, path::Path};

use glam::Vec3;

use super::TriangleMesh;
use crate::error::FusionError;

/// Larger files are refused: a mesh of this many bytes is not one of ours.
const MAX_BYTES: u64 = 2 << 30;
/// Corners a polygon may have; real files have 3 or 4.
const MAX_CORNERS: f64 = 1024.0;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Encoding {
    Ascii,
    BinaryLittleEndian,
}

/// Reads a file; polygons come as fans of triangles.
pub fn read(path: &Path) -> Result<TriangleMesh, FusionError> {
    let io = |source| FusionError::Io { path: path.to_path_buf(), source };
    let size = fs::metadata(path).map_err(io)?.len();
    if size > MAX_BYTES {
        return Err(at(path, "file", "at most 2 GiB", format!("{size} bytes")));
    }
    from_bytes(&fs::read(path).map_err(io)?, path)
}

/// Reads a file's content; `path` only names it in errors.
pub fn from_bytes(bytes: &[u8], path: &Path) -> Result<TriangleMesh, FusionError> {
    parse(bytes).map_err(|Fault { place, expected, found }| FusionError::Ply {
        path: path.to_path_buf(),
        place,
        expected,
        found,
    })
}

pub fn write(path: &Path, mesh: &TriangleMesh, encoding: Encoding) -> Result<(), FusionError> {
    let io = |source| FusionError::Io { path: path.to_path_buf(), source };
    fs::write(path, to_bytes(mesh, encoding)).map_err(io)
}

/// The content of a file; normals and colours are written if there is one for each vertex.
pub fn to_bytes(mesh: &TriangleMesh, encoding: Encoding) -> Vec<u8> {
    let normals = has_normals(mesh);
    let colors = has_colors(mesh);
    let mut bytes = header(mesh, encoding).into_bytes();
    for (index, vertex) in mesh.vertices.iter().enumerate() {
        let normal = normals.then(|| mesh.normals[index].to_array());
        let numbers = vertex
            .to_array()
            .into_iter()
            .chain(normal.into_iter().flatten());
        let color = colors.then(|| mesh.colors[index]).into_iter().flatten();
        match encoding {
            Encoding::BinaryLittleEndian => {
                bytes.extend(numbers.flat_map(f32::to_le_bytes));
                bytes.extend(color);
            }
            Encoding::Ascii => {
                let words: Vec<String> = numbers
                    .map(|n| n.to_string())
                    .chain(color.map(|c| c.to_string()))
                    .collect();
                bytes.extend(words.join(" ").into_bytes());
                bytes.push(b'\n');
            }
        }
    }
    for [a, b, c] in &mesh.triangles {
        match encoding {
            Encoding::BinaryLittleEndian => {
                bytes.push(3);
                bytes.extend(
                    [a, b, c]
                        .into_iter()
                        .flat_map(|vertex| vertex.to_le_bytes()),
                );
            }
            Encoding::Ascii => bytes.extend(format!("3 {a} {b} {c}\n").into_bytes()),
        }
    }
    bytes
}

fn has_normals(mesh: &TriangleMesh) -> bool {
    mesh.normals.len() == mesh.vertices.len()
}

fn has_colors(mesh: &TriangleMesh) -> bool {
    mesh.colors.len() == mesh.vertices.len()
}

fn header(mesh: &TriangleMesh, encoding: Encoding) -> String {
    let format = match encoding {
        Encoding::Ascii => "ascii",
        Encoding::BinaryLittleEndian => "binary_little_endian",
    };
    let mut header = format!(
        "ply\nformat {format} 1.0\nelement vertex {}\n",
        mesh.vertices.len()
    );
    let mut property = |kind: &str, names: &[&str]| {
        for name in names {
            writeln!(header, "property {kind} {name}").expect("a string grows as needed");
        }
    };
    property("float", &["x", "y", "z"]);
    if has_normals(mesh) {
        property("float", &["nx", "ny", "nz"]);
    }
    if has_colors(mesh) {
        property("uchar", &["red", "green", "blue"]);
    }
    let faces = mesh.triangles.len();
    writeln!(
        header,
        "element face {faces}\nproperty list uchar uint vertex_indices\nend_header"
    )
    .expect("a string grows as needed");
    header
}

/// What a file says that it should not.
struct Fault {
    place: String,
    expected: String,
    found: String,
}

fn fault(place: &str, expected: &str, found: impl Into<String>) -> Fault {
    let mut found: String = found.into();
    // A broken file can hold anything; its first words are enough.
    found = found.chars().take(40).collect();
    Fault { place: place.to_owned(), expected: expected.to_owned(), found }
}

fn at(path: &Path, place: &str, expected: &str, found: String) -> FusionError {
    FusionError::Ply {
        path: path.to_path_buf(),
        place: place.to_owned(),
        expected: expected.to_owned(),
        found,
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

struct Property {
    name: String,
    scalar: Scalar,
    /// The type of the length, if this is a list.
    length: Option<Scalar>,
}

struct Element {
    name: String,
    count: u64,
    properties: Vec<Property>,
}

fn parse(bytes: &[u8]) -> Result<TriangleMesh, Fault> {
    let (encoding, elements, body) = parse_header(bytes)?;
    let mut values = match encoding {
        Encoding::Ascii => Values::Ascii(body),
        Encoding::BinaryLittleEndian => Values::Binary(body),
    };
    let mut mesh = TriangleMesh::default();
    for element in elements {
        match element.name.as_str() {
            "vertex" => read_vertices(&element, &mut values, &mut mesh)?,
            "face" => read_faces(&element, &mut values, &mut mesh)?,
            _ => skip(&element, &mut values)?,
        }
    }
    let count = mesh.vertices.len();
    match mesh
        .triangles
        .iter()
        .flatten()
        .find(|&&vertex| vertex as usize >= count)
    {
        Some(vertex) => Err(fault(
            "faces",
            &format!("vertices below {count}"),
            vertex.to_string(),
        )),
        None => Ok(mesh),
    }
}

fn parse_header(bytes: &[u8]) -> Result<(Encoding, Vec<Element>, &[u8]), Fault> {
    let mut rest = bytes;
    let mut next_line = || {
        let end = rest.iter().position(|&byte| byte == b'\n')?;
        let line = str::from_utf8(&rest[..end]).ok()?.trim();
        rest = &rest[end + 1..];
        Some(line)
    };
    if next_line() != Some("ply") {
        return Err(fault("line 1", "\"ply\"", "another kind of file"));
    }
    let (mut encoding, mut elements) = (None, Vec::<Element>::new());
    for number in 2.. {
        let place = format!("header line {number}");
        let Some(line) = next_line() else {
            return Err(fault(&place, "\"end_header\"", "the end of the text"));
        };
        let words: Vec<&str> = line.split_ascii_whitespace().collect();
        match words.as_slice() {
            ["format", "ascii", "1.0"] => encoding = Some(Encoding::Ascii),
            ["format", "binary_little_endian", "1.0"] => {
                encoding = Some(Encoding::BinaryLittleEndian);
            }
            ["element", name, count] => {
                let count = count
                    .parse()
                    .map_err(|_error| fault(&place, "a count", *count))?;
                elements.push(Element { name: (*name).to_owned(), count, properties: Vec::new() });
            }
            ["property", words @ ..] => {
                let property = parse_property(words);
                let (Some(property), Some(element)) = (property, elements.last_mut()) else {
                    return Err(fault(&place, "a property of an element", line));
                };
                element.properties.push(property);
            }
            ["end_header"] => break,
            ["comment" | "obj_info", ..] | [] => {}
            _ => {
                return Err(fault(
                    &place,
                    "a PLY header line of a format read here",
                    line,
                ));
            }
        }
    }
    let encoding = encoding.ok_or_else(|| fault("header", "a \"format\" line", "none"))?;
    Ok((encoding, elements, rest))
}

fn parse_property(words: &[&str]) -> Option<Property> {
    let (length, scalar, name) = match words {
        ["list", length, scalar, name] => (Some(Scalar::parse(length)?), scalar, name),
        [scalar, name] => (None, scalar, name),
        _ => return None,
    };
    Some(Property { name: (*name).to_owned(), scalar: Scalar::parse(scalar)?, length })
}

fn read_vertices(
    element: &Element,
    values: &mut Values<'_>,
    mesh: &mut TriangleMesh,
) -> Result<(), Fault> {
    let find = |name: &str| {
        element
            .properties
            .iter()
            .position(|property| property.name == name && property.length.is_none())
    };
    let find3 = |names: [&str; 3]| Some([find(names[0])?, find(names[1])?, find(names[2])?]);
    let position = find3(["x", "y", "z"])
        .ok_or_else(|| fault("header", "vertex properties x, y, z", "not all of them"))?;
    let normal = find3(["nx", "ny", "nz"]);
    let color = find3(["red", "green", "blue"]).filter(|found| {
        found
            .iter()
            .all(|&i| element.properties[i].scalar == Scalar::U8)
    });
    let mut row = vec![0.0; element.properties.len()];
    for number in 0..element.count {
        let place = || format!("vertex {number} of {}", element.count);
        for (slot, property) in row.iter_mut().zip(&element.properties) {
            *slot = values
                .property(property, &mut |_| {})
                .map_err(|short| short.at(&place()))?;
        }
        let vector = |columns: [usize; 3]| Vec3::from(columns.map(|column| row[column] as f32));
        mesh.vertices.push(vector(position));
        mesh.normals.extend(normal.map(vector));
        mesh.colors
            .extend(color.map(|columns| columns.map(|column| row[column] as u8)));
    }
    Ok(())
}

fn read_faces(
    element: &Element,
    values: &mut Values<'_>,
    mesh: &mut TriangleMesh,
) -> Result<(), Fault> {
    if element.properties.is_empty() {
        return Ok(());
    }
    let mut corners: Vec<u32> = Vec::new();
    for number in 0..element.count {
        let place = || format!("face {number} of {}", element.count);
        corners.clear();
        for property in &element.properties {
            let is_face = matches!(property.name.as_str(), "vertex_indices" | "vertex_index");
            let mut keep = |value: f64| {
                if is_face {
                    // A negative index becomes 0 here; it is too broken to be worth its own message.
                    corners.push(value as u32);
                }
            };
            values
                .property(property, &mut keep)
                .map_err(|short| short.at(&place()))?;
        }
        for index in 2..corners.len() {
            mesh.triangles
                .push([corners[0], corners[index - 1], corners[index]]);
        }
    }
    Ok(())
}

fn skip(element: &Element, values: &mut Values<'_>) -> Result<(), Fault> {
    if element.properties.is_empty() {
        return Ok(());
    }
    for number in 0..element.count {
        for property in &element.properties {
            let place = || format!("{} {number} of {}", element.name, element.count);
            values
                .property(property, &mut |_| {})
                .map_err(|short| short.at(&place()))?;
        }
    }
    Ok(())
}

/// What is left of the file after the header.
enum Values<'a> {
    Ascii(&'a [u8]),
    Binary(&'a [u8]),
}

enum Short {
    End,
    Word(String),
    Length(f64),
}

impl Short {
    fn at(self, place: &str) -> Fault {
        match self {
            Self::End => fault(place, "more data", "the end of the file"),
            Self::Word(word) => fault(place, "a number", format!("{word:?}")),
            Self::Length(length) => fault(place, "a list of 0 to 1024", format!("{length}")),
        }
    }
}

impl Values<'_> {
    /// A scalar's value; a list's are handed to `each`, and its length returned.
    fn property(&mut self, property: &Property, each: &mut dyn FnMut(f64)) -> Result<f64, Short> {
        let Some(length) = property.length else {
            return self.next(property.scalar);
        };
        let length = self.next(length)?;
        if !(0.0..=MAX_CORNERS).contains(&length) {
            return Err(Short::Length(length));
        }
        for _ in 0..length as usize {
            each(self.next(property.scalar)?);
        }
        Ok(length)
    }

    fn next(&mut self, scalar: Scalar) -> Result<f64, Short> {
        match self {
            Self::Binary(rest) => {
                let (value, tail) = scalar.decode(rest).ok_or(Short::End)?;
                *rest = tail;
                Ok(value)
            }
            Self::Ascii(rest) => {
                let trimmed = rest.trim_ascii_start();
                let end = trimmed
                    .iter()
                    .position(u8::is_ascii_whitespace)
                    .unwrap_or(trimmed.len());
                let (word, tail) = trimmed.split_at(end);
                *rest = tail;
                if word.is_empty() {
                    return Err(Short::End);
                }
                let text = String::from_utf8_lossy(word);
                text.parse()
                    .map_err(|_error| Short::Word(text.chars().take(20).collect()))
            }
        }
    }
}

impl Scalar {
    fn parse(word: &str) -> Option<Self> {
        Some(match word {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return None,
        })
    }

    fn decode(self, bytes: &[u8]) -> Option<(f64, &[u8])> {
        fn take<const N: usize>(bytes: &[u8]) -> Option<([u8; N], &[u8])> {
            bytes
                .split_first_chunk::<N>()
                .map(|(head, tail)| (*head, tail))
        }
        Some(match self {
            Self::I8 => take(bytes).map(|(b, t)| (f64::from(i8::from_le_bytes(b)), t))?,
            Self::U8 => take(bytes).map(|(b, t)| (f64::from(u8::from_le_bytes(b)), t))?,
            Self::I16 => take(bytes).map(|(b, t)| (f64::from(i16::from_le_bytes(b)), t))?,
            Self::U16 => take(bytes).map(|(b, t)| (f64::from(u16::from_le_bytes(b)), t))?,
            Self::I32 => take(bytes).map(|(b, t)| (f64::from(i32::from_le_bytes(b)), t))?,
            Self::U32 => take(bytes).map(|(b, t)| (f64::from(u32::from_le_bytes(b)), t))?,
            Self::F32 => take(bytes).map(|(b, t)| (f64::from(f32::from_le_bytes(b)), t))?,
            Self::F64 => take(bytes).map(|(b, t)| (f64::from_le_bytes(b), t))?,
        })
    }
}

#[cfg(test)]
mod tests {
    use glam::vec3;
    use proptest::prelude::*;

    use super::super::primitives::sphere;
    use super::*;

    fn colourful_sphere() -> TriangleMesh {
        let mut mesh = sphere(vec3(0.1, 1.0, -2.0), 0.5, 1);
        mesh.compute_normals();
        mesh.colors = (0..mesh.vertices.len())
            .map(|i| [i as u8, 2 * i as u8, 255])
            .collect();
        mesh
    }

    fn message(bytes: &[u8]) -> String {
        from_bytes(bytes, Path::new("a.ply"))
            .unwrap_err()
            .to_string()
    }

    #[test]
    fn meshes_survive_both_encodings_bit_for_bit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mesh.ply");
        for encoding in [Encoding::Ascii, Encoding::BinaryLittleEndian] {
            for mesh in [
                colourful_sphere(),
                sphere(Vec3::ZERO, 1.0, 0),
                TriangleMesh::default(),
            ] {
                write(&path, &mesh, encoding).unwrap();
                assert_eq!(read(&path).unwrap(), mesh);
            }
        }
    }

    #[test]
    fn quads_extra_properties_and_foreign_elements_are_understood() {
        let text = b"ply\r\nformat ascii 1.0\r\ncomment made elsewhere\r\nelement vertex 4\r\n\
            property double x\r\nproperty double y\r\nproperty float quality\r\nproperty double z\r\n\
            element edge 1\r\nproperty int vertex1\r\nproperty int vertex2\r\nelement face 1\r\n\
            property uchar flags\r\nproperty list uchar int vertex_index\r\nend_header\r\n\
            0 0 9 1\r\n1 0 9 1\r\n1 1 9 1\r\n0 1 9 1\r\n0 1\r\n7 4 0 1 2 3\r\n";
        let mesh = from_bytes(text, Path::new("quad.ply")).unwrap();
        assert_eq!(mesh.vertices[2], vec3(1.0, 1.0, 1.0));
        assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
    }

    #[test]
    fn errors_name_file_place_expectation_and_remedy() {
        let bytes = to_bytes(&colourful_sphere(), Encoding::BinaryLittleEndian);
        let cut = message(&bytes[..bytes.len() - 5]);
        assert!(
            cut.contains("a.ply, face 79 of 80: expected more data"),
            "{cut}"
        );
        assert!(message(b"solid stl\n").contains("line 1: expected \"ply\""));
        let big = message(b"ply\nformat binary_big_endian 1.0\nend_header\n");
        assert!(big.contains("binary_big_endian"), "{big}");
        let wild = b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n\
            property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n\
            0 0 0\n3 0 0 7\n";
        assert!(message(wild).contains("faces: expected vertices below 1, found 7"));
    }

    #[test]
    fn a_header_that_claims_billions_of_vertices_costs_nothing() {
        let claim = b"ply\nformat binary_little_endian 1.0\nelement vertex 18446744073709551615\n\
            property float x\nproperty float y\nproperty float z\nend_header\n";
        assert!(message(claim).contains("vertex 0 of 18446744073709551615"));
        let empty = b"ply\nformat ascii 1.0\nelement nothing 18446744073709551615\nend_header\n";
        assert!(from_bytes(empty, Path::new("a.ply")).is_ok());
    }

    proptest! {
        #[test]
        fn broken_files_never_panic(
            flips in proptest::collection::vec((0_usize..2000, any::<u8>()), 1..8),
            keep in 0_usize..2000,
            ascii in any::<bool>(),
        ) {
            let encoding = if ascii { Encoding::Ascii } else { Encoding::BinaryLittleEndian };
            let mut bytes = to_bytes(&colourful_sphere(), encoding);
            for (place, value) in flips {
                let place = place % bytes.len();
                bytes[place] = value;
            }
            bytes.truncate(keep.max(bytes.len() / 2));
            if let Ok(mesh) = from_bytes(&bytes, Path::new("a.ply")) {
                prop_assert!(mesh.indices_are_valid());
            }
        }
    }
}
