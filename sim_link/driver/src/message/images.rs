//! Images and depth images, without their bytes.

use serde::{Deserialize, Serialize};

use super::error::BadMessage;
use super::hello::LensMessage;

/// Widest and highest image in pixels.
pub const MAX_IMAGE_SIDE: u32 = 16_384;

/// Pixel format of an image.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ImageEncoding {
    /// Three bytes a pixel: red, green, blue.
    Rgb8,
    /// Three bytes a pixel: blue, green, red.
    Bgr8,
    /// One byte a pixel.
    Mono8,
    /// A JPEG file.
    Jpeg,
    /// A PNG file.
    Png,
}

/// Pixel format of a depth image; row by row from the top left.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DepthEncoding {
    /// Unsigned 16 bits, little end first, millimetres; 0 where nothing was measured.
    U16Mm,
    /// Floats of 32 bits, little end first, metres; 0 or NaN where nothing was measured.
    F32M,
}

/// An image, without its bytes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ImageMessage {
    /// Id of the request that it answers.
    pub id: u64,
    /// Middle of the exposure on the driver's clock, seconds.
    pub stamp: f64,
    /// Half the interval that contains the instant, seconds.
    #[serde(default)]
    pub stamp_uncertainty_s: f64,
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Pixel format.
    pub encoding: ImageEncoding,
    /// Number of bytes that follow.
    pub bytes: u64,
    /// The lens at this instant, where it changes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub intrinsics: Option<LensMessage>,
}

/// A depth image, without its bytes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DepthMessage {
    /// Id of the request that it answers.
    pub id: u64,
    /// On the driver's clock, seconds.
    pub stamp: f64,
    /// Width in pixels: that of the image.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Pixel format.
    pub encoding: DepthEncoding,
    /// Number of bytes that follow.
    pub bytes: u64,
}

impl ImageMessage {
    pub(super) fn check(&self) -> Result<(), BadMessage> {
        check_size(self.width, self.height)?;
        if !(0.0..=10.0).contains(&self.stamp_uncertainty_s) {
            let why = format!("{} is not between 0 and 10 s", self.stamp_uncertainty_s);
            return Err(BadMessage::value("stamp_uncertainty_s", why));
        }
        if let Some(lens) = &self.intrinsics {
            lens.intrinsics(self.width, self.height)?;
        }
        let pixels = u64::from(self.width) * u64::from(self.height);
        match self.encoding {
            ImageEncoding::Rgb8 | ImageEncoding::Bgr8 => check_length(self.bytes, 3 * pixels),
            ImageEncoding::Mono8 => check_length(self.bytes, pixels),
            ImageEncoding::Jpeg | ImageEncoding::Png if self.bytes == 0 => {
                Err(BadMessage::value("bytes", "an image file is not empty"))
            }
            ImageEncoding::Jpeg | ImageEncoding::Png => Ok(()),
        }
    }
}

impl DepthMessage {
    pub(super) fn check(&self) -> Result<(), BadMessage> {
        check_size(self.width, self.height)?;
        let pixels = u64::from(self.width) * u64::from(self.height);
        match self.encoding {
            DepthEncoding::U16Mm => check_length(self.bytes, 2 * pixels),
            DepthEncoding::F32M => check_length(self.bytes, 4 * pixels),
        }
    }
}

pub(super) fn check_size(width: u32, height: u32) -> Result<(), BadMessage> {
    let sides = 1..=MAX_IMAGE_SIDE;
    if sides.contains(&width) && sides.contains(&height) {
        return Ok(());
    }
    Err(BadMessage::value("width and height", format!("{width}×{height} is no size of an image")))
}

fn check_length(got: u64, need: u64) -> Result<(), BadMessage> {
    if got == need { Ok(()) } else { Err(BadMessage::Length { got, need }) }
}
