//! A glTF file and the numbers in it, each checked and bounded before it is believed.

use std::{
    fs,
    path::{Path, PathBuf},
};

use gltf_json::{
    Root,
    accessor::{ComponentType, Type},
    validation::Checked,
};

use crate::error::SimError;

/// The largest file accepted: characters have a few megabytes, most of it pictures.
const MAX_BYTES: u64 = 256 << 20;

/// An open file.
pub(super) struct Document {
    pub(super) path: PathBuf,
    pub(super) root: Root,
    buffers: Vec<Vec<u8>>,
}

impl Document {
    pub(super) fn read(path: &Path) -> Result<Self, SimError> {
        let bytes = bounded(path, path)?;
        let (json, binary) = if bytes.starts_with(b"glTF") {
            chunks(&bytes).ok_or_else(|| {
                SimError::character(
                    path,
                    "a binary glTF of version 2 with a JSON chunk",
                    "a damaged one",
                )
            })?
        } else {
            (&bytes[..], None)
        };
        let root: Root = serde_json::from_slice(json).map_err(|error| {
            SimError::character(path, "a glTF 2 file (.glb or .gltf)", &error.to_string())
        })?;
        let mut buffers: Vec<Vec<u8>> = Vec::new();
        let mut left_bytes = MAX_BYTES;
        for (number, buffer) in root.buffers.iter().enumerate() {
            let bytes = match (&buffer.uri, binary) {
                (None, Some(binary)) if number == 0 => binary.to_vec(),
                (Some(uri), _) if !uri.contains([':', '/', '\\', '%']) => {
                    bounded(path, &path.with_file_name(uri))?
                }
                (uri, _) => {
                    let found = uri
                        .as_deref()
                        .unwrap_or("none")
                        .chars()
                        .take(40)
                        .collect::<String>();
                    let expected =
                        "data in the file itself or in one beside it; convert it to .glb";
                    return Err(SimError::character(path, expected, &found));
                }
            };
            left_bytes = left_bytes.checked_sub(bytes.len() as u64).ok_or_else(|| {
                let expected = format!("buffers of {MAX_BYTES} bytes together at most");
                SimError::character(path, &expected, "more")
            })?;
            buffers.push(bytes);
        }
        Ok(Self { path: path.to_path_buf(), root, buffers })
    }

    /// An error about this file.
    pub(super) fn wrong(&self, expected: &str, found: &str) -> SimError {
        SimError::character(&self.path, expected, found)
    }

    /// An accessor of `N` numbers an element; normalised whole numbers become shares of one.
    pub(super) fn numbers<const N: usize>(
        &self,
        accessor: usize,
    ) -> Result<Vec<[f32; N]>, SimError> {
        let what = format!("accessor {accessor}");
        let found = self.root.accessors.get(accessor);
        let found = found.ok_or_else(|| self.wrong(&what, "no such accessor"))?;
        let (Checked::Valid(kind), Checked::Valid(component)) = (found.type_, found.component_type)
        else {
            return Err(self.wrong(&what, "a type that glTF does not have"));
        };
        if width(kind) != N || found.sparse.is_some() {
            return Err(self.wrong(
                &format!("{what} of {N} dense numbers"),
                &format!("{kind:?}"),
            ));
        }
        let count = usize::try_from(found.count.0).unwrap_or(usize::MAX);
        let size = size_of_component(component.0);
        let bytes = self.elements(accessor, count, size * N)?;
        let scale = if found.normalized {
            largest(component.0)
        } else {
            1.0
        };
        let mut numbers = Vec::with_capacity(count);
        for element in bytes {
            let mut out = [0.0; N];
            for (to, from) in out.iter_mut().zip(element.chunks_exact(size)) {
                *to = component_value(component.0, from) / scale;
            }
            if !out.iter().all(|number| number.is_finite()) {
                return Err(self.wrong(&format!("{what} of finite numbers"), &format!("{out:?}")));
            }
            numbers.push(out);
        }
        Ok(numbers)
    }

    /// The bytes of each element of an accessor, all of them inside the file.
    fn elements(
        &self,
        accessor: usize,
        count: usize,
        element: usize,
    ) -> Result<impl Iterator<Item = &[u8]>, SimError> {
        let broken =
            |found: &str| self.wrong(&format!("accessor {accessor} inside its buffer"), found);
        let found = &self.root.accessors[accessor];
        let view = found
            .buffer_view
            .and_then(|view| self.root.buffer_views.get(view.value()));
        let view = view.ok_or_else(|| broken("no buffer view"))?;
        let buffer = self
            .buffers
            .get(view.buffer.value())
            .ok_or_else(|| broken("no buffer"))?;
        let offset = |offset: Option<gltf_json::validation::USize64>| {
            usize::try_from(offset.map_or(0, |o| o.0)).unwrap_or(usize::MAX)
        };
        let start = offset(view.byte_offset).saturating_add(offset(found.byte_offset));
        let stride = view
            .byte_stride
            .map_or(element, |stride| stride.0.max(element));
        let length = stride
            .saturating_mul(count.saturating_sub(1))
            .saturating_add(element);
        let end = start.saturating_add(if count == 0 { 0 } else { length });
        if end > buffer.len() {
            return Err(broken(&format!(
                "{count} elements up to byte {end} of {}",
                buffer.len()
            )));
        }
        Ok((0..count).map(move |i| &buffer[start + i * stride..start + i * stride + element]))
    }
}

fn bounded(document: &Path, path: &Path) -> Result<Vec<u8>, SimError> {
    let io = |source| SimError::CharacterIo { path: path.to_path_buf(), source };
    let bytes = fs::metadata(path).map_err(io)?.len();
    if bytes > MAX_BYTES {
        let expected = format!("at most {MAX_BYTES} bytes");
        return Err(SimError::character(
            document,
            &expected,
            &format!("{bytes} bytes"),
        ));
    }
    fs::read(path).map_err(io)
}

/// JSON and binary chunk of a `.glb` file.
fn chunks(bytes: &[u8]) -> Option<(&[u8], Option<&[u8]>)> {
    let word = |at: usize| Some(u32::from_le_bytes(bytes.get(at..at + 4)?.try_into().ok()?));
    if word(4)? != 2 || word(16)? != u32::from_le_bytes(*b"JSON") {
        return None;
    }
    let json_end = 20usize.checked_add(word(12)? as usize)?;
    let json = bytes.get(20..json_end)?;
    let Some(length) = word(json_end) else {
        return Some((json, None));
    };
    if word(json_end + 4)? != u32::from_le_bytes(*b"BIN\0") {
        return Some((json, None));
    }
    let start = json_end + 8;
    Some((
        json,
        Some(bytes.get(start..start.checked_add(length as usize)?)?),
    ))
}

fn width(kind: Type) -> usize {
    match kind {
        Type::Scalar => 1,
        Type::Vec2 => 2,
        Type::Vec3 => 3,
        Type::Vec4 | Type::Mat2 => 4,
        Type::Mat3 => 9,
        Type::Mat4 => 16,
    }
}

fn size_of_component(component: ComponentType) -> usize {
    match component {
        ComponentType::I8 | ComponentType::U8 => 1,
        ComponentType::I16 | ComponentType::U16 => 2,
        ComponentType::U32 | ComponentType::F32 => 4,
    }
}

fn largest(component: ComponentType) -> f32 {
    match component {
        ComponentType::I8 => 127.0,
        ComponentType::U8 => 255.0,
        ComponentType::I16 => 32767.0,
        ComponentType::U16 => 65535.0,
        ComponentType::U32 | ComponentType::F32 => 1.0,
    }
}

fn component_value(component: ComponentType, bytes: &[u8]) -> f32 {
    let two = || [bytes[0], bytes[1]];
    let four = || [bytes[0], bytes[1], bytes[2], bytes[3]];
    match component {
        ComponentType::I8 => f32::from(i8::from_le_bytes([bytes[0]])),
        ComponentType::U8 => f32::from(bytes[0]),
        ComponentType::I16 => f32::from(i16::from_le_bytes(two())),
        ComponentType::U16 => f32::from(u16::from_le_bytes(two())),
        // Exact up to 16 million: no character has more vertices.
        ComponentType::U32 => u32::from_le_bytes(four()) as f32,
        ComponentType::F32 => f32::from_le_bytes(four()),
    }
}
