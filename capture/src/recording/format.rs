//! The names and limits of a recording; `docs/recording_format.md` explains them.

use std::collections::BTreeMap;

use crate::{calibration::Calibration, error::CaptureError};

pub(crate) const MAGIC: [u8; 8] = *b"\x89MCAP0\r\n";

pub(crate) mod topic {
    pub(crate) const DEPTH: &str = "/depth/image";
    pub(crate) const DEPTH_CALIBRATION: &str = "/depth/calibration";
    pub(crate) const COLOR: &str = "/color/image";
    pub(crate) const COLOR_CALIBRATION: &str = "/color/calibration";
    pub(crate) const TRANSFORMS: &str = "/tf";
    pub(crate) const FRAME: &str = "/effigy/frame";
    pub(crate) const EVENT: &str = "/effigy/event";
}

/// Foxglove's "frame ids": the spaces of docs/spaces.md.
pub(crate) mod space {
    pub(crate) const WORLD: &str = "world";
    pub(crate) const DEPTH_CAMERA: &str = "depth_camera";
    pub(crate) const COLOR_CAMERA: &str = "color_camera";
}

pub(crate) mod opcode {
    pub(crate) const FOOTER: u8 = 0x02;
    pub(crate) const CHANNEL: u8 = 0x04;
    pub(crate) const MESSAGE: u8 = 0x05;
    pub(crate) const CHUNK: u8 = 0x06;
    pub(crate) const CHUNK_INDEX: u8 = 0x08;
    pub(crate) const METADATA: u8 = 0x0c;
    pub(crate) const METADATA_INDEX: u8 = 0x0d;
    pub(crate) const DATA_END: u8 = 0x0f;
}

/// Chunks above this are not read: ours hold 1 MiB and one frame, other tools' rewrites a few MiB; two frames of the
/// largest camera, uncompressed, still fit.
pub(crate) const MAX_CHUNK_BYTES: u64 = 128 * 1024 * 1024;
/// The calibration with the free metadata (a simulator's scenario, say) is kilobytes.
pub(crate) const MAX_METADATA_BYTES: u64 = 16 * 1024 * 1024;
/// The closing index takes about 200 bytes a chunk: this is a recording of 350 GB.
pub(crate) const MAX_SUMMARY_BYTES: u64 = 64 * 1024 * 1024;
/// A frame's id and an event's JSON.
pub(crate) const MAX_JSON_BYTES: u64 = 1024 * 1024;
/// All events together: avatar swaps and the like, a few a minute.
pub(crate) const MAX_EVENT_BYTES: usize = 64 * 1024 * 1024;
/// A day at 60 Hz is half of this; each costs about 100 bytes of index.
pub(crate) const MAX_FRAMES: usize = 10_000_000;

/// The JSON message that makes the images with the same log time and sequence a frame.
#[derive(serde::Serialize, serde::Deserialize)]
pub(crate) struct FrameMessage {
    pub(crate) id: u64,
}

pub(crate) const FRAME_SCHEMA: &str = r#"{"title":"effigy.frame","type":"object","properties":{"id":{"type":"integer","minimum":0}},"required":["id"]}"#;

/// The JSON message of something that happened while recording.
#[derive(serde::Serialize, serde::Deserialize)]
pub(crate) struct EventMessage {
    pub(crate) name: String,
    pub(crate) value: serde_json::Value,
}

pub(crate) const EVENT_SCHEMA: &str = r#"{"title":"effigy.event","type":"object","properties":{"name":{"type":"string"},"value":{}},"required":["name","value"]}"#;

/// The metadata record with everything that stays the same.
pub(crate) mod head {
    pub(crate) const NAME: &str = "effigy.recording";
    pub(crate) const VERSION_KEY: &str = "version";
    pub(crate) const VERSION: &str = "1";
    pub(crate) const CALIBRATION: &str = "calibration";
    pub(crate) const CRC: &str = "crc32";
    /// In front of every key of the caller's metadata.
    pub(crate) const META: &str = "meta.";
}

/// What is the same for the whole recording.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Head {
    pub(crate) calibration: Calibration,
    pub(crate) metadata: BTreeMap<String, String>,
}

impl Head {
    pub(crate) fn to_record(&self) -> Result<BTreeMap<String, String>, CaptureError> {
        self.calibration.check()?;
        let calibration =
            serde_json::to_string(&self.calibration).expect("plain data always serialises");
        let mut entries: BTreeMap<String, String> = self
            .metadata
            .iter()
            .map(|(key, value)| (format!("{}{key}", head::META), value.clone()))
            .collect();
        entries.insert(head::VERSION_KEY.to_owned(), head::VERSION.to_owned());
        entries.insert(head::CALIBRATION.to_owned(), calibration);
        let crc = crc_of(&entries);
        entries.insert(head::CRC.to_owned(), format!("{crc:08x}"));
        Ok(entries)
    }

    pub(crate) fn from_record(mut entries: BTreeMap<String, String>) -> Result<Self, String> {
        let stored = entries.remove(head::CRC).ok_or("its crc32 is missing")?;
        let computed = format!("{:08x}", crc_of(&entries));
        if stored != computed {
            return Err(format!(
                "its crc32 is {computed}, stored is {stored}: bytes were changed"
            ));
        }
        let version = entries
            .get(head::VERSION_KEY)
            .map_or("none", String::as_str);
        if version != head::VERSION {
            return Err(format!(
                "its format version is {version}, this program reads {}",
                head::VERSION
            ));
        }
        let json = entries
            .get(head::CALIBRATION)
            .ok_or("its calibration is missing")?;
        let calibration: Calibration =
            serde_json::from_str(json).map_err(|error| error.to_string())?;
        calibration.check().map_err(|error| error.to_string())?;
        let metadata = entries
            .into_iter()
            .filter_map(|(key, value)| Some((key.strip_prefix(head::META)?.to_owned(), value)))
            .collect();
        Ok(Self { calibration, metadata })
    }
}

/// Of every key and value in order, each followed by a zero byte.
fn crc_of(entries: &BTreeMap<String, String>) -> u32 {
    let mut hasher = crc32fast::Hasher::new();
    for text in entries.iter().flat_map(|(key, value)| [key, value]) {
        hasher.update(text.as_bytes());
        hasher.update(&[0]);
    }
    hasher.finalize()
}
