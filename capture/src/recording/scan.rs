//! Opening a recording: which frames and events there are and where, without reading the images.

use std::{
    collections::HashMap,
    fs::File,
    io::{self, BufReader, Cursor, Read, Seek, SeekFrom},
};

use super::{
    chunk::{self, ChunkPlace, Found, MessagePlace, Trouble, broken},
    format::{
        EventMessage, FrameMessage, MAX_EVENT_BYTES, MAX_FRAMES, MAX_JSON_BYTES, opcode, topic,
    },
    outline::Outline,
    reader::Event,
    records::{self, MESSAGE_HEADER, MessageHeader, RECORD_HEADER},
};
use crate::time::{FrameId, Timestamp};

/// One frame of the index.
#[derive(Clone, Copy, Debug)]
pub(super) struct FrameEntry {
    pub(super) id: FrameId,
    pub(super) timestamp: Timestamp,
    pub(super) depth: MessagePlace,
    pub(super) color: Option<MessagePlace>,
}

/// Goes over every chunk's message headers. Chunks that make no sense are marked, and noted in the damage.
pub(super) fn scan(
    file: &mut BufReader<File>,
    outline: &mut Outline,
) -> io::Result<(Vec<FrameEntry>, Vec<Event>)> {
    let mut index = Index::default();
    for number in 0..outline.chunks.len() {
        match scan_chunk(file, outline, number) {
            Ok(more) => index.append(more, outline),
            Err(Trouble::Io(error)) => return Err(error),
            Err(Trouble::Broken(reason)) => {
                let place = &mut outline.chunks[number];
                outline
                    .damage
                    .lose_chunk(place.at_byte, place.end() - place.at_byte, &reason);
                place.state = Err(reason);
            }
        }
    }
    Ok((index.join(outline), index.events))
}

/// What joins the messages of one frame: log time and sequence.
type Key = (u64, u32);

#[derive(Default)]
struct Index {
    depth: HashMap<Key, MessagePlace>,
    color: HashMap<Key, MessagePlace>,
    frames: Vec<(FrameId, Key)>,
    events: Vec<Event>,
    event_bytes: usize,
}

impl Index {
    fn append(&mut self, more: Self, outline: &mut Outline) {
        let frames = self.frames.len() + more.frames.len();
        let event_bytes = self.event_bytes + more.event_bytes;
        if frames > MAX_FRAMES || event_bytes > MAX_EVENT_BYTES {
            let reason = format!(
                "{frames} frames and {event_bytes} bytes of events are more than is read: the rest is left out"
            );
            return outline.damage.note(0, 0, reason);
        }
        self.event_bytes = event_bytes;
        self.depth.extend(more.depth);
        self.color.extend(more.color);
        self.frames.extend(more.frames);
        self.events.extend(more.events);
    }

    fn join(&self, outline: &mut Outline) -> Vec<FrameEntry> {
        let mut entries = Vec::with_capacity(self.frames.len());
        for &(id, key) in &self.frames {
            let color = self.color.get(&key).copied();
            match self.depth.get(&key) {
                Some(&depth) => {
                    entries.push(FrameEntry { id, timestamp: Timestamp(key.0), depth, color });
                }
                None => {
                    outline
                        .damage
                        .note(0, 0, format!("frame {} has lost its depth image", id.0));
                }
            }
        }
        // A frame message that was changed leaves an image behind.
        let orphans = self.depth.len().saturating_sub(entries.len());
        if orphans > 0 {
            outline
                .damage
                .note(0, 0, format!("{orphans} depth images belong to no frame"));
        }
        entries
    }

    fn add(
        &mut self,
        topic: &str,
        header: MessageHeader,
        place: MessagePlace,
        json: impl FnOnce() -> Result<Vec<u8>, Trouble>,
    ) -> Result<(), Trouble> {
        let key = (header.log_time, header.sequence);
        match topic {
            topic::DEPTH => {
                self.depth.insert(key, place);
            }
            topic::COLOR => {
                self.color.insert(key, place);
            }
            topic::FRAME => {
                let FrameMessage { id } = parse(&json()?)?;
                self.frames.push((FrameId(id), key));
            }
            topic::EVENT => {
                let json = json()?;
                let EventMessage { name, value } = parse(&json)?;
                self.event_bytes += json.len();
                self.events
                    .push(Event { name, timestamp: Timestamp(header.log_time), value });
            }
            _ => {}
        }
        Ok(())
    }
}

fn parse<T: serde::de::DeserializeOwned>(json: &[u8]) -> Result<T, Trouble> {
    serde_json::from_slice(json)
        .map_err(|error| Trouble::Broken(format!("a JSON message is not readable: {error}")))
}

fn scan_chunk(
    file: &mut BufReader<File>,
    outline: &mut Outline,
    number: usize,
) -> Result<Index, Trouble> {
    let place: ChunkPlace = outline.chunks[number].clone();
    if place.header.compression.is_empty() {
        let found = chunk::walk(file, place.data_at(), place.header.uncompressed_bytes)?;
        if !found.iter().any(|found| must_be_checked(found, outline)) {
            return index(file, place.data_at(), &found, number, outline);
        }
    }
    let bytes = place.load(file)?;
    let length = bytes.len() as u64;
    let mut bytes = Cursor::new(bytes);
    let found = chunk::walk(&mut bytes, 0, length)?;
    for channel in found.iter().filter(|found| found.opcode == opcode::CHANNEL) {
        let body = read_body(&mut bytes, 0, channel, 0)?;
        let Some((id, topic)) = records::channel(&body) else {
            return broken("a channel is broken".to_owned());
        };
        outline.channels.insert(id, topic.to_owned());
    }
    index(&mut bytes, 0, &found, number, outline)
}

/// Images are checked when they are played; what decides about other chunks, or is only read here, is checked now.
fn must_be_checked(found: &Found, outline: &Outline) -> bool {
    let is_event = |message: MessageHeader| {
        outline
            .channels
            .get(&message.channel)
            .is_some_and(|name| name == topic::EVENT)
    };
    found.opcode == opcode::CHANNEL || found.message.is_some_and(is_event)
}

fn index(
    bytes: &mut (impl Read + Seek),
    start: u64,
    found: &[Found],
    number: usize,
    outline: &Outline,
) -> Result<Index, Trouble> {
    let mut index = Index::default();
    for record in found {
        let Some(header) = record.message else {
            continue;
        };
        let Some(topic) = outline.channels.get(&header.channel) else {
            continue;
        };
        let place = MessagePlace {
            chunk: number as u32,
            at_byte: record.at_byte,
            body_bytes: record.body_bytes,
        };
        index.add(topic, header, place, || {
            read_body(bytes, start, record, MESSAGE_HEADER as u64)
        })?;
    }
    Ok(index)
}

/// The body of a small record, past its first `skip` bytes.
fn read_body(
    bytes: &mut (impl Read + Seek),
    start: u64,
    record: &Found,
    skip: u64,
) -> Result<Vec<u8>, Trouble> {
    let length = u64::from(record.body_bytes).saturating_sub(skip);
    if length > MAX_JSON_BYTES {
        return broken(format!(
            "a message has {length} bytes, more than the {MAX_JSON_BYTES} of any event"
        ));
    }
    let mut body = vec![0; length as usize];
    bytes.seek(SeekFrom::Start(
        start + u64::from(record.at_byte) + RECORD_HEADER + skip,
    ))?;
    bytes.read_exact(&mut body)?;
    Ok(body)
}
