//! The pictures on the graphics card.

use std::sync::Arc;

use egui::{ColorImage, Context, TextureHandle, TextureOptions};
use handeye_core::image::RgbImage;

use crate::model::LiveFrame;

/// Textures of the newest frame.
#[derive(Default)]
pub struct LiveTextures {
    /// Colour.
    pub rgb: Option<TextureHandle>,
    /// Depth in colours.
    pub depth: Option<TextureHandle>,
    number: Option<u64>,
    #[cfg(test)]
    uploads: u64,
}

impl LiveTextures {
    /// Uploads a frame, unless it is there already.
    pub fn update(&mut self, ctx: &Context, frame: Option<&LiveFrame>) {
        let Some(frame) = frame.filter(|frame| self.number != Some(frame.info.number)) else { return };
        upload(ctx, &mut self.rgb, "rgb", &frame.images.rgb);
        upload(ctx, &mut self.depth, "depth", &frame.images.depth_coloured);
        self.number = Some(frame.info.number);
        #[cfg(test)]
        {
            self.uploads += 1;
        }
    }

    /// How many frames were uploaded.
    #[cfg(test)]
    pub fn uploads(&self) -> u64 {
        self.uploads
    }
}

fn upload(ctx: &Context, texture: &mut Option<TextureHandle>, name: &str, picture: &RgbImage) {
    let size = [picture.width() as usize, picture.height() as usize];
    let image = Arc::new(ColorImage::from_rgb(size, picture.as_raw()));
    match texture {
        Some(texture) if texture.size() == size => texture.set(image, TextureOptions::LINEAR),
        slot => *slot = Some(ctx.load_texture(name, image, TextureOptions::LINEAR)),
    }
}
