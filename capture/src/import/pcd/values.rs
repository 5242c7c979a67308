//! The numbers of points, in each of the encodings.

use super::layout::Field;

/// One number of a point: its value, and its bits for packed colours.
#[derive(Clone, Copy)]
pub(super) enum Value {
    Float(f32),
    Bits(u32),
}

impl Value {
    pub(super) fn parse(word: &str, kind: u8) -> Option<Self> {
        if kind == b'F' {
            return word.parse().ok().map(Self::Float);
        }
        word.parse::<i64>().ok().map(|bits| Self::Bits(bits as u32))
    }

    pub(super) fn read(bytes: &[u8], kind: u8) -> Self {
        match (bytes, kind) {
            (&[a, b, c, d], b'F') => Self::Float(f32::from_le_bytes([a, b, c, d])),
            (&[a, b, c, d, e, f, g, h], b'F') => {
                Self::Float(f64::from_le_bytes([a, b, c, d, e, f, g, h]) as f32)
            }
            (&[a, b, c, d, ..], _) => Self::Bits(u32::from_le_bytes([a, b, c, d])),
            _ => Self::Bits(0),
        }
    }

    pub(super) fn as_f32(self) -> f32 {
        match self {
            Self::Float(value) => value,
            Self::Bits(bits) => bits as i32 as f32,
        }
    }

    pub(super) fn as_bits(self) -> u32 {
        match self {
            Self::Float(value) => value.to_bits(),
            Self::Bits(bits) => bits,
        }
    }
}

/// The points' fields as the file holds them.
pub(super) enum Columns<'a> {
    /// By field.
    Ascii(Vec<Vec<Value>>),
    Interleaved {
        data: &'a [u8],
        point_bytes: usize,
    },
    /// All of the first field, then all of the second.
    Separate(Vec<u8>),
}

impl Columns<'_> {
    /// One field of all points, in order.
    pub(super) fn of(&self, field: &Field, points: usize) -> Box<dyn Iterator<Item = Value> + '_> {
        let &Field { index, size, kind, offset, .. } = field;
        match self {
            Self::Ascii(columns) => Box::new(columns[index].iter().copied()),
            Self::Interleaved { data, point_bytes } => {
                let value = move |point: &[u8]| Value::read(&point[offset..offset + size], kind);
                Box::new(data.chunks_exact(*point_bytes).map(value))
            }
            Self::Separate(data) => {
                let bytes = &data[offset * points..];
                let stride = size * field.elements;
                Box::new(
                    bytes
                        .chunks_exact(stride)
                        .take(points)
                        .map(move |value| Value::read(&value[..size], kind)),
                )
            }
        }
    }
}
