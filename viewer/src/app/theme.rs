//! Dark, calm, few colours: the same as in the pictures.

use eframe::egui::{
    Color32, Context, CornerRadius, FontFamily, FontId, Margin, Stroke, Style, TextStyle, Theme,
    Visuals, vec2,
};

use crate::pictures::palette;

const RADIUS: CornerRadius = CornerRadius::same(6);

pub(super) const fn color([r, g, b]: [u8; 3]) -> Color32 {
    Color32::from_rgb(r, g, b)
}

pub(super) const DIM: Color32 = color(palette::TEXT_DIM);
pub(super) const TEXT: Color32 = color(palette::TEXT);
pub(super) const PANEL: Color32 = color(palette::PANEL);
pub(super) const LINE: Color32 = color(palette::LINE);
pub(super) const ACCENT: Color32 = color(palette::BODY);
pub(super) const GOOD: Color32 = color(palette::GOOD);
pub(super) const WAITING: Color32 = color(palette::WAITING);
pub(super) const BAD: Color32 = color(palette::BAD);
pub(super) const CLAY: Color32 = color(palette::CLAY);

pub(super) fn apply(context: &Context) {
    context.set_theme(Theme::Dark);
    context.style_mut_of(Theme::Dark, |style| {
        style.visuals = visuals();
        set_sizes(style);
    });
}

fn visuals() -> Visuals {
    let mut visuals = Visuals::dark();
    visuals.panel_fill = color(palette::BACKGROUND);
    visuals.window_fill = PANEL;
    visuals.window_stroke = Stroke::new(1.0, LINE);
    visuals.extreme_bg_color = color(palette::BACKGROUND);
    visuals.faint_bg_color = PANEL;
    visuals.selection.bg_fill = color(palette::mix(palette::PANEL, palette::BODY, 0.45));
    visuals.selection.stroke = Stroke::new(1.0, TEXT);
    visuals.slider_trailing_fill = true;
    visuals.window_corner_radius = RADIUS;
    visuals.menu_corner_radius = RADIUS;
    let widgets = &mut visuals.widgets;
    let fills = [
        (&mut widgets.noninteractive, 0.0),
        (&mut widgets.inactive, 0.35),
        (&mut widgets.hovered, 0.8),
        (&mut widgets.active, 1.0),
        (&mut widgets.open, 0.8),
    ];
    for (widget, share) in fills {
        let fill = color(palette::mix(palette::PANEL, palette::LINE, share));
        widget.bg_fill = fill;
        widget.weak_bg_fill = fill;
        widget.bg_stroke = Stroke::new(1.0, LINE);
        widget.fg_stroke = Stroke::new(1.0, TEXT);
        widget.corner_radius = RADIUS;
        widget.expansion = 0.0;
    }
    visuals
}

fn set_sizes(style: &mut Style) {
    style.spacing.item_spacing = vec2(8.0, 6.0);
    style.spacing.button_padding = vec2(10.0, 5.0);
    style.spacing.menu_margin = Margin::same(8);
    let sizes = [
        (TextStyle::Heading, 17.0),
        (TextStyle::Body, 13.5),
        (TextStyle::Button, 13.5),
        (TextStyle::Small, 11.5),
    ];
    for (text, size) in sizes {
        style
            .text_styles
            .insert(text, FontId::new(size, FontFamily::Proportional));
    }
    style.text_styles.insert(
        TextStyle::Monospace,
        FontId::new(12.5, FontFamily::Monospace),
    );
}
