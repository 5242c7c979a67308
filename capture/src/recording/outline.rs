//! A recording's outline: its head, channels and chunks, from the closing index or, without one, record by record.

use std::{
    collections::BTreeMap,
    fs::File,
    io::{self, BufReader, Read as _, Seek as _, SeekFrom},
};

use super::{
    chunk::{ChunkPlace, Trouble},
    damage::Damage,
    format::{Head, MAGIC, MAX_CHUNK_BYTES, MAX_METADATA_BYTES, MAX_SUMMARY_BYTES, head, opcode},
    records::{self, RECORD_HEADER, RecordHeader},
};

/// Summary start, summary offset start, CRC.
const FOOTER_BODY: u64 = 20;

pub(super) struct Outline {
    /// `Err` says why there is none.
    pub(super) head: Result<Head, String>,
    /// Topics by channel number.
    pub(super) channels: BTreeMap<u16, String>,
    pub(super) chunks: Vec<ChunkPlace>,
    pub(super) damage: Damage,
}

impl Outline {
    fn empty() -> Self {
        let head = Err("it has no such record".to_owned());
        Self { head, channels: BTreeMap::new(), chunks: Vec::new(), damage: Damage::default() }
    }

    fn add_chunk(
        &mut self,
        chunk: Result<ChunkPlace, Trouble>,
        at_byte: u64,
        bytes: u64,
    ) -> io::Result<()> {
        match chunk {
            Ok(chunk) => self.chunks.push(chunk),
            Err(Trouble::Broken(reason)) => self.damage.lose_chunk(at_byte, bytes, &reason),
            Err(Trouble::Io(error)) => return Err(error),
        }
        Ok(())
    }
}

/// Reads the outline of a file that starts with MCAP's magic.
pub(super) fn read(file: &mut BufReader<File>, file_bytes: u64) -> io::Result<Outline> {
    match summary(file, file_bytes)? {
        Some(summary) => from_summary(file, file_bytes, &summary),
        None => from_walk(file, file_bytes),
    }
}

fn from_summary(
    file: &mut BufReader<File>,
    file_bytes: u64,
    summary: &[u8],
) -> io::Result<Outline> {
    let mut outline = Outline::empty();
    for (opcode, body) in records::iterate(summary) {
        match opcode {
            opcode::CHANNEL => {
                outline
                    .channels
                    .extend(records::channel(body).map(|(id, topic)| (id, topic.to_owned())));
            }
            opcode::CHUNK_INDEX => {
                let Some((at_byte, bytes)) = records::chunk_index(body) else {
                    continue;
                };
                outline.add_chunk(ChunkPlace::read(file, at_byte, file_bytes), at_byte, bytes)?;
            }
            opcode::METADATA_INDEX => {
                let Some((at_byte, bytes, head::NAME)) = records::metadata_index(body) else {
                    continue;
                };
                let Some(body) = bytes.checked_sub(RECORD_HEADER) else {
                    continue;
                };
                if at_byte < file_bytes {
                    outline.head = read_head(
                        file,
                        at_byte + RECORD_HEADER,
                        body.min(file_bytes - at_byte),
                    )?;
                }
            }
            _ => {}
        }
    }
    Ok(outline)
}

/// Goes from record to record until the data end, the file ends, or sense ends.
fn from_walk(file: &mut BufReader<File>, file_bytes: u64) -> io::Result<Outline> {
    let mut outline = Outline::empty();
    outline.damage.unfinished = true;
    let mut at = MAGIC.len() as u64;
    loop {
        let rest = file_bytes.saturating_sub(at);
        if rest < RECORD_HEADER {
            outline.damage.note(
                at,
                rest,
                "the file ends without its closing index".to_owned(),
            );
            return Ok(outline);
        }
        file.seek(SeekFrom::Start(at))?;
        let mut bytes = [0; RECORD_HEADER as usize];
        file.read_exact(&mut bytes)?;
        let record = RecordHeader::parse(bytes);
        if record.opcode == opcode::DATA_END {
            outline.damage.note(
                at,
                rest,
                "the closing index is cut off or damaged".to_owned(),
            );
            return Ok(outline);
        }
        let implausible = record.opcode == 0 || record.body_bytes > 2 * MAX_CHUNK_BYTES;
        if implausible {
            outline
                .damage
                .note(at, rest, "no record starts where one should".to_owned());
            return Ok(outline);
        }
        let end = at + RECORD_HEADER + record.body_bytes;
        if end > file_bytes {
            outline.damage.missing_bytes = end - file_bytes;
            let what = kind(file, record.opcode, rest - RECORD_HEADER)?;
            outline
                .damage
                .note(at, rest, format!("the file ends inside {what}"));
            return Ok(outline);
        }
        match record.opcode {
            opcode::CHUNK => {
                outline.add_chunk(ChunkPlace::read(file, at, file_bytes), at, end - at)?;
            }
            opcode::METADATA if outline.head.is_err() => {
                outline.head = read_head(file, at + RECORD_HEADER, record.body_bytes)?;
            }
            _ => {}
        }
        at = end;
    }
}

/// What the record is whose body the file stands at, of which so many bytes are there.
fn kind(file: &mut BufReader<File>, opcode: u8, available: u64) -> io::Result<String> {
    Ok(match opcode {
        opcode::CHUNK if available >= 16 => {
            let mut times = [0; 16];
            file.read_exact(&mut times)?;
            let (first, last) = records::chunk_times(&times).unwrap_or_default();
            let secs = last.saturating_sub(first) as f64 * 1e-9;
            format!("a chunk with {secs:.2} s of frames")
        }
        opcode::CHUNK => "a chunk of frames".to_owned(),
        opcode::METADATA => "its metadata".to_owned(),
        _ => "a record between chunks".to_owned(),
    })
}

/// Reads the metadata record's body at a place.
fn read_head(file: &mut BufReader<File>, at: u64, bytes: u64) -> io::Result<Result<Head, String>> {
    if bytes > MAX_METADATA_BYTES {
        return Ok(Err(format!(
            "its metadata has {bytes} bytes, more than the {MAX_METADATA_BYTES} that are read"
        )));
    }
    let body = read_block(file, at, bytes)?;
    Ok(match records::metadata(&body) {
        Some((head::NAME, entries)) => Head::from_record(entries),
        Some((other, _)) => Err(format!("it has metadata `{other}` only")),
        None => Err("its metadata is broken".to_owned()),
    })
}

/// The bytes of the summary section if the file ends with an intact one.
fn summary(file: &mut BufReader<File>, file_bytes: u64) -> io::Result<Option<Vec<u8>>> {
    let tail_bytes = RECORD_HEADER + FOOTER_BODY + MAGIC.len() as u64;
    let Some(footer_at) = file_bytes
        .checked_sub(tail_bytes)
        .filter(|at| *at >= MAGIC.len() as u64)
    else {
        return Ok(None);
    };
    let tail = read_block(file, footer_at, tail_bytes)?;
    let Some((opcode::FOOTER, footer)) = records::iterate(&tail).next() else {
        return Ok(None);
    };
    let Some((start, crc)) = records::footer(footer) else {
        return Ok(None);
    };
    let inside =
        (MAGIC.len() as u64..footer_at).contains(&start) && footer_at - start <= MAX_SUMMARY_BYTES;
    if !inside || !tail.ends_with(&MAGIC) {
        return Ok(None);
    }
    let summary = read_block(file, start, footer_at - start)?;
    let mut hasher = crc32fast::Hasher::new();
    hasher.update(&summary);
    // The CRC covers the footer up to itself.
    hasher.update(&tail[..tail.len() - MAGIC.len() - 4]);
    if crc != 0 && crc != hasher.finalize() {
        return Ok(None);
    }
    Ok(Some(summary))
}

fn read_block(file: &mut BufReader<File>, at: u64, bytes: u64) -> io::Result<Vec<u8>> {
    let mut block = vec![0; bytes as usize];
    file.seek(SeekFrom::Start(at))?;
    file.read_exact(&mut block)?;
    Ok(block)
}
