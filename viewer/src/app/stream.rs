//! A picture on the screen that is drawn again only when what it shows has changed.

use eframe::egui::{ColorImage, Context, TextureHandle, TextureOptions};

use crate::pictures::Picture;

/// The texture of one picture, and what it was drawn from.
pub(super) struct Stream<Key> {
    name: &'static str,
    shown: Option<(Key, TextureHandle)>,
}

impl<Key: PartialEq> Stream<Key> {
    pub(super) fn new(name: &'static str) -> Self {
        Self { name, shown: None }
    }

    /// The texture for a key; `draw` runs only if the key is not the one shown.
    pub(super) fn texture(
        &mut self,
        context: &Context,
        key: Key,
        draw: impl FnOnce() -> Picture,
    ) -> &TextureHandle {
        let name = self.name;
        let shown = match self.shown.take() {
            Some((old, handle)) if old == key => (key, handle),
            Some((_, mut handle)) => {
                handle.set(color_image(&draw()), TextureOptions::LINEAR);
                (key, handle)
            }
            None => (
                key,
                context.load_texture(name, color_image(&draw()), TextureOptions::LINEAR),
            ),
        };
        &self.shown.insert(shown).1
    }
}

fn color_image(picture: &Picture) -> ColorImage {
    let size = [picture.width() as usize, picture.height() as usize];
    ColorImage::from_rgb(size, picture.as_raw())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_is_drawn_once_a_key() {
        let context = Context::default();
        let mut stream = Stream::new("test");
        let mut drawn = 0;
        for key in [1, 1, 1, 2, 2, 1] {
            stream.texture(&context, key, || {
                drawn += 1;
                Picture::new(4, 4)
            });
        }
        assert_eq!(drawn, 3);
    }
}
