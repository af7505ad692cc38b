//! The images on the graphics card.

use std::collections::HashMap;
use std::sync::Arc;

use egui::{ColorImage, Context, TextureFilter, TextureHandle, TextureOptions};
use handeye_session::CaptureId;
use image::RgbImage;

use handeye_workbench::live::depth;
use handeye_workbench::model::{FrameImages, Model, Observed};

/// From this zoom on, pixels are shown as squares.
pub const CRISP_FROM: f32 = 4.0;

/// Thumbnails that are kept; the least recently seen are dropped first.
const MOST_THUMBNAILS: usize = 256;

/// Textures of the images that are shown, live or recorded.
#[derive(Default)]
pub struct LiveTextures {
    /// Colour.
    pub rgb: Option<TextureHandle>,
    /// Depth in colours.
    pub depth: Option<TextureHandle>,
    review_range_m: Option<[f32; 2]>,
    /// What was uploaded, and whether crisp; kept, so that a change of the images is detected.
    shown: Option<(Arc<FrameImages>, bool)>,
    #[cfg(test)]
    uploads: u64,
}

impl LiveTextures {
    /// Uploads the images to show, unless they are there already.
    pub fn update(&mut self, ctx: &Context, model: &Model) {
        let images = match &model.review {
            Some(review) => review.images.as_ref(),
            None => model.frame.as_ref().map(|frame| &frame.images),
        };
        let Some(images) = images else { return };
        let crisp = model.viewport.zoom >= CRISP_FROM;
        if self.shown.as_ref().is_some_and(|(shown, was_crisp)| Arc::ptr_eq(shown, images) && *was_crisp == crisp) {
            return;
        }
        upload(ctx, &mut self.rgb, "rgb", &images.rgb, crisp);
        match &images.depth {
            Some(depth) => upload(ctx, &mut self.depth, "depth", &depth.colours, crisp),
            None => self.depth = None,
        }
        self.review_range_m = model.review.as_ref().and_then(|_| {
            let far_plane_m = model.frame.as_ref().map_or(f32::INFINITY, |frame| frame.info.far_plane_m);
            depth::range_of(&images.depth.as_ref()?.metres, far_plane_m, None)
        });
        tracing::trace!("image shown");
        self.shown = Some((images.clone(), crisp));
        #[cfg(test)]
        {
            self.uploads += 1;
        }
    }

    /// Depths \[m\] at the ends of the colours of a recorded image; `None` without any depth in it.
    pub fn review_range_m(&self) -> Option<[f32; 2]> {
        self.review_range_m
    }

    /// How many frames were uploaded.
    #[cfg(test)]
    pub(crate) fn uploads(&self) -> u64 {
        self.uploads
    }
}

fn upload(ctx: &Context, texture: &mut Option<TextureHandle>, name: &str, image: &RgbImage, crisp: bool) {
    match texture {
        Some(texture) if texture.size() == [image.width() as usize, image.height() as usize] => {
            texture.set(pixels(image), options(crisp));
        }
        slot => *slot = Some(load(ctx, name, image, crisp)),
    }
}

fn load(ctx: &Context, name: &str, image: &RgbImage, crisp: bool) -> TextureHandle {
    ctx.load_texture(name, pixels(image), options(crisp))
}

fn pixels(image: &RgbImage) -> Arc<ColorImage> {
    Arc::new(ColorImage::from_rgb([image.width() as usize, image.height() as usize], image.as_raw()))
}

fn options(crisp: bool) -> TextureOptions {
    let magnification = if crisp { TextureFilter::Nearest } else { TextureFilter::Linear };
    TextureOptions { magnification, ..TextureOptions::LINEAR }
}

/// Everything that the window keeps on the graphics card.
#[derive(Default)]
pub struct Textures {
    /// The large images.
    pub live: LiveTextures,
    /// The small ones.
    pub thumbnails: Thumbnails,
}

/// Small images of captures; each is uploaded when it is first seen on the screen.
#[derive(Default)]
pub struct Thumbnails {
    textures: HashMap<CaptureId, Thumbnail>,
    #[cfg(test)]
    uploads: u64,
}

struct Thumbnail {
    texture: TextureHandle,
    /// What it shows: kept, so that another image of the same capture is detected.
    image: Arc<RgbImage>,
    /// Frame of the window in which it was last drawn.
    last_seen: u64,
}

impl Thumbnails {
    /// The thumbnail of a capture.
    pub fn of(&mut self, ctx: &Context, id: CaptureId, observed: &Observed) -> &TextureHandle {
        let is_new = self.textures.get(&id).is_none_or(|kept| !Arc::ptr_eq(&kept.image, &observed.thumbnail));
        if is_new && self.textures.len() >= MOST_THUMBNAILS {
            self.forget_oldest();
        }
        let (frame, image) = (ctx.cumulative_frame_nr(), &observed.thumbnail);
        #[cfg(test)]
        {
            self.uploads += u64::from(is_new);
        }
        let new =
            || Thumbnail { texture: load(ctx, "thumbnail", image, false), image: image.clone(), last_seen: frame };
        let kept = self.textures.entry(id).or_insert_with(new);
        if !Arc::ptr_eq(&kept.image, image) {
            *kept = new();
        }
        kept.last_seen = frame;
        &kept.texture
    }

    fn forget_oldest(&mut self) {
        let Some(oldest) = self.textures.iter().map(|(id, kept)| (kept.last_seen, *id)).min() else { return };
        self.textures.remove(&oldest.1);
    }

    /// How many thumbnails were uploaded.
    #[cfg(test)]
    pub(crate) fn uploads(&self) -> u64 {
        self.uploads
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thumbnails_on_the_screen_stay_however_many_were_seen_before() {
        let ctx = Context::default();
        let mut thumbnails = Thumbnails::default();
        let observed =
            Observed { corners: None, depth: None, image_size: (4, 3), thumbnail: Arc::new(RgbImage::new(4, 3)) };
        let mut frame = |ids: std::ops::RangeInclusive<u32>| {
            ctx.run_ui(egui::RawInput::default(), |_| {
                for id in ids.clone() {
                    thumbnails.of(&ctx, CaptureId(id), &observed);
                }
            })
            .drop_without_applying_deltas();
            thumbnails.uploads()
        };
        for last in (20..=600).rev().step_by(10) {
            frame(last - 10..=last);
        }
        let before = frame(1..=8);
        assert_eq!(frame(1..=8), before, "the first ones are not thrown out for one another");
        assert!(thumbnails.textures.len() <= MOST_THUMBNAILS);
    }
}
