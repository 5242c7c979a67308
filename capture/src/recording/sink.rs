//! Frames into MCAP, on the caller's thread.

use std::{
    collections::BTreeMap,
    io::{self, Write},
};

use mcap::{
    McapResult,
    records::{MessageHeader, Metadata},
    write::{NoSeek, WriteOptions, Writer},
};
use prost::Message as _;

use super::{
    descriptor,
    format::{EVENT_SCHEMA, EventMessage, FRAME_SCHEMA, FrameMessage, Head, head, space, topic},
    foxglove::{CameraCalibration, CompressedImage, FrameTransform},
};
use crate::{
    calibration::Calibration,
    codec::{
        color::{self, ColorCodec},
        depth_png,
    },
    error::CaptureError,
    frame::Frame,
    time::{FrameId, Timestamp},
};

/// Chunks close after the frame that passes this: small enough to lose little, large enough to index quickly.
const CHUNK_BYTES: usize = 1024 * 1024;
/// And after this long on the source's clock, so that a crash costs a second at most.
const CHUNK_SECS: f64 = 1.0;

/// Writes frames and events; whole frames share a chunk.
pub(super) struct Sink<W: Write> {
    mcap: Writer<NoSeek<CountBytes<W>>>,
    channels: Channels,
    calibration: Calibration,
    color_codec: ColorCodec,
    open_chunk: Option<OpenChunk>,
    pub(super) frames: u64,
    pub(super) events: u64,
    pub(super) first_and_last: Option<(Timestamp, Timestamp)>,
}

struct OpenChunk {
    started_at: Timestamp,
    bytes: usize,
}

struct Channels {
    depth: u16,
    depth_calibration: u16,
    color: u16,
    color_calibration: u16,
    transforms: u16,
    frame: u16,
    event: u16,
}

impl<W: Write> Sink<W> {
    /// Writes and flushes what a reader needs before the first frame.
    pub(super) fn new(writer: W, head: &Head, color_codec: ColorCodec) -> Result<Self, SinkError> {
        let record = head.to_record()?;
        let mut mcap = WriteOptions::new()
            .compression(None)
            .profile("")
            .library(concat!("effigy ", env!("CARGO_PKG_VERSION")))
            .chunk_size(None)
            .disable_seeking(true)
            .create(NoSeek::new(CountBytes { inner: writer, bytes: 0 }))?;
        mcap.write_metadata(&Metadata { name: head::NAME.to_owned(), metadata: record })?;
        mcap.flush()?;
        // Channels open the first chunk, which the first frames close: viewers take the time of a chunk without messages
        // for 1970.
        let channels = Channels::add_to(&mut mcap)?;
        Ok(Self {
            mcap,
            channels,
            calibration: head.calibration.clone(),
            color_codec,
            open_chunk: None,
            frames: 0,
            events: 0,
            first_and_last: None,
        })
    }

    pub(super) fn frame(&mut self, frame: &Frame) -> Result<(), SinkError> {
        let png = depth_png::encode(&frame.depth).map_err(SinkError::Image)?;
        let color = match &frame.color {
            Some(color) => Some(color::encode(color, self.color_codec).map_err(SinkError::Image)?),
            None => None,
        };
        if self.open_chunk.is_none() {
            self.begin_chunk(frame.timestamp)?;
        }
        let (id, time) = (frame.id, frame.timestamp);
        let image = |space: &str, format: &str, data| CompressedImage {
            timestamp: Some(time.into()),
            data,
            format: format.to_owned(),
            frame_id: space.to_owned(),
        };
        let depth = image(space::DEPTH_CAMERA, "png", png);
        self.message(self.channels.depth, id, time, &depth.encode_to_vec())?;
        if let Some(color) = color {
            let color = image(space::COLOR_CAMERA, self.color_codec.format(), color);
            self.message(self.channels.color, id, time, &color.encode_to_vec())?;
        }
        let message = serde_json::to_vec(&FrameMessage { id: id.0 }).expect("a number serialises");
        self.message(self.channels.frame, id, time, &message)?;
        self.frames += 1;
        let (first, _) = self.first_and_last.unwrap_or((time, time));
        self.first_and_last = Some((first, time));
        let full = self.open_chunk.as_ref().is_some_and(|chunk| {
            chunk.bytes >= CHUNK_BYTES || (time - chunk.started_at).abs() >= CHUNK_SECS
        });
        if full { self.flush() } else { Ok(()) }
    }

    pub(super) fn event(
        &mut self,
        name: &str,
        time: Timestamp,
        value: &serde_json::Value,
    ) -> Result<(), SinkError> {
        if self.open_chunk.is_none() {
            self.begin_chunk(time)?;
        }
        let event = EventMessage { name: name.to_owned(), value: value.clone() };
        let message = serde_json::to_vec(&event).expect("JSON serialises");
        self.message(self.channels.event, FrameId(self.events), time, &message)?;
        self.events += 1;
        Ok(())
    }

    /// Ends the chunk, so that everything so far can be read even if nothing follows.
    pub(super) fn flush(&mut self) -> Result<(), SinkError> {
        if self.open_chunk.take().is_some() {
            self.mcap.flush()?;
        }
        Ok(())
    }

    /// Writes the closing index and gives the stream back.
    pub(super) fn finish(&mut self) -> Result<(), SinkError> {
        self.flush()?;
        self.mcap.finish()?;
        Ok(())
    }

    pub(super) fn into_inner(self) -> (W, u64) {
        let CountBytes { inner, bytes } = self.mcap.into_inner().into_inner();
        (inner, bytes)
    }

    /// Each chunk starts with the cameras and where they stand, so that viewers can start anywhere.
    fn begin_chunk(&mut self, time: Timestamp) -> Result<(), SinkError> {
        self.open_chunk = Some(OpenChunk { started_at: time, bytes: 0 });
        let id = FrameId(self.frames);
        let depth = CameraCalibration::new(&self.calibration.depth, space::DEPTH_CAMERA, time);
        self.message(
            self.channels.depth_calibration,
            id,
            time,
            &depth.encode_to_vec(),
        )?;
        if let Some(camera) = &self.calibration.color {
            let color = CameraCalibration::new(camera, space::COLOR_CAMERA, time);
            self.message(
                self.channels.color_calibration,
                id,
                time,
                &color.encode_to_vec(),
            )?;
            let depth_from_color = self.calibration.color_from_depth.inverse();
            let transform = FrameTransform::new(
                space::DEPTH_CAMERA,
                space::COLOR_CAMERA,
                depth_from_color,
                time,
            );
            self.message(
                self.channels.transforms,
                id,
                time,
                &transform.encode_to_vec(),
            )?;
        }
        if let Some(world_from_camera) = self.calibration.world_from_camera {
            let transform =
                FrameTransform::new(space::WORLD, space::DEPTH_CAMERA, world_from_camera, time);
            self.message(
                self.channels.transforms,
                id,
                time,
                &transform.encode_to_vec(),
            )?;
        }
        Ok(())
    }

    /// The sequence number holds the id's low half; the frame message holds all of it.
    fn message(
        &mut self,
        channel_id: u16,
        id: FrameId,
        Timestamp(log_time): Timestamp,
        data: &[u8],
    ) -> Result<(), SinkError> {
        let header =
            MessageHeader { channel_id, sequence: id.0 as u32, log_time, publish_time: log_time };
        self.mcap.write_to_known_channel(&header, data)?;
        if let Some(chunk) = &mut self.open_chunk {
            chunk.bytes += data.len();
        }
        Ok(())
    }
}

impl Channels {
    fn add_to<W: Write + io::Seek>(mcap: &mut Writer<W>) -> McapResult<Self> {
        let protobuf =
            |mcap: &mut Writer<W>, name: &str, data: &[u8]| mcap.add_schema(name, "protobuf", data);
        let image = protobuf(
            mcap,
            descriptor::COMPRESSED_IMAGE,
            &descriptor::compressed_image(),
        )?;
        let camera = protobuf(
            mcap,
            descriptor::CAMERA_CALIBRATION,
            &descriptor::camera_calibration(),
        )?;
        let transform = protobuf(
            mcap,
            descriptor::FRAME_TRANSFORM,
            &descriptor::frame_transform(),
        )?;
        let frame = mcap.add_schema("effigy.frame", "jsonschema", FRAME_SCHEMA.as_bytes())?;
        let event = mcap.add_schema("effigy.event", "jsonschema", EVENT_SCHEMA.as_bytes())?;
        let mut add =
            |schema, topic, encoding| mcap.add_channel(schema, topic, encoding, &BTreeMap::new());
        Ok(Self {
            depth: add(image, topic::DEPTH, "protobuf")?,
            depth_calibration: add(camera, topic::DEPTH_CALIBRATION, "protobuf")?,
            color: add(image, topic::COLOR, "protobuf")?,
            color_calibration: add(camera, topic::COLOR_CALIBRATION, "protobuf")?,
            transforms: add(transform, topic::TRANSFORMS, "protobuf")?,
            frame: add(frame, topic::FRAME, "json")?,
            event: add(event, topic::EVENT, "json")?,
        })
    }
}

/// Why a frame could not be written.
#[derive(Debug, thiserror::Error)]
pub(super) enum SinkError {
    #[error(transparent)]
    Head(#[from] CaptureError),
    #[error("{}", reason(.0))]
    Mcap(#[from] mcap::McapError),
    #[error("an image cannot be encoded: {0}")]
    Image(String),
}

/// MCAP wraps what the operating system said; only that helps.
fn reason(error: &mcap::McapError) -> String {
    match error {
        mcap::McapError::Io(io) if io.kind() == io::ErrorKind::StorageFull => {
            format!("the disk is full ({io}): free some space or record elsewhere")
        }
        mcap::McapError::Io(io) => io.to_string(),
        other => other.to_string(),
    }
}

/// Counts what reaches the file.
pub(super) struct CountBytes<W> {
    inner: W,
    bytes: u64,
}

impl<W: Write> Write for CountBytes<W> {
    fn write(&mut self, data: &[u8]) -> io::Result<usize> {
        let count = self.inner.write(data)?;
        self.bytes += count as u64;
        Ok(count)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.inner.flush()
    }
}
