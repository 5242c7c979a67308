//! The few MCAP records that playing needs, parsed without trust: every length is checked against what is there.

use std::collections::BTreeMap;

/// Opcode and length.
pub(super) const RECORD_HEADER: u64 = 9;
/// Channel, sequence, log time, publish time.
pub(super) const MESSAGE_HEADER: usize = 22;

/// Reads little-endian fields one after the other; `None` past the end.
pub(super) struct Fields<'a>(pub(super) &'a [u8]);

impl<'a> Fields<'a> {
    pub(super) fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let (head, tail) = self.0.split_at_checked(count)?;
        self.0 = tail;
        Some(head)
    }

    fn array<const N: usize>(&mut self) -> Option<[u8; N]> {
        self.take(N)?.try_into().ok()
    }

    pub(super) fn u8(&mut self) -> Option<u8> {
        self.array::<1>().map(|[byte]| byte)
    }

    pub(super) fn u16(&mut self) -> Option<u16> {
        self.array().map(u16::from_le_bytes)
    }

    pub(super) fn u32(&mut self) -> Option<u32> {
        self.array().map(u32::from_le_bytes)
    }

    pub(super) fn u64(&mut self) -> Option<u64> {
        self.array().map(u64::from_le_bytes)
    }

    fn string(&mut self) -> Option<&'a str> {
        let length = self.u32()?;
        str::from_utf8(self.take(length as usize)?).ok()
    }
}

/// Where a record lies and how long its body is.
#[derive(Clone, Copy, Debug)]
pub(super) struct RecordHeader {
    pub(super) opcode: u8,
    pub(super) body_bytes: u64,
}

impl RecordHeader {
    pub(super) fn parse([opcode, length @ ..]: [u8; RECORD_HEADER as usize]) -> Self {
        Self { opcode, body_bytes: u64::from_le_bytes(length) }
    }
}

/// The start of a chunk's body; the chunk's data follow.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ChunkHeader {
    pub(super) start_time: u64,
    pub(super) end_time: u64,
    pub(super) uncompressed_bytes: u64,
    pub(super) crc: u32,
    pub(super) compression: String,
    pub(super) compressed_bytes: u64,
    /// How many bytes of the body this header takes.
    pub(super) header_bytes: u64,
}

impl ChunkHeader {
    /// No compression has a longer name.
    pub(super) const MAX_BYTES: usize = 64;

    pub(super) fn parse(body: &[u8]) -> Option<Self> {
        let mut fields = Fields(body);
        let start_time = fields.u64()?;
        let end_time = fields.u64()?;
        let uncompressed_bytes = fields.u64()?;
        let crc = fields.u32()?;
        let compression = fields.string()?.to_owned();
        let compressed_bytes = fields.u64()?;
        let header_bytes = (body.len() - fields.0.len()) as u64;
        Some(Self {
            start_time,
            end_time,
            uncompressed_bytes,
            crc,
            compression,
            compressed_bytes,
            header_bytes,
        })
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct MessageHeader {
    pub(super) channel: u16,
    pub(super) sequence: u32,
    pub(super) log_time: u64,
}

impl MessageHeader {
    pub(super) fn parse(body: &[u8]) -> Option<Self> {
        let mut fields = Fields(body);
        let header =
            Self { channel: fields.u16()?, sequence: fields.u32()?, log_time: fields.u64()? };
        fields.u64()?;
        Some(header)
    }
}

/// A channel's number and topic.
pub(super) fn channel(body: &[u8]) -> Option<(u16, &str)> {
    let mut fields = Fields(body);
    let id = fields.u16()?;
    fields.u16()?;
    Some((id, fields.string()?))
}

/// A metadata record's name and entries.
pub(super) fn metadata(body: &[u8]) -> Option<(&str, BTreeMap<String, String>)> {
    let mut fields = Fields(body);
    let name = fields.string()?;
    let length = fields.u32()? as usize;
    let mut map = Fields(fields.take(length)?);
    let mut entries = BTreeMap::new();
    while !map.0.is_empty() {
        let (key, value) = (map.string()?, map.string()?);
        entries.insert(key.to_owned(), value.to_owned());
    }
    Some((name, entries))
}

/// A metadata index: where the record lies, how long it is, and its name.
pub(super) fn metadata_index(body: &[u8]) -> Option<(u64, u64, &str)> {
    let mut fields = Fields(body);
    Some((fields.u64()?, fields.u64()?, fields.string()?))
}

/// Log times of a chunk's first and last message, from the start of its body.
pub(super) fn chunk_times(body: &[u8]) -> Option<(u64, u64)> {
    let mut fields = Fields(body);
    Some((fields.u64()?, fields.u64()?))
}

/// A chunk index: where the chunk record lies and how long it is.
pub(super) fn chunk_index(body: &[u8]) -> Option<(u64, u64)> {
    let mut fields = Fields(body);
    fields.take(16)?;
    Some((fields.u64()?, fields.u64()?))
}

/// The footer's start of the summary, and the checksum of it (0: none).
pub(super) fn footer(body: &[u8]) -> Option<(u64, u32)> {
    let mut fields = Fields(body);
    let summary_start = fields.u64()?;
    fields.u64()?;
    Some((summary_start, fields.u32()?))
}

/// The records of a block of bytes; stops at the first that does not fit.
pub(super) fn iterate(block: &[u8]) -> impl Iterator<Item = (u8, &[u8])> {
    let mut fields = Fields(block);
    std::iter::from_fn(move || {
        let opcode = fields.u8()?;
        let length = usize::try_from(fields.u64()?).ok()?;
        Some((opcode, fields.take(length)?))
    })
}
