//! Marc Lehmann's LZF, in which PCL compresses clouds.

/// Unpacks to exactly `length` bytes. `None` if the data are not that.
pub(super) fn decompress(mut packed: &[u8], length: usize) -> Option<Vec<u8>> {
    let mut out = Vec::with_capacity(length);
    while let [control, rest @ ..] = packed {
        packed = rest;
        let control = usize::from(*control);
        if control < 32 {
            let (literal, rest) = packed.split_at_checked(control + 1)?;
            out.extend_from_slice(literal);
            packed = rest;
        } else {
            let mut run = control >> 5;
            if run == 7 {
                let (more, rest) = packed.split_first()?;
                run += usize::from(*more);
                packed = rest;
            }
            let (low, rest) = packed.split_first()?;
            packed = rest;
            let back = ((control & 31) << 8) + usize::from(*low) + 1;
            let start = out.len().checked_sub(back)?;
            // The run may overlap what it writes.
            for index in start..start + run + 2 {
                out.push(out[index]);
            }
        }
        if out.len() > length {
            return None;
        }
    }
    (out.len() == length).then_some(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn literals_and_overlapping_runs_unpack() {
        // "ab", then four bytes from two back: "abab".
        assert_eq!(
            decompress(&[1, b'a', b'b', 2 << 5, 1], 6).unwrap(),
            b"ababab"
        );
        // A long run: 7 + 3 + 2 bytes from one back.
        assert_eq!(
            decompress(&[0, b'x', 7 << 5, 3, 0], 13).unwrap(),
            [b'x'; 13]
        );
    }

    #[test]
    fn broken_data_are_refused() {
        assert_eq!(decompress(&[5, 1, 2], 6), None);
        assert_eq!(decompress(&[1 << 5, 0], 3), None);
        assert_eq!(decompress(&[7 << 5], 3), None);
        assert_eq!(decompress(&[0, 1], 2), None);
        assert_eq!(decompress(&[0, 1, 7 << 5, 255, 0], 10), None);
    }
}
