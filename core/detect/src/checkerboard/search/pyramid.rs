//! An image and its halves.

use std::borrow::Cow;

use image::GrayImage;

use crate::VisionError;
use crate::error::go_on;
use handeye_geometry::progress::CancelToken;

/// One level of the pyramid.
pub(super) struct Level<'a> {
    pub width: usize,
    pub height: usize,
    pub pixels: Cow<'a, [u8]>,
}

impl<'a> Level<'a> {
    /// The image itself.
    pub fn full(image: &'a GrayImage) -> Self {
        let (width, height) = (image.width() as usize, image.height() as usize);
        // The buffer of an image may be longer than its pixels.
        let pixels = image.as_raw().get(..width * height).unwrap_or_default();
        Self { width, height, pixels: Cow::Borrowed(pixels) }
    }

    /// The image and `halvings` levels, each the mean of 2×2 pixels of the one before.
    pub fn pyramid(image: &'a GrayImage, halvings: usize, cancel: &CancelToken) -> Result<Vec<Self>, VisionError> {
        let mut all = vec![Self::full(image)];
        for _ in 0..halvings {
            go_on(cancel)?;
            let Some(half) = all.last().and_then(Self::half) else { break };
            all.push(half);
        }
        Ok(all)
    }

    pub fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    fn half(&self) -> Option<Level<'a>> {
        let (width, height) = (self.width / 2, self.height / 2);
        if width == 0 || height == 0 {
            return None;
        }
        let mut pixels = vec![0u8; width * height];
        for (out, pair) in pixels.chunks_exact_mut(width).zip(self.pixels.chunks_exact(2 * self.width)) {
            let (upper, lower) = pair.split_at(self.width);
            for ((out, a), b) in out.iter_mut().zip(upper.chunks_exact(2)).zip(lower.chunks_exact(2)) {
                // No overflow; without checks these become vector instructions.
                let upper = u16::from(a[0]).wrapping_add(u16::from(a[1]));
                let lower = u16::from(b[0]).wrapping_add(u16::from(b[1]));
                *out = (upper.wrapping_add(lower).wrapping_add(2) >> 2) as u8;
            }
        }
        Some(Level { width, height, pixels: Cow::Owned(pixels) })
    }
}
