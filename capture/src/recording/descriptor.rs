//! Protobuf descriptions of the Foxglove messages, built here so that no `protoc` is needed.
//!
//! MCAP wants a serialised `FileDescriptorSet` beside each protobuf channel; these are the few fields of
//! `google/protobuf/descriptor.proto` that it takes.

use prost::Message;

#[derive(Clone, PartialEq, Message)]
struct FileDescriptorSet {
    #[prost(message, repeated, tag = "1")]
    file: Vec<FileDescriptor>,
}

#[derive(Clone, PartialEq, Message)]
struct FileDescriptor {
    #[prost(string, tag = "1")]
    name: String,
    #[prost(string, tag = "2")]
    package: String,
    #[prost(string, repeated, tag = "3")]
    dependency: Vec<String>,
    #[prost(message, repeated, tag = "4")]
    message_type: Vec<MessageDescriptor>,
    #[prost(string, tag = "12")]
    syntax: String,
}

#[derive(Clone, PartialEq, Message)]
struct MessageDescriptor {
    #[prost(string, tag = "1")]
    name: String,
    #[prost(message, repeated, tag = "2")]
    field: Vec<FieldDescriptor>,
}

#[derive(Clone, PartialEq, Message)]
struct FieldDescriptor {
    #[prost(string, tag = "1")]
    name: String,
    #[prost(int32, tag = "3")]
    number: i32,
    /// 1 is optional, 3 is repeated.
    #[prost(int32, tag = "4")]
    label: i32,
    #[prost(int32, tag = "5")]
    kind: i32,
    #[prost(string, optional, tag = "6")]
    type_name: Option<String>,
}

/// `FieldDescriptorProto.Type`.
const DOUBLE: i32 = 1;
const INT64: i32 = 3;
const INT32: i32 = 5;
const FIXED32: i32 = 7;
const STRING: i32 = 9;
const MESSAGE: i32 = 11;
const BYTES: i32 = 12;

const TIMESTAMP: &str = "google.protobuf.Timestamp";

pub(crate) const COMPRESSED_IMAGE: &str = "foxglove.CompressedImage";
pub(crate) const CAMERA_CALIBRATION: &str = "foxglove.CameraCalibration";
pub(crate) const FRAME_TRANSFORM: &str = "foxglove.FrameTransform";

pub(crate) fn compressed_image() -> Vec<u8> {
    let fields = vec![
        of(TIMESTAMP, "timestamp", 1),
        one(BYTES, "data", 2),
        one(STRING, "format", 3),
        one(STRING, "frame_id", 4),
    ];
    set(vec![
        timestamp(),
        file(COMPRESSED_IMAGE, &[TIMESTAMP], fields),
    ])
}

pub(crate) fn camera_calibration() -> Vec<u8> {
    let mut fields = vec![
        of(TIMESTAMP, "timestamp", 1),
        one(FIXED32, "width", 2),
        one(FIXED32, "height", 3),
        one(STRING, "distortion_model", 4),
    ];
    fields.extend(
        ["D", "K", "R", "P"]
            .into_iter()
            .zip(5..)
            .map(|(name, number)| many_doubles(name, number)),
    );
    fields.push(one(STRING, "frame_id", 9));
    set(vec![
        timestamp(),
        file(CAMERA_CALIBRATION, &[TIMESTAMP], fields),
    ])
}

pub(crate) fn frame_transform() -> Vec<u8> {
    const VECTOR3: &str = "foxglove.Vector3";
    const QUATERNION: &str = "foxglove.Quaternion";
    let doubles = |names: &[&str]| {
        names
            .iter()
            .zip(1..)
            .map(|(name, number)| one(DOUBLE, name, number))
            .collect()
    };
    let fields = vec![
        of(TIMESTAMP, "timestamp", 1),
        one(STRING, "parent_frame_id", 2),
        one(STRING, "child_frame_id", 3),
        of(VECTOR3, "translation", 4),
        of(QUATERNION, "rotation", 5),
    ];
    set(vec![
        timestamp(),
        file(VECTOR3, &[], doubles(&["x", "y", "z"])),
        file(QUATERNION, &[], doubles(&["x", "y", "z", "w"])),
        file(FRAME_TRANSFORM, &[TIMESTAMP, VECTOR3, QUATERNION], fields),
    ])
}

fn set(file: Vec<FileDescriptor>) -> Vec<u8> {
    FileDescriptorSet { file }.encode_to_vec()
}

fn timestamp() -> FileDescriptor {
    file(
        TIMESTAMP,
        &[],
        vec![one(INT64, "seconds", 1), one(INT32, "nanos", 2)],
    )
}

/// A file with one message, named as its makers name it: `foxglove/CompressedImage.proto`.
fn file(message: &str, imports: &[&str], field: Vec<FieldDescriptor>) -> FileDescriptor {
    let (package, name) = message.rsplit_once('.').expect("names here have a package");
    FileDescriptor {
        name: file_name(message),
        package: package.to_owned(),
        dependency: imports.iter().map(|message| file_name(message)).collect(),
        message_type: vec![MessageDescriptor { name: name.to_owned(), field }],
        syntax: "proto3".to_owned(),
    }
}

fn file_name(message: &str) -> String {
    match message {
        TIMESTAMP => "google/protobuf/timestamp.proto".to_owned(),
        _ => format!("{}.proto", message.replace('.', "/")),
    }
}

fn one(kind: i32, name: &str, number: i32) -> FieldDescriptor {
    FieldDescriptor { name: name.to_owned(), number, label: 1, kind, type_name: None }
}

fn many_doubles(name: &str, number: i32) -> FieldDescriptor {
    FieldDescriptor { label: 3, ..one(DOUBLE, name, number) }
}

fn of(message: &str, name: &str, number: i32) -> FieldDescriptor {
    FieldDescriptor { type_name: Some(format!(".{message}")), ..one(MESSAGE, name, number) }
}
