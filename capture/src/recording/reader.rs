//! Random access to a recording's frames.

use std::{
    fs::File,
    io::{BufReader, Read as _},
    path::{Path, PathBuf},
    sync::Arc,
};

use prost::Message as _;

use super::{
    chunk::{self, ChunkPlace, MessagePlace, Trouble},
    damage::Damage,
    format::{Head, MAGIC},
    foxglove::CompressedImage,
    outline,
    records::{MESSAGE_HEADER, MessageHeader},
    scan::{self, FrameEntry},
};
use crate::{
    calibration::Calibration,
    codec::{color, depth_png},
    error::CaptureError,
    frame::Frame,
    time::{FrameId, Timestamp},
};

/// Most reads of the scan are headers of some thirty bytes; images bypass the buffer.
const BUFFER_BYTES: usize = 1024;

/// Something that happened while recording.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Event {
    pub name: String,
    pub timestamp: Timestamp,
    pub value: serde_json::Value,
}

/// An open recording. Holds an index and one chunk at a time; images are decoded when asked for.
pub struct Recording {
    path: PathBuf,
    file: BufReader<File>,
    file_bytes: u64,
    head: Head,
    chunks: Vec<ChunkPlace>,
    frames: Vec<FrameEntry>,
    events: Vec<Event>,
    damage: Option<Damage>,
    loaded: Option<(u32, Vec<u8>)>,
}

impl Recording {
    /// Opens a recording, also one that was cut off: what is missing is in [`Self::damage`] and in one warning.
    pub fn open(path: &Path) -> Result<Self, CaptureError> {
        let io = CaptureError::io;
        let file = File::open(path).map_err(io(path))?;
        let file_bytes = file.metadata().map_err(io(path))?.len();
        let mut file = BufReader::with_capacity(BUFFER_BYTES, file);
        check_magic(path, &mut file)?;
        let mut outline = outline::read(&mut file, file_bytes).map_err(io(path))?;
        let head = match outline.head.clone() {
            Ok(head) => head,
            Err(reason) => {
                return Err(CaptureError::NoCalibration { path: path.to_owned(), reason });
            }
        };
        let (frames, events) = scan::scan(&mut file, &mut outline).map_err(io(path))?;
        let damage = Some(outline.damage).filter(|damage| !damage.is_none());
        if let Some(damage) = &damage {
            tracing::warn!(
                "{} is damaged: {damage}; {} frames can be played",
                path.display(),
                frames.len()
            );
        }
        let path = path.to_owned();
        Ok(Self {
            path,
            file,
            file_bytes,
            head,
            chunks: outline.chunks,
            frames,
            events,
            damage,
            loaded: None,
        })
    }

    pub fn path(&self) -> &Path {
        &self.path
    }

    pub fn file_bytes(&self) -> u64 {
        self.file_bytes
    }

    pub fn calibration(&self) -> &Calibration {
        &self.head.calibration
    }

    /// What the recording's maker wrote under a key.
    pub fn metadata(&self, key: &str) -> Option<&str> {
        self.head.metadata.get(key).map(String::as_str)
    }

    pub fn metadata_keys(&self) -> impl Iterator<Item = &str> {
        self.head.metadata.keys().map(String::as_str)
    }

    /// What happened while recording, in the order of writing.
    pub fn events(&self) -> &[Event] {
        &self.events
    }

    pub fn frame_count(&self) -> usize {
        self.frames.len()
    }

    /// From the first frame to the last.
    pub fn duration_secs(&self) -> f64 {
        match (self.frames.first(), self.frames.last()) {
            (Some(first), Some(last)) => last.timestamp - first.timestamp,
            _ => 0.0,
        }
    }

    /// What of the file cannot be read, as far as opening it shows; [`Self::verify`] reads everything.
    pub fn damage(&self) -> Option<&Damage> {
        self.damage.as_ref()
    }

    /// Id and time of the frame with an index.
    pub fn frame_at(&self, index: usize) -> Option<(FrameId, Timestamp)> {
        self.frames
            .get(index)
            .map(|entry| (entry.id, entry.timestamp))
    }

    /// Reads and decodes one frame.
    pub fn frame(&mut self, index: usize) -> Result<Frame, CaptureError> {
        let Some(&entry) = self.frames.get(index) else {
            let (path, count) = (self.path.clone(), self.frames.len());
            return Err(CaptureError::NoSuchFrame { path, index, count });
        };
        let FrameEntry { id, timestamp, .. } = entry;
        let bad = |path: &Path, what, reason| CaptureError::BadFrame {
            path: path.to_owned(),
            id,
            what,
            reason,
        };
        let image = self.image(entry.depth, entry, "the depth image")?;
        let depth = depth_png::decode(&image.data)
            .map_err(|reason| bad(&self.path, "the depth image", reason))?;
        let expected = &self.head.calibration.depth.intrinsics;
        let (got_px, expected_px) = (
            [depth.width(), depth.height()],
            [expected.width, expected.height],
        );
        if got_px != expected_px {
            let reason = format!("it is {got_px:?}, the calibration expects {expected_px:?}");
            return Err(bad(&self.path, "the depth image", reason));
        }
        let color = match entry.color {
            Some(place) => {
                let image = self.image(place, entry, "the colour image")?;
                let color = color::decode(&image.data);
                Some(Arc::new(color.map_err(|reason| {
                    bad(&self.path, "the colour image", reason)
                })?))
            }
            None => None,
        };
        Ok(Frame { id, timestamp, depth: Arc::new(depth), color })
    }

    /// Reads every chunk against its checksum and returns all damage there is.
    pub fn verify(&mut self) -> Result<Option<Damage>, CaptureError> {
        let mut damage = self.damage.clone().unwrap_or_default();
        for place in self.chunks.iter().filter(|place| place.state.is_ok()) {
            match place.load(&mut self.file) {
                Ok(_) => {}
                Err(Trouble::Broken(reason)) => {
                    damage.lose_chunk(place.at_byte, place.end() - place.at_byte, &reason);
                }
                Err(Trouble::Io(error)) => return Err(CaptureError::io(&self.path)(error)),
            }
        }
        Ok(Some(damage).filter(|damage| !damage.is_none()))
    }

    /// The image message at a place, which must be the one that the index saw.
    fn image(
        &mut self,
        place: MessagePlace,
        entry: FrameEntry,
        what: &'static str,
    ) -> Result<CompressedImage, CaptureError> {
        self.load(place.chunk)?;
        let (_, bytes) = self.loaded.as_ref().expect("loaded in the line above");
        let bad = |reason: String| CaptureError::BadFrame {
            path: self.path.clone(),
            id: entry.id,
            what,
            reason,
        };
        let body = chunk::body_of(bytes, place)
            .ok_or_else(|| bad("its place is outside its chunk".to_owned()))?;
        let header = MessageHeader::parse(body);
        if header.is_none_or(|header| header.log_time != entry.timestamp.0) {
            return Err(bad("the file changed since it was opened".to_owned()));
        }
        CompressedImage::decode(&body[MESSAGE_HEADER..]).map_err(|error| bad(error.to_string()))
    }

    fn load(&mut self, number: u32) -> Result<(), CaptureError> {
        if self
            .loaded
            .as_ref()
            .is_some_and(|(loaded, _)| *loaded == number)
        {
            return Ok(());
        }
        let place = &self.chunks[number as usize];
        match place.load(&mut self.file) {
            Ok(bytes) => self.loaded = Some((number, bytes)),
            Err(Trouble::Io(error)) => return Err(CaptureError::io(&self.path)(error)),
            Err(Trouble::Broken(reason)) => {
                let (path, at_byte) = (self.path.clone(), place.at_byte);
                return Err(CaptureError::BadChunk { path, at_byte, reason });
            }
        }
        Ok(())
    }
}

fn check_magic(path: &Path, file: &mut BufReader<File>) -> Result<(), CaptureError> {
    let mut start = Vec::new();
    file.by_ref()
        .take(MAGIC.len() as u64)
        .read_to_end(&mut start)
        .map_err(CaptureError::io(path))?;
    if start == MAGIC {
        return Ok(());
    }
    let found = match start.as_slice() {
        [] => "nothing: the file is empty".to_owned(),
        bytes => format!("{:?}", bytes.escape_ascii().to_string()),
    };
    Err(CaptureError::NotARecording { path: path.to_owned(), found })
}
