//! The window, and the same pictures as files.
