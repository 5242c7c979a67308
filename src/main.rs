//! Effigy: one depth camera in, a live avatar out.

fn main() {}
