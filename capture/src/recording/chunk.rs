//! Chunks: where they lie, and their bytes once checked.

use std::{
    fs::File,
    io::{self, BufReader, Read, Seek, SeekFrom},
};

use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};

use super::{
    format::{MAX_CHUNK_BYTES, opcode},
    records::{ChunkHeader, MESSAGE_HEADER, MessageHeader, RECORD_HEADER, RecordHeader},
};

/// A chunk has a few messages a frame; with more than this it is not one of a recording of images.
const MAX_RECORDS: usize = 100_000;

/// Where a chunk lies in the file, and what it says about itself.
#[derive(Clone, Debug)]
pub(super) struct ChunkPlace {
    pub(super) at_byte: u64,
    pub(super) header: ChunkHeader,
    /// `Err` holds why the chunk cannot be used.
    pub(super) state: Result<(), String>,
}

/// Why a chunk cannot be had.
#[derive(Debug)]
pub(super) enum Trouble {
    Io(io::Error),
    /// What is wrong with its bytes.
    Broken(String),
}

impl From<io::Error> for Trouble {
    fn from(error: io::Error) -> Self {
        Self::Io(error)
    }
}

pub(super) fn broken<T>(reason: String) -> Result<T, Trouble> {
    Err(Trouble::Broken(reason))
}

/// Where a message lies: a chunk, and a record in its uncompressed bytes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct MessagePlace {
    pub(super) chunk: u32,
    pub(super) at_byte: u32,
    pub(super) body_bytes: u32,
}

impl ChunkPlace {
    /// Reads the header of the chunk record at a place.
    pub(super) fn read(
        file: &mut BufReader<File>,
        at_byte: u64,
        file_bytes: u64,
    ) -> Result<Self, Trouble> {
        let mut bytes = [0; RECORD_HEADER as usize + ChunkHeader::MAX_BYTES];
        let available = file_bytes.saturating_sub(at_byte).min(bytes.len() as u64) as usize;
        file.seek(SeekFrom::Start(at_byte))?;
        file.read_exact(&mut bytes[..available])?;
        Self::parse(&bytes[..available], at_byte, file_bytes).map_err(Trouble::Broken)
    }

    fn parse(bytes: &[u8], at_byte: u64, file_bytes: u64) -> Result<Self, String> {
        let (head, body) = bytes
            .split_first_chunk()
            .ok_or("the file ends in its header")?;
        let record = RecordHeader::parse(*head);
        if record.opcode != opcode::CHUNK {
            return Err(format!(
                "expected a chunk, found a record of kind {:#04x}",
                record.opcode
            ));
        }
        let header = ChunkHeader::parse(body).ok_or("its header is broken")?;
        let Some(needed) = header.header_bytes.checked_add(header.compressed_bytes) else {
            return Err("its lengths are impossible".to_owned());
        };
        if needed != record.body_bytes {
            return Err(format!(
                "it is {} bytes long, its parts are {needed}",
                record.body_bytes
            ));
        }
        if file_bytes.saturating_sub(at_byte + RECORD_HEADER) < needed {
            return Err("the file ends in it".to_owned());
        }
        if header.uncompressed_bytes.max(header.compressed_bytes) > MAX_CHUNK_BYTES {
            return Err(format!(
                "it holds {} bytes, more than the {MAX_CHUNK_BYTES} that are read at once",
                header.uncompressed_bytes
            ));
        }
        if header.compression.is_empty() && header.uncompressed_bytes != header.compressed_bytes {
            return Err("it is not compressed, and yet its two lengths differ".to_owned());
        }
        Ok(Self { at_byte, header, state: Ok(()) })
    }

    pub(super) fn data_at(&self) -> u64 {
        self.at_byte + RECORD_HEADER + self.header.header_bytes
    }

    pub(super) fn end(&self) -> u64 {
        self.data_at() + self.header.compressed_bytes
    }

    /// The chunk's records in one piece, checked against its CRC.
    pub(super) fn load(&self, file: &mut BufReader<File>) -> Result<Vec<u8>, Trouble> {
        self.state.clone().map_err(Trouble::Broken)?;
        if !self.header.compression.is_empty() {
            let mut record = vec![0; (self.end() - self.at_byte) as usize];
            file.seek(SeekFrom::Start(self.at_byte))?;
            file.read_exact(&mut record)?;
            return unpacked(&record).map_err(Trouble::Broken);
        }
        let mut stored = vec![0; self.header.compressed_bytes as usize];
        file.seek(SeekFrom::Start(self.data_at()))?;
        file.read_exact(&mut stored)?;
        let computed = crc32fast::hash(&stored);
        // A CRC of 0 means that the writer made none.
        if self.header.crc != 0 && self.header.crc != computed {
            return Err(Trouble::Broken(format!(
                "its checksum is {computed:08x}, stored is {:08x}: bytes were changed",
                self.header.crc
            )));
        }
        Ok(stored)
    }
}

/// Other tools compress when they rewrite a file: unpacks a chunk record, checks its CRC, and lays messages and channels
/// one after the other again. No record of it is believed to be longer than a chunk.
fn unpacked(mut chunk: &[u8]) -> Result<Vec<u8>, String> {
    let options = LinearReaderOptions::default()
        .with_skip_start_magic(true)
        .with_skip_end_magic(true)
        .with_prevalidate_chunk_crcs(true)
        .with_record_length_limit(MAX_CHUNK_BYTES as usize);
    let mut reader = LinearReader::new_with_options(options);
    let mut out = Vec::new();
    while let Some(event) = reader.next_event() {
        match event.map_err(|error| error.to_string())? {
            LinearReadEvent::ReadRequest(wanted) => {
                let (next, rest) = chunk.split_at(wanted.min(chunk.len()));
                reader.insert(next.len()).copy_from_slice(next);
                reader.notify_read(next.len());
                chunk = rest;
            }
            LinearReadEvent::Record { opcode, data } => {
                if matches!(opcode, opcode::MESSAGE | opcode::CHANNEL) {
                    out.push(opcode);
                    out.extend((data.len() as u64).to_le_bytes());
                    out.extend(data);
                }
            }
        }
    }
    Ok(out)
}

/// A record inside a chunk, as the walk over it finds it.
pub(super) struct Found {
    pub(super) opcode: u8,
    pub(super) at_byte: u32,
    pub(super) body_bytes: u32,
    /// Only of messages.
    pub(super) message: Option<MessageHeader>,
}

/// Lists the records of `length` bytes from a position on, reading headers only: images are skipped, not read.
pub(super) fn walk(
    bytes: &mut (impl Read + Seek),
    start: u64,
    length: u64,
) -> Result<Vec<Found>, Trouble> {
    let mut found = Vec::new();
    let mut at = 0;
    while at < length {
        if found.len() == MAX_RECORDS {
            return broken(format!("it has more than {MAX_RECORDS} records"));
        }
        if length - at < RECORD_HEADER {
            return broken("its last record is cut off".to_owned());
        }
        bytes.seek(SeekFrom::Start(start + at))?;
        let mut head = [0; RECORD_HEADER as usize];
        bytes.read_exact(&mut head)?;
        let RecordHeader { opcode, body_bytes } = RecordHeader::parse(head);
        if body_bytes > length - at - RECORD_HEADER {
            return broken(format!(
                "the record at its byte {at} is longer than the chunk"
            ));
        }
        let mut message = None;
        if opcode == opcode::MESSAGE {
            let mut body = [0; MESSAGE_HEADER];
            if body_bytes < body.len() as u64 {
                return broken(format!("the message at its byte {at} is too short"));
            }
            bytes.read_exact(&mut body)?;
            message = MessageHeader::parse(&body);
        }
        // Chunks are at most `MAX_CHUNK_BYTES` long, so that u32 holds every place.
        found.push(Found { opcode, at_byte: at as u32, body_bytes: body_bytes as u32, message });
        at += RECORD_HEADER + body_bytes;
    }
    Ok(found)
}

/// The body of the record at a place of a chunk's bytes.
pub(super) fn body_of(chunk: &[u8], place: MessagePlace) -> Option<&[u8]> {
    let start = place.at_byte as usize + RECORD_HEADER as usize;
    chunk.get(start..start + place.body_bytes as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A chunk record of what other tools write: `content` in a frame of zstd that leaves it as it is.
    fn zstd_chunk(content: &[u8]) -> Vec<u8> {
        let length = u8::try_from(content.len()).unwrap();
        // Magic number, "one segment, one byte of length", the length; then one block, the last one, raw.
        let mut packed = vec![0x28, 0xb5, 0x2f, 0xfd, 0x20, length];
        packed.extend(&((u32::from(length) << 3) | 1).to_le_bytes()[..3]);
        packed.extend(content);
        let mut body = Vec::new();
        body.extend([0; 16]);
        body.extend((content.len() as u64).to_le_bytes());
        body.extend(0u32.to_le_bytes());
        body.extend(4u32.to_le_bytes());
        body.extend(b"zstd");
        body.extend((packed.len() as u64).to_le_bytes());
        body.extend(packed);
        record(opcode::CHUNK, body.len() as u64, &body)
    }

    fn record(opcode: u8, body_bytes: u64, body: &[u8]) -> Vec<u8> {
        let mut record = vec![opcode];
        record.extend(body_bytes.to_le_bytes());
        record.extend(body);
        record
    }

    #[test]
    fn records_of_compressed_chunks_are_no_longer_than_they_are() {
        const ATTACHMENT: u8 = 0x09;
        let message = record(opcode::MESSAGE, 30, &[7; 30]);
        let attachment = record(ATTACHMENT, 2, &[0; 2]);
        let both = [attachment, message.clone()].concat();
        assert_eq!(unpacked(&zstd_chunk(&both)).unwrap(), message);
        for body_bytes in [31, 100_000_000, 1 << 50, u64::MAX] {
            let longer = record(opcode::MESSAGE, body_bytes, &[7; 30]);
            assert!(unpacked(&zstd_chunk(&longer)).is_err(), "{body_bytes}");
        }
        let whole = zstd_chunk(&message);
        // Nothing at all, or nothing after opcode and length, is no chunk, but nothing is wrong with it either.
        for length in (10..whole.len()).chain(1..9) {
            assert!(unpacked(&whole[..length]).is_err(), "{length}");
        }
    }
}
