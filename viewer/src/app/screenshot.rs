//! The window as a file.

use std::{
    path::PathBuf,
    sync::{Arc, Mutex, PoisonError},
};

use eframe::egui::{ColorImage, Context};

use crate::pictures::{self, Picture};

/// Takes pictures of the window and remembers what became of the last one.
#[derive(Clone, Default)]
pub(super) struct Screenshots {
    news: Arc<Mutex<Option<String>>>,
}

impl Screenshots {
    /// Asks for a picture of the next frame; it is written when the frame has been drawn.
    pub(super) fn take(&self, context: &Context, path: PathBuf) {
        let news = Arc::clone(&self.news);
        let again = context.clone();
        context.request_screenshot(move |image| {
            let message = match pictures::save(&picture(&image), &path) {
                Ok(()) => format!("Saved {}", path.display()),
                Err(error) => error.to_string(),
            };
            *news.lock().unwrap_or_else(PoisonError::into_inner) = Some(message);
            again.request_repaint();
        });
    }

    /// What became of the last picture, once.
    pub(super) fn take_news(&self) -> Option<String> {
        self.news
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .take()
    }
}

fn picture(image: &ColorImage) -> Picture {
    let [width, height] = image.size.map(|s| s as u32);
    let pixels = &image.pixels;
    Picture::from_fn(width, height, |x, y| {
        let [r, g, b, _] = pixels[(y * width + x) as usize].to_array();
        image::Rgb([r, g, b])
    })
}
