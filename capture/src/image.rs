//! Row-major images as a sensor delivers them.

use crate::error::CaptureError;

/// Raw depth in sensor units; 0 means "no measurement".
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DepthImage {
    width: u32,
    height: u32,
    data: Vec<u16>,
}

/// Colour, 8 bits a channel, RGB.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ColorImage {
    width: u32,
    height: u32,
    data: Vec<[u8; 3]>,
}

impl DepthImage {
    pub fn new(width: u32, height: u32, data: Vec<u16>) -> Result<Self, CaptureError> {
        check_size("depth", width, height, data.len())?;
        Ok(Self { width, height, data })
    }

    pub fn width(&self) -> u32 {
        self.width
    }

    pub fn height(&self) -> u32 {
        self.height
    }

    pub fn pixels(&self) -> &[u16] {
        &self.data
    }
}

impl ColorImage {
    pub fn new(width: u32, height: u32, data: Vec<[u8; 3]>) -> Result<Self, CaptureError> {
        check_size("colour", width, height, data.len())?;
        Ok(Self { width, height, data })
    }

    pub fn width(&self) -> u32 {
        self.width
    }

    pub fn height(&self) -> u32 {
        self.height
    }

    pub fn pixels(&self) -> &[[u8; 3]] {
        &self.data
    }
}

fn check_size(what: &'static str, width: u32, height: u32, got: usize) -> Result<(), CaptureError> {
    if width as usize * height as usize == got {
        return Ok(());
    }
    Err(CaptureError::PixelCount { what, width, height, got })
}
