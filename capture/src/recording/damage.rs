//! What of a recording cannot be read.

use std::fmt::{self, Display};

use serde::{Deserialize, Serialize};

/// A recording's missing and unreadable parts. What lies before and between them plays.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Damage {
    /// Where the first unreadable byte lies.
    pub at_byte: u64,
    /// Bytes that are there and cannot be used.
    pub unreadable_bytes: u64,
    /// Bytes that the last record announces and the file does not have: at least this much was cut off.
    pub missing_bytes: u64,
    /// Chunks that are inconsistent or fail their checksum.
    pub broken_chunks: u32,
    /// Whether the index that ends a finished recording is absent.
    pub unfinished: bool,
    /// What was found first, in words.
    pub reason: String,
}

impl Damage {
    pub(super) fn note(&mut self, at_byte: u64, unreadable_bytes: u64, reason: String) {
        if self.reason.is_empty() {
            self.at_byte = at_byte;
            self.reason = reason;
        }
        self.unreadable_bytes += unreadable_bytes;
    }

    pub(super) fn lose_chunk(&mut self, at_byte: u64, bytes: u64, reason: &str) {
        self.broken_chunks += 1;
        self.note(at_byte, bytes, format!("a chunk is broken ({reason})"));
    }

    pub(super) fn is_none(&self) -> bool {
        self.reason.is_empty()
    }
}

impl Display for Damage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} at byte {}", self.reason, self.at_byte)?;
        write!(f, "; {} bytes cannot be read", self.unreadable_bytes)?;
        if self.missing_bytes > 0 {
            write!(f, ", at least {} are missing", self.missing_bytes)?;
        }
        if self.broken_chunks > 0 {
            write!(f, ", {} chunks are broken", self.broken_chunks)?;
        }
        if self.unfinished {
            write!(f, "; the recording was never finished")?;
        }
        Ok(())
    }
}
