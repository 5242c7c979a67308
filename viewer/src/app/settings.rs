//! What the person at the window has chosen; nothing here concerns the pipeline.

/// One thing that can be shown or hidden.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Layer {
    Body,
    PersonOutline,
    Floor,
    Timing,
}

impl Layer {
    pub(super) const ALL: [Self; 4] = [Self::Body, Self::PersonOutline, Self::Floor, Self::Timing];

    pub(super) fn label(self) -> &'static str {
        match self {
            Self::Body => "Body",
            Self::PersonOutline => "Outline",
            Self::Floor => "Floor",
            Self::Timing => "Timing",
        }
    }
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Settings {
    hidden: Vec<Layer>,
    pub(super) mirror: bool,
}

impl Default for Settings {
    fn default() -> Self {
        Self { hidden: vec![Layer::PersonOutline], mirror: false }
    }
}

impl Settings {
    pub(super) fn shows(&self, layer: Layer) -> bool {
        !self.hidden.contains(&layer)
    }

    pub(super) fn toggle(&mut self, layer: Layer) {
        if self.shows(layer) {
            self.hidden.push(layer);
        } else {
            self.hidden.retain(|hidden| *hidden != layer);
        }
    }
}
