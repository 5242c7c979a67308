//! Pictures in rows, each with a line of text under it, as one file.

use std::path::Path;

use image::{Rgb, imageops};

use super::{Picture, draw_text, palette, text_width_px};
use crate::error::ViewerError;

/// Between tiles, and around all of them.
const GAP_PX: u32 = 14;
const LABEL_CAP_PX: f32 = 10.5;
const LABEL_BAR_PX: u32 = 28;
const TITLE_CAP_PX: f32 = 15.0;
const TITLE_BAR_PX: u32 = 34;
const MIN_CAP_PX: f32 = 7.0;

/// Collects labelled pictures; a cell is as large as the largest of its column and row.
#[derive(Clone, Debug)]
pub struct ContactSheet {
    columns: usize,
    title: String,
    tiles: Vec<(String, Picture)>,
}

/// Two pictures next to each other, each with its label.
pub fn side_by_side(left: (&str, Picture), right: (&str, Picture)) -> Picture {
    ContactSheet::new(2)
        .add(left.0, left.1)
        .add(right.0, right.1)
        .compose()
}

/// Writes one picture; the file's ending says how (`png`, `jpg`).
pub fn save(picture: &Picture, path: &Path) -> Result<(), ViewerError> {
    picture
        .save(path)
        .map_err(|source| ViewerError::Picture { path: path.to_path_buf(), source })
}

impl ContactSheet {
    pub fn new(columns: usize) -> Self {
        Self { columns: columns.max(1), title: String::new(), tiles: Vec::new() }
    }

    #[must_use]
    pub fn title(mut self, title: impl Into<String>) -> Self {
        self.title = title.into();
        self
    }

    #[must_use]
    pub fn add(mut self, label: impl Into<String>, picture: Picture) -> Self {
        self.tiles.push((label.into(), picture));
        self
    }

    pub fn is_empty(&self) -> bool {
        self.tiles.is_empty()
    }

    /// The whole sheet as one picture.
    pub fn compose(&self) -> Picture {
        let widths = self.largest(|index| index % self.columns, Picture::width);
        let heights = self.largest(|index| index / self.columns, Picture::height);
        let title_px = if self.title.is_empty() {
            0
        } else {
            TITLE_BAR_PX
        };
        let lefts = starts(&widths, GAP_PX, GAP_PX);
        let tops = starts(&heights, GAP_PX + title_px, GAP_PX + LABEL_BAR_PX);
        let size = [
            *lefts.last().expect("starts has an end"),
            *tops.last().expect("as above"),
        ];
        let mut sheet = Picture::from_pixel(size[0], size[1], Rgb(palette::BACKGROUND));
        let title_at = [GAP_PX as f32, GAP_PX as f32 + 2.0];
        draw_text(
            &mut sheet,
            title_at,
            TITLE_CAP_PX,
            palette::TEXT,
            &self.title,
        );
        for (index, (label, picture)) in self.tiles.iter().enumerate() {
            let (column, row) = (index % self.columns, index / self.columns);
            let cell = [lefts[column], tops[row], widths[column], heights[row]];
            draw_tile(&mut sheet, cell, label, picture);
        }
        sheet
    }

    pub fn save(&self, path: &Path) -> Result<(), ViewerError> {
        save(&self.compose(), path)
    }

    /// The largest extent of each group of tiles.
    fn largest(&self, group: impl Fn(usize) -> usize, extent: fn(&Picture) -> u32) -> Vec<u32> {
        let mut largest = Vec::new();
        for (index, (_, picture)) in self.tiles.iter().enumerate() {
            let group = group(index);
            largest.resize(largest.len().max(group + 1), 0);
            largest[group] = largest[group].max(extent(picture));
        }
        largest
    }
}

/// Where each cell starts, and after them the end of the sheet.
fn starts(extents: &[u32], first: u32, gap: u32) -> Vec<u32> {
    let mut starts = vec![first];
    for extent in extents {
        starts.push(starts.last().expect("starts with one") + extent + gap);
    }
    starts
}

fn draw_tile(sheet: &mut Picture, cell: [u32; 4], label: &str, picture: &Picture) {
    let [left, top, width, height] = cell;
    for y in top..top + height + LABEL_BAR_PX {
        for x in left..left + width {
            sheet.put_pixel(x, y, Rgb(palette::PANEL));
        }
    }
    let x = left + (width - picture.width()) / 2;
    let y = top + (height - picture.height()) / 2;
    imageops::replace(sheet, picture, i64::from(x), i64::from(y));
    let room = width as f32 - 12.0;
    let needed = text_width_px(label, LABEL_CAP_PX).max(1.0);
    let cap = (LABEL_CAP_PX * room / needed).clamp(MIN_CAP_PX, LABEL_CAP_PX);
    let indent = 0.5 * (width as f32 - text_width_px(label, cap)).max(0.0);
    let down = 0.5 * (LABEL_BAR_PX as f32 - cap);
    let at = [left as f32 + indent, (top + height) as f32 + down];
    draw_text(sheet, at, cap, palette::TEXT, label);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn red(width: u32, height: u32) -> Picture {
        Picture::from_pixel(width, height, Rgb([200, 0, 0]))
    }

    #[test]
    fn a_sheet_has_room_for_every_tile_and_its_label() {
        let sheet = ContactSheet::new(2)
            .add("one", red(100, 80))
            .add("two", red(60, 120))
            .add("three", red(100, 50));
        let picture = sheet.compose();
        let width = 100 + 60 + 3 * GAP_PX;
        let height = 120 + 50 + 2 * (LABEL_BAR_PX + GAP_PX) + GAP_PX;
        assert_eq!(picture.dimensions(), (width, height));
        let reds = picture.pixels().filter(|p| p.0 == [200, 0, 0]).count();
        assert_eq!(reds, 100 * 80 + 60 * 120 + 100 * 50);
        let bar = 14 + 120..14 + 120 + LABEL_BAR_PX;
        let inked = |(_, y, p): &(u32, u32, &Rgb<u8>)| bar.contains(y) && p.0 == palette::TEXT;
        assert!(picture.enumerate_pixels().any(|p| inked(&p)));
    }

    #[test]
    fn an_empty_sheet_is_a_small_empty_picture() {
        assert!(ContactSheet::new(3).is_empty());
        assert_eq!(
            ContactSheet::new(3).compose().dimensions(),
            (GAP_PX, GAP_PX)
        );
    }

    #[test]
    fn a_saved_sheet_reads_back_and_a_missing_folder_is_named() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("sheet.png");
        let sheet = ContactSheet::new(1).title("title").add("a", red(40, 40));
        sheet.save(&path).expect("writable");
        assert_eq!(
            image::open(&path).expect("a PNG").to_rgb8(),
            sheet.compose()
        );
        let nowhere = folder.path().join("none/sheet.png");
        let message = sheet
            .save(&nowhere)
            .expect_err("no such folder")
            .to_string();
        assert!(message.contains("none/sheet.png"), "{message}");
    }
}
