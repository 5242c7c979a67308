//! Whether the whole person is in view.

use serde::{Deserialize, Serialize};

use super::{super::tolerance::Tolerance, body::Body, coarse::Coarse, label::Labels};
use crate::clean::{FloorPlane, PersonVisibility};

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
#[expect(
    clippy::struct_field_names,
    reason = "they are all lengths, and units stand in names"
)]
pub struct VisibilityConfig {
    /// Feet end at most this far above the floor: ankles, where black shoes return nothing.
    pub feet_below_m: f32,
    /// The top of a whole person: somebody crouching.
    pub head_above_m: f32,
    /// Without a floor in view, a whole person is at least this tall.
    pub min_height_m: f32,
    /// Contact with the image's top or bottom that cuts a body: less is a hand.
    pub max_contact_m: f32,
    /// Contact with its sides: more than an arm.
    pub max_side_contact_m: f32,
}

impl Default for VisibilityConfig {
    fn default() -> Self {
        Self {
            feet_below_m: 0.25,
            head_above_m: 0.6,
            min_height_m: 1.1,
            max_contact_m: 0.06,
            max_side_contact_m: 0.3,
        }
    }
}

/// A rim this wide, as a share of the image, can be dead: where images are aligned to another camera.
const MAX_DEAD_SHARE: f32 = 0.06;

/// The part of the image in which the sensor measures at all, as far as seen; in cells.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ValidWindow {
    left: usize,
    right: usize,
    top: usize,
    bottom: usize,
    known: bool,
}

/// Metres of a body's outline along the sides of the image.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[expect(
    clippy::struct_field_names,
    reason = "they are all lengths, and units stand in names"
)]
pub(super) struct Contact {
    /// Metres along the top, along the bottom, and along both sides together.
    top_m: f32,
    bottom_m: f32,
    sides_m: f32,
}

pub(super) fn judge(
    body: &Body,
    contact: Contact,
    floor: Option<FloorPlane>,
    config: &VisibilityConfig,
) -> PersonVisibility {
    let [low_m, high_m] = body.span_m;
    let stands = if floor.is_some() {
        low_m <= config.feet_below_m && high_m >= config.head_above_m
    } else {
        contact.bottom_m <= config.max_contact_m && high_m - low_m >= config.min_height_m
    };
    let uncut =
        contact.top_m <= config.max_contact_m && contact.sides_m <= config.max_side_contact_m;
    if stands && uncut {
        PersonVisibility::Whole
    } else {
        PersonVisibility::Partial
    }
}

impl ValidWindow {
    /// Grows the window to the frame's measurements; at first it leaves out the widest dead rim there can be.
    pub(super) fn include(&mut self, coarse: &Coarse) {
        if !self.known {
            let dead = |size: usize| (size as f32 * MAX_DEAD_SHARE) as usize;
            let (across, down) = (dead(coarse.width), dead(coarse.height));
            *self = Self {
                left: across,
                right: coarse.width.saturating_sub(across + 1),
                top: down,
                bottom: coarse.height.saturating_sub(down + 1),
                known: true,
            };
        }
        let measured = |x: usize, y: usize| !coarse.points[y * coarse.width + x].z.is_nan();
        let row = |y: usize| (0..coarse.width).any(|x| measured(x, y));
        let column = |x: usize| (0..coarse.height).any(|y| measured(x, y));
        self.top = (0..self.top).find(|&y| row(y)).unwrap_or(self.top);
        self.left = (0..self.left).find(|&x| column(x)).unwrap_or(self.left);
        self.bottom = (self.bottom + 1..coarse.height)
            .rev()
            .find(|&y| row(y))
            .unwrap_or(self.bottom);
        self.right = (self.right + 1..coarse.width)
            .rev()
            .find(|&x| column(x))
            .unwrap_or(self.right);
    }

    /// How much of a part lies along the window's sides.
    pub(super) fn contact(
        &self,
        coarse: &Coarse,
        labels: &Labels,
        label: u32,
        tolerance: &Tolerance,
    ) -> Contact {
        let region = labels.region_of(label, coarse);
        let mut contact = Contact::default();
        for y in region.rows.clone() {
            for x in region.columns.clone() {
                let cell = y * coarse.width + x;
                if labels.of_cell(cell) != label {
                    continue;
                }
                let size_m = coarse.cell_size_m(cell, tolerance);
                contact.top_m += if y <= self.top { size_m } else { 0.0 };
                contact.bottom_m += if y >= self.bottom { size_m } else { 0.0 };
                contact.sides_m += if x <= self.left || x >= self.right {
                    size_m
                } else {
                    0.0
                };
            }
        }
        contact
    }
}
