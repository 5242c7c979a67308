//! Depth as binary 16-bit PGM, which some RGB-D folders hold.

use super::check_size;
use crate::image::DepthImage;

pub(crate) fn decode(bytes: &[u8]) -> Result<DepthImage, String> {
    let rest = bytes
        .strip_prefix(b"P5")
        .ok_or("expected a binary PGM (P5)")?;
    let (width, rest) = number(rest)?;
    let (height, rest) = number(rest)?;
    let (largest, rest) = number(rest)?;
    check_size(width, height)?;
    if !(256..=65535).contains(&largest) {
        return Err(format!(
            "expected 16-bit grey values, the largest is declared as {largest}"
        ));
    }
    let count = width as usize * height as usize;
    // One white space after the header, then big-endian values.
    let pixels = rest.get(1..1 + 2 * count).ok_or_else(|| {
        format!(
            "expected {} bytes of pixels, found {}",
            2 * count,
            rest.len().saturating_sub(1)
        )
    })?;
    let pixels = pixels
        .as_chunks::<2>()
        .0
        .iter()
        .map(|pair| u16::from_be_bytes(*pair))
        .collect();
    DepthImage::new(width, height, pixels).map_err(|error| error.to_string())
}

/// The next number of the header, past white space and comments, and what follows it.
fn number(mut bytes: &[u8]) -> Result<(u32, &[u8]), String> {
    loop {
        match bytes {
            [b'#', ..] => {
                let line = bytes.iter().position(|&byte| byte == b'\n');
                bytes = &bytes[line.ok_or("the header ends inside a comment")?..];
            }
            [byte, rest @ ..] if byte.is_ascii_whitespace() => bytes = rest,
            _ => break,
        }
    }
    let digits = bytes
        .iter()
        .take_while(|byte| byte.is_ascii_digit())
        .count();
    let text = str::from_utf8(&bytes[..digits]).expect("digits are ASCII");
    let value = text
        .parse()
        .map_err(|error| format!("a number is missing in the header: {error}"))?;
    Ok((value, &bytes[digits..]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reads_big_endian_pixels_after_comments() {
        let image = decode(b"P5\n# made by hand\n2 1\n65535\n\x01\x02\xff\x00").unwrap();
        assert_eq!(image.pixels(), [0x0102, 0xff00]);
    }

    #[test]
    fn short_eight_bit_and_headerless_files_are_refused() {
        assert!(
            decode(b"P5 2 1 65535\n\x01\x02")
                .unwrap_err()
                .contains("expected 4 bytes")
        );
        assert!(
            decode(b"P5 2 1 255\n\x01\x02")
                .unwrap_err()
                .contains("16-bit")
        );
        assert!(decode(b"P5 2").unwrap_err().contains("number is missing"));
    }
}
