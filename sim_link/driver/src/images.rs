//! From the bytes of a driver to images.

use std::io::Cursor;

use handeye_geometry::depth::DepthImage;
use image::{ImageFormat, ImageReader, Limits, RgbImage};

use super::message::{DepthEncoding, DepthMessage, ImageEncoding, ImageMessage, MAX_IMAGE_SIDE};

/// Most memory that a file may take to be decoded, bytes.
const MOST_MEMORY: u64 = 512 << 20;

/// The image in its bytes.
///
/// # Errors
/// What is wrong with them.
pub fn image(message: &ImageMessage, bytes: Vec<u8>) -> Result<RgbImage, String> {
    let &ImageMessage { width, height, encoding, .. } = message;
    let pixels = match encoding {
        ImageEncoding::Rgb8 => bytes,
        ImageEncoding::Bgr8 => {
            let mut bytes = bytes;
            for pixel in bytes.as_chunks_mut::<3>().0 {
                pixel.swap(0, 2);
            }
            bytes
        }
        ImageEncoding::Mono8 => bytes.iter().flat_map(|&grey| [grey; 3]).collect(),
        ImageEncoding::Jpeg => return decoded(&bytes, ImageFormat::Jpeg, "JPEG", width, height),
        ImageEncoding::Png => return decoded(&bytes, ImageFormat::Png, "PNG", width, height),
    };
    let count = pixels.len();
    RgbImage::from_raw(width, height, pixels)
        .ok_or_else(|| format!("the image has {count} bytes and not 3 × {width} × {height}"))
}

fn decoded(bytes: &[u8], format: ImageFormat, name: &str, width: u32, height: u32) -> Result<RgbImage, String> {
    let mut limits = Limits::default();
    (limits.max_image_width, limits.max_image_height) = (Some(MAX_IMAGE_SIDE), Some(MAX_IMAGE_SIDE));
    limits.max_alloc = Some(MOST_MEMORY);
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    reader.limits(limits);
    let image = reader.decode().map_err(|error| format!("the image is no {name} that can be read: {error}"))?;
    let (got_width, got_height) = (image.width(), image.height());
    if (got_width, got_height) != (width, height) {
        return Err(format!("the {name} is {got_width}×{got_height} and its message says {width}×{height}"));
    }
    Ok(image.into_rgb8())
}

/// The depths in its bytes; 0 where nothing was measured.
///
/// # Errors
/// What is wrong with them.
pub fn depth(message: &DepthMessage, bytes: &[u8]) -> Result<DepthImage, String> {
    let metres = match message.encoding {
        DepthEncoding::U16Mm => {
            bytes.as_chunks::<2>().0.iter().map(|&pair| f32::from(u16::from_le_bytes(pair)) * 1e-3).collect()
        }
        DepthEncoding::F32M => bytes.as_chunks::<4>().0.iter().map(|&four| f32::from_le_bytes(four)).collect(),
    };
    DepthImage::new(message.width, message.height, metres).map_err(|error| error.to_string())
}
