//! Which images a folder holds, and when they were taken: from a listing, or from their names.

use std::{
    fs,
    path::{Path, PathBuf},
};

use super::read_file;
use crate::{error::CaptureError, time::Timestamp};

/// Numbered images come at this rate where nothing says otherwise.
const NUMBERED_RATE_HZ: f64 = 30.0;

/// An image and its time.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Listed {
    pub(super) timestamp: Timestamp,
    /// A running number from the file's name, or the place in the listing.
    pub(super) number: u64,
    pub(super) path: PathBuf,
}

/// TUM's listing: `seconds path` a line, `#` starts a comment; sorted by time.
pub(super) fn from_text(listing: &Path) -> Result<Vec<Listed>, CaptureError> {
    let folder = listing.parent().unwrap_or(Path::new("."));
    let bytes = read_file(listing, "the listing")?;
    let text = String::from_utf8_lossy(&bytes);
    let mut images = Vec::new();
    for (index, line) in text.lines().enumerate() {
        let line = line.trim();
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let entry = line.split_once(char::is_whitespace);
        let parsed =
            entry.and_then(|(time, name)| Some((seconds(time)?, folder.join(name.trim()))));
        let Some((timestamp, path)) = parsed else {
            return Err(CaptureError::BadLine {
                path: listing.to_owned(),
                line: index + 1,
                expected: "a time in seconds and the path of an image",
                found: line.chars().take(80).collect(),
            });
        };
        images.push(Listed { timestamp, number: 0, path });
    }
    images.sort_by_key(|image| image.timestamp);
    for (image, number) in images.iter_mut().zip(0..) {
        image.number = number;
    }
    Ok(images)
}

/// The PNG and PGM (for colour also JPEG) files of a folder, in the order of their names' times or numbers.
pub(super) fn from_names(folder: &Path) -> Result<Vec<Listed>, CaptureError> {
    let mut names = Vec::new();
    for entry in fs::read_dir(folder).map_err(CaptureError::io(folder))? {
        let path = entry.map_err(CaptureError::io(folder))?.path();
        let extension = path
            .extension()
            .and_then(|name| name.to_str())
            .unwrap_or_default()
            .to_lowercase();
        if matches!(extension.as_str(), "png" | "pgm" | "jpg" | "jpeg") {
            names.push(path);
        }
    }
    names.sort();
    let all_in_seconds = names
        .iter()
        .all(|path| stem(path).contains('.') && seconds(&stem(path)).is_some());
    let listed = names.into_iter().zip(0..).map(|(path, place)| {
        let stem = stem(&path);
        let (timestamp, number) = match seconds(&stem) {
            Some(timestamp) if all_in_seconds => (timestamp, place),
            _ => numbered(last_number(&stem).unwrap_or(place), place),
        };
        Listed { timestamp, number, path }
    });
    let mut listed: Vec<Listed> = listed.collect();
    listed.sort_by_key(|image| image.timestamp);
    Ok(listed)
}

fn stem(path: &Path) -> String {
    path.file_stem()
        .map(|stem| stem.to_string_lossy().into_owned())
        .unwrap_or_default()
}

/// The last run of digits in a name: 17 in `frame_000017`.
fn last_number(stem: &str) -> Option<u64> {
    stem.rsplit(|c: char| !c.is_ascii_digit())
        .find(|digits| !digits.is_empty())?
        .parse()
        .ok()
}

/// Time and running number of an image called `number`: Unix times in ms, us and ns have 13, 16 and 19 digits.
fn numbered(number: u64, place: u64) -> (Timestamp, u64) {
    match number {
        1_000_000_000_000_000_000.. => (Timestamp(number), place),
        1_000_000_000_000_000..10_000_000_000_000_000 => (Timestamp(number * 1_000), place),
        1_000_000_000_000..10_000_000_000_000 => (Timestamp(number * 1_000_000), place),
        _ => (
            Timestamp::from_secs_f64(number as f64 / NUMBERED_RATE_HZ),
            number,
        ),
    }
}

/// Decimal seconds to the nanosecond: f64 would round Unix times to 0.1 us.
fn seconds(text: &str) -> Option<Timestamp> {
    let (whole, fraction) = text.split_once('.').unwrap_or((text, ""));
    let digits = |text: &str| text.bytes().all(|byte| byte.is_ascii_digit());
    if whole.is_empty() || !digits(whole) || !digits(fraction) {
        return None;
    }
    let nanos: String = fraction
        .chars()
        .chain("000000000".chars())
        .take(9)
        .collect();
    let nanos: u64 = nanos.parse().ok()?;
    let seconds: u64 = whole.parse().ok()?;
    Some(Timestamp(
        seconds.checked_mul(1_000_000_000)?.checked_add(nanos)?,
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unix_times_keep_their_microseconds() {
        assert_eq!(
            seconds("1305031102.160407"),
            Some(Timestamp(1_305_031_102_160_407_000))
        );
        assert_eq!(seconds("12"), Some(Timestamp(12_000_000_000)));
        for nonsense in [
            "",
            ".5",
            "1e9",
            "-1",
            "1.2.3",
            "99999999999999999999",
            "18446744073709551615",
        ] {
            assert_eq!(seconds(nonsense), None, "{nonsense}");
        }
    }

    #[test]
    fn names_give_numbers_or_unix_times() {
        assert_eq!(last_number("frame_000017"), Some(17));
        assert_eq!(last_number("0_M11_depth_3"), Some(3));
        assert_eq!(last_number("depth"), None);
        assert_eq!(numbered(90, 4), (Timestamp(3_000_000_000), 90));
        assert_eq!(
            numbered(1_700_000_000_123, 4),
            (Timestamp(1_700_000_000_123_000_000), 4)
        );
    }
}
