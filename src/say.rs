//! Talking to whoever reads standard output, even when they have stopped reading.

use std::{
    fmt,
    io::{self, ErrorKind, Write as _},
};

/// As `println!`, but a reader who has left (`effigy info FILE | head -1`) is no reason to stop.
macro_rules! say {
    ($($argument:tt)*) => {
        $crate::say::line(format_args!($($argument)*))
    };
}

pub(crate) use say;

/// What stands behind [`say!`].
pub(crate) fn line(text: fmt::Arguments<'_>) {
    if let Err(error) = writeln!(io::stdout(), "{text}")
        && error.kind() != ErrorKind::BrokenPipe
    {
        eprintln!("effigy: standard output: {error}");
    }
}
