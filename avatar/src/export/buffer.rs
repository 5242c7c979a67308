//! The binary part of a GLB: packed arrays, each with the view and accessor that describe it.

use gltf_json::{
    Accessor, Buffer, Extras, Index, Root, Value,
    accessor::{ComponentType, GenericComponentType, Type},
    buffer::{Target, View},
    validation::{Checked::Valid, USize64},
};

/// Grows the binary buffer and, beside it, the JSON's views and accessors.
pub(super) struct BufferBuilder {
    bytes: Vec<u8>,
    buffer: Index<Buffer>,
}

/// How an array is to be read.
#[derive(Clone, Copy)]
pub(super) struct Format {
    pub(super) component: ComponentType,
    pub(super) shape: Type,
    pub(super) normalized: bool,
    pub(super) target: Option<Target>,
}

/// Whether an accessor states its smallest and largest value.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Bounds {
    Written,
    Left,
}

impl Format {
    pub(super) fn floats(shape: Type) -> Self {
        Self { component: ComponentType::F32, shape, normalized: false, target: None }
    }

    pub(super) fn of_vertices(self) -> Self {
        Self { target: Some(Target::ArrayBuffer), ..self }
    }
}

impl BufferBuilder {
    pub(super) fn new(root: &mut Root) -> Self {
        let buffer = root.push(Buffer {
            byte_length: USize64(0),
            name: None,
            uri: None,
            extensions: None,
            extras: Extras::default(),
        });
        Self { bytes: Vec::new(), buffer }
    }

    /// Adds an array; `bytes` holds `count` elements without padding.
    pub(super) fn push(
        &mut self,
        root: &mut Root,
        bytes: &[u8],
        count: usize,
        format: Format,
    ) -> Index<Accessor> {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let view = root.push(View {
            buffer: self.buffer,
            byte_length: USize64::from(bytes.len()),
            byte_offset: Some(USize64::from(self.bytes.len())),
            byte_stride: None,
            name: None,
            target: format.target.map(Valid),
            extensions: None,
            extras: Extras::default(),
        });
        self.bytes.extend(bytes);
        root.push(Accessor {
            buffer_view: Some(view),
            byte_offset: None,
            count: USize64::from(count),
            component_type: Valid(GenericComponentType(format.component)),
            type_: Valid(format.shape),
            normalized: format.normalized,
            min: None,
            max: None,
            name: None,
            sparse: None,
            extensions: None,
            extras: Extras::default(),
        })
    }

    /// Adds float vectors of `N` components, with their bounds where `bounds` asks for them.
    pub(super) fn push_floats<const N: usize>(
        &mut self,
        root: &mut Root,
        rows: &[[f32; N]],
        format: Format,
        bounds: Bounds,
    ) -> Index<Accessor> {
        let accessor = self.push(
            root,
            bytemuck::cast_slice(rows.as_flattened()),
            rows.len(),
            format,
        );
        if bounds == Bounds::Written {
            let fold = |start: f32, pick: fn(f32, f32) -> f32| -> [f32; N] {
                std::array::from_fn(|axis| rows.iter().map(|row| row[axis]).fold(start, pick))
            };
            let described = &mut root.accessors[accessor.value()];
            described.min = Some(Value::from(fold(f32::INFINITY, f32::min).to_vec()));
            described.max = Some(Value::from(fold(f32::NEG_INFINITY, f32::max).to_vec()));
        }
        accessor
    }

    /// The finished binary part, padded to whole words.
    pub(super) fn finish(mut self, root: &mut Root) -> Vec<u8> {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        root.buffers[self.buffer.value()].byte_length = USize64::from(self.bytes.len());
        self.bytes
    }
}
