//! Depth as 16-bit greyscale PNG, at the level that keeps up with a sensor.

use std::io::Cursor;

use png::{BitDepth, ColorType, Compression, Decoder, Encoder, Limits};

use super::check_size;
use crate::image::DepthImage;

/// Lossless, and about 2 ms for 640x576; the default level takes fifty times that on sensor noise.
const LEVEL: Compression = Compression::Fast;

/// What decoding may allocate beside the pixels: a few rows and the tables of inflate.
const DECODER_BYTES: usize = 64 * 1024 * 1024;

pub(crate) fn encode(depth: &DepthImage) -> Result<Vec<u8>, String> {
    let big_endian: Vec<u8> = depth
        .pixels()
        .iter()
        .flat_map(|value| value.to_be_bytes())
        .collect();
    let mut bytes = Vec::with_capacity(big_endian.len() / 2);
    let mut encoder = Encoder::new(&mut bytes, depth.width(), depth.height());
    encoder.set_color(ColorType::Grayscale);
    encoder.set_depth(BitDepth::Sixteen);
    encoder.set_compression(LEVEL);
    let mut writer = encoder.write_header().map_err(|error| error.to_string())?;
    writer
        .write_image_data(&big_endian)
        .map_err(|error| error.to_string())?;
    writer.finish().map_err(|error| error.to_string())?;
    Ok(bytes)
}

pub(crate) fn decode(bytes: &[u8]) -> Result<DepthImage, String> {
    let limits = Limits { bytes: DECODER_BYTES };
    let mut decoder = Decoder::new_with_limits(Cursor::new(bytes), limits);
    let header = decoder
        .read_header_info()
        .map_err(|error| format!("not a readable PNG: {error}"))?;
    check_size(header.width, header.height)?;
    if (header.color_type, header.bit_depth) != (ColorType::Grayscale, BitDepth::Sixteen) {
        return Err(format!(
            "expected a 16-bit greyscale PNG, found {:?} with {:?} bits",
            header.color_type, header.bit_depth
        ));
    }
    let (width, height) = header.size();
    let mut reader = decoder.read_info().map_err(|error| error.to_string())?;
    let mut pixels = vec![0u16; width as usize * height as usize];
    reader
        .next_frame(bytemuck::cast_slice_mut(&mut pixels))
        .map_err(|error| error.to_string())?;
    for value in &mut pixels {
        *value = u16::from_be(*value);
    }
    DepthImage::new(width, height, pixels).map_err(|error| error.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_depth_value_survives() {
        let all: Vec<u16> = (0..=u16::MAX).rev().collect();
        let image = DepthImage::new(256, 256, all).unwrap();
        assert_eq!(decode(&encode(&image).unwrap()).unwrap(), image);
    }

    #[test]
    fn colour_and_broken_files_are_refused_with_the_reason() {
        let mut bytes = Vec::new();
        let mut encoder = Encoder::new(&mut bytes, 2, 1);
        encoder.set_color(ColorType::Rgb);
        encoder
            .write_header()
            .unwrap()
            .write_image_data(&[0; 6])
            .unwrap();
        assert!(decode(&bytes).unwrap_err().contains("16-bit greyscale"));
        assert!(
            decode(b"no image")
                .unwrap_err()
                .contains("not a readable PNG")
        );
    }
}
