//! A cloud's header: which fields its points have and how they lie in the file.

use super::{
    lzf,
    values::{Columns, Value},
};
use crate::codec::check_size;

/// The header is a dozen short lines.
const MAX_HEADER_BYTES: usize = 64 * 1024;
/// Bytes of one point; real clouds have 12 to 64.
const MAX_POINT_BYTES: usize = 1024;
/// All points unpacked: a 4-megapixel cloud of 64 bytes a point.
const MAX_DATA_BYTES: usize = 256 * 1024 * 1024;

/// What is read of a point; ascii clouds drop the rest at once.
const WANTED: [&str; 5] = ["x", "y", "z", "rgb", "rgba"];

#[derive(Clone, Debug)]
pub(super) struct Field {
    name: String,
    /// Its place among the fields.
    pub(super) index: usize,
    /// Bytes of one element.
    pub(super) size: usize,
    pub(super) kind: u8,
    pub(super) elements: usize,
    /// Bytes of all fields before this one.
    pub(super) offset: usize,
}

#[derive(Clone, Copy, PartialEq)]
enum Encoding {
    Ascii,
    Binary,
    Compressed,
}

pub(super) struct Layout {
    fields: Vec<Field>,
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) points: usize,
    point_bytes: usize,
    encoding: Encoding,
}

impl Layout {
    /// The header and the bytes after it.
    pub(super) fn parse(bytes: &[u8]) -> Result<(Self, &[u8]), String> {
        let mut entries = Vec::new();
        let mut rest = bytes;
        let encoding = loop {
            let end = rest
                .iter()
                .position(|&byte| byte == b'\n')
                .ok_or("its header has no DATA line")?;
            if bytes.len() - rest.len() > MAX_HEADER_BYTES {
                return Err(format!(
                    "no DATA line in the first {MAX_HEADER_BYTES} bytes"
                ));
            }
            let line = str::from_utf8(&rest[..end])
                .map_err(|error| format!("its header is not text: {error}"))?;
            rest = &rest[end + 1..];
            let mut words = line.split_whitespace();
            match (words.next(), words.clone().next()) {
                (Some("DATA"), Some("ascii")) => break Encoding::Ascii,
                (Some("DATA"), Some("binary")) => break Encoding::Binary,
                (Some("DATA"), Some("binary_compressed")) => break Encoding::Compressed,
                (Some("DATA"), other) => return Err(format!("its DATA are {other:?}")),
                (Some(key), _) => entries.push((key, words.collect::<Vec<_>>())),
                (None, _) => {}
            }
        };
        Ok((Self::from_entries(&entries, encoding)?, rest))
    }

    fn from_entries(entries: &[(&str, Vec<&str>)], encoding: Encoding) -> Result<Self, String> {
        let find = |key: &str| {
            entries
                .iter()
                .find(|(name, _)| *name == key)
                .map(|(_, values)| values.as_slice())
        };
        let number = |key: &'static str| {
            let value = find(key).and_then(|values| values.first()?.parse::<u32>().ok());
            value.ok_or_else(|| format!("its header has no number after {key}"))
        };
        let (width, height) = (number("WIDTH")?, number("HEIGHT")?);
        if height < 2 {
            return Err(format!(
                "expected an organised cloud (an image of points), found {width}x{height}"
            ));
        }
        check_size(width, height)?;
        let fields = fields(find("FIELDS"), find("SIZE"), find("TYPE"), find("COUNT"))?;
        let point_bytes = fields
            .last()
            .map_or(0, |last| last.offset + last.size * last.elements);
        let points = width as usize * height as usize;
        if point_bytes > MAX_POINT_BYTES || points * point_bytes > MAX_DATA_BYTES {
            return Err(format!(
                "{points} points of {point_bytes} bytes are more than is read"
            ));
        }
        Ok(Self { fields, width, height, points, point_bytes, encoding })
    }

    pub(super) fn field(&self, name: &str) -> Option<&Field> {
        self.fields.iter().find(|field| field.name == name)
    }

    pub(super) fn columns<'a>(&self, data: &'a [u8]) -> Result<Columns<'a>, String> {
        let needed = self.points * self.point_bytes;
        match self.encoding {
            Encoding::Ascii => self.ascii(data).map(Columns::Ascii),
            Encoding::Binary => {
                let data = data.get(..needed);
                let data = data.ok_or_else(|| format!("expected {needed} bytes of points"))?;
                Ok(Columns::Interleaved { data, point_bytes: self.point_bytes })
            }
            Encoding::Compressed => {
                let sizes = data.split_first_chunk::<4>().and_then(|(packed, rest)| {
                    let (unpacked, rest) = rest.split_first_chunk::<4>()?;
                    let sizes = [*packed, *unpacked].map(|size| u32::from_le_bytes(size) as usize);
                    Some((sizes, rest))
                });
                let ([packed, unpacked], rest) =
                    sizes.ok_or("it ends before its compressed points")?;
                if unpacked != needed {
                    return Err(format!(
                        "expected {needed} bytes of points, its header says {unpacked}"
                    ));
                }
                let packed = rest
                    .get(..packed)
                    .ok_or("its compressed points are cut off")?;
                let data =
                    lzf::decompress(packed, unpacked).ok_or("its compressed points are damaged")?;
                Ok(Columns::Separate(data))
            }
        }
    }

    /// The first element of each field that is wanted, point by point.
    fn ascii(&self, data: &[u8]) -> Result<Vec<Vec<Value>>, String> {
        let text =
            str::from_utf8(data).map_err(|error| format!("its points are not text: {error}"))?;
        let mut columns = vec![Vec::with_capacity(self.points); self.fields.len()];
        let mut words = text.split_ascii_whitespace();
        for point in 0..self.points {
            for (field, column) in self.fields.iter().zip(&mut columns) {
                for element in 0..field.elements {
                    let word = words
                        .next()
                        .ok_or_else(|| format!("it ends at point {point} of {}", self.points))?;
                    let value = Value::parse(word, field.kind);
                    let value = value
                        .ok_or_else(|| format!("point {point} has {word:?} for {}", field.name))?;
                    if element == 0 && WANTED.contains(&field.name.as_str()) {
                        column.push(value);
                    }
                }
            }
        }
        Ok(columns)
    }
}

fn fields(
    names: Option<&[&str]>,
    sizes: Option<&[&str]>,
    kinds: Option<&[&str]>,
    counts: Option<&[&str]>,
) -> Result<Vec<Field>, String> {
    let (Some(names), Some(sizes), Some(kinds)) = (names, sizes, kinds) else {
        return Err("its header lacks FIELDS, SIZE or TYPE".to_owned());
    };
    let mut offset = 0;
    let mut fields = Vec::new();
    for (index, name) in names.iter().enumerate() {
        let size = sizes.get(index).and_then(|size| size.parse::<usize>().ok());
        let kind = kinds.get(index).and_then(|kind| kind.bytes().next());
        let elements = counts.map_or(Some(1), |counts| counts.get(index)?.parse::<usize>().ok());
        let (
            Some(size @ (1 | 2 | 4 | 8)),
            Some(kind @ (b'F' | b'I' | b'U')),
            Some(elements @ 1..=MAX_POINT_BYTES),
        ) = (size, kind, elements)
        else {
            return Err(format!(
                "its header says nothing sensible about field {name}"
            ));
        };
        fields.push(Field { name: (*name).to_owned(), index, size, kind, elements, offset });
        offset += size * elements;
    }
    Ok(fields)
}
