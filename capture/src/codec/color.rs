//! Colour as PNG or JPEG.

use std::io::Cursor;

use image::{ImageEncoder as _, ImageFormat, ImageReader, Limits, codecs::jpeg::JpegEncoder};
use serde::{Deserialize, Serialize};

use super::{MAX_PIXELS, check_size};
use crate::image::ColorImage;

/// How a recording stores colour.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ColorCodec {
    /// Lossless, so that a replay repeats itself.
    #[default]
    Png,
    /// Ten times smaller.
    Jpeg { quality_percent: u8 },
}

impl ColorCodec {
    /// The word that Foxglove's `CompressedImage.format` wants.
    pub(crate) fn format(self) -> &'static str {
        match self {
            Self::Png => "png",
            Self::Jpeg { .. } => "jpeg",
        }
    }
}

pub(crate) fn encode(image: &ColorImage, codec: ColorCodec) -> Result<Vec<u8>, String> {
    match codec {
        ColorCodec::Png => encode_png(image).map_err(|error| error.to_string()),
        ColorCodec::Jpeg { quality_percent } => {
            let mut bytes = Vec::new();
            let pixels = image.pixels().as_flattened();
            JpegEncoder::new_with_quality(&mut bytes, quality_percent.clamp(1, 100))
                .write_image(
                    pixels,
                    image.width(),
                    image.height(),
                    image::ColorType::Rgb8.into(),
                )
                .map_err(|error| error.to_string())?;
            Ok(bytes)
        }
    }
}

pub(crate) fn decode(bytes: &[u8]) -> Result<ColorImage, String> {
    match bytes {
        [0x89, b'P', b'N', b'G', ..] => decode_png(bytes),
        [0xff, 0xd8, ..] => decode_with_library(bytes, ImageFormat::Jpeg),
        _ => Err("expected a PNG or JPEG colour image".to_owned()),
    }
}

fn encode_png(image: &ColorImage) -> Result<Vec<u8>, png::EncodingError> {
    let mut bytes = Vec::with_capacity(image.pixels().len());
    let mut encoder = png::Encoder::new(&mut bytes, image.width(), image.height());
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_compression(png::Compression::Fastest);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(image.pixels().as_flattened())?;
    writer.finish()?;
    Ok(bytes)
}

/// Decodes 8-bit RGB straight into its pixels; palettes, alpha and grey go through the library.
fn decode_png(bytes: &[u8]) -> Result<ColorImage, String> {
    let mut decoder = png::Decoder::new(Cursor::new(bytes));
    let header = decoder
        .read_header_info()
        .map_err(|error| error.to_string())?;
    let (width, height) = header.size();
    check_size(width, height)?;
    if (header.color_type, header.bit_depth) != (png::ColorType::Rgb, png::BitDepth::Eight) {
        return decode_with_library(bytes, ImageFormat::Png);
    }
    let mut pixels = vec![[0; 3]; width as usize * height as usize];
    let mut reader = decoder.read_info().map_err(|error| error.to_string())?;
    reader
        .next_frame(pixels.as_flattened_mut())
        .map_err(|error| error.to_string())?;
    ColorImage::new(width, height, pixels).map_err(|error| error.to_string())
}

fn decode_with_library(bytes: &[u8], format: ImageFormat) -> Result<ColorImage, String> {
    let size = ImageReader::with_format(Cursor::new(bytes), format).into_dimensions();
    let (width, height) = size.map_err(|error| error.to_string())?;
    check_size(width, height)?;
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    let mut limits = Limits::default();
    limits.max_alloc = Some(8 * MAX_PIXELS);
    reader.limits(limits);
    let rgb = reader
        .decode()
        .map_err(|error| error.to_string())?
        .into_rgb8();
    let pixels = rgb.into_raw().as_chunks::<3>().0.to_vec();
    ColorImage::new(width, height, pixels).map_err(|error| error.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gradient() -> ColorImage {
        let pixels = (0..48u32 * 32)
            .map(|i| [(i % 48) as u8 * 5, (i / 48) as u8 * 7, 90])
            .collect();
        ColorImage::new(48, 32, pixels).unwrap()
    }

    #[test]
    fn png_keeps_every_colour() {
        let image = gradient();
        assert_eq!(
            decode(&encode(&image, ColorCodec::Png).unwrap()).unwrap(),
            image
        );
    }

    #[test]
    fn jpeg_keeps_a_smooth_picture_within_a_few_levels() {
        let image = gradient();
        let bytes = encode(&image, ColorCodec::Jpeg { quality_percent: 95 }).unwrap();
        let worst = decode(&bytes)
            .unwrap()
            .pixels()
            .as_flattened()
            .iter()
            .zip(image.pixels().as_flattened())
            .map(|(a, b)| a.abs_diff(*b))
            .max();
        // Chroma is stored at half resolution; this gradient steps by 5 and 7 levels a pixel.
        assert!(worst.unwrap() <= 16, "worst difference is {worst:?} levels");
    }
}
