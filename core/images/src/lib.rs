//! Images from files, with what a calibration must not swallow: truncated files, and files that unpack to more
//! memory than any camera delivers.
//!
//! Pixels are taken as stored: an EXIF orientation is not applied, since a calibration is about the sensor.
//!
//! ```
//! use handeye_images::gray_from_rgb;
//! use image::{Rgb, RgbImage};
//!
//! let grey = gray_from_rgb(&RgbImage::from_pixel(2, 1, Rgb([255, 0, 0])));
//! assert_eq!(grey.into_raw(), [76, 76]);
//! ```
//!
//! Pixels need the crate `image`, behind the feature `pixels`; the size of an image does not. Never depends on a detector.

#![warn(missing_docs)]

mod header;
#[cfg(feature = "pixels")]
mod pixels;

#[cfg(feature = "pixels")]
pub use pixels::{decode_bytes, gray_from_rgb, load_gray, load_rgb};

use std::fs;
use std::io::BufReader;
use std::path::Path;

use handeye_wording::{Text, foreign, text};

/// Most pixels of an image: more than machine-vision sensors have, and 300 MB as RGB.
pub const MAX_PIXELS: u64 = 100_000_000;
/// Most bytes that decoding may take: 16-bit RGBA of the largest image.
const MAX_DECODED_BYTES: u64 = MAX_PIXELS * 8;
/// Most bytes of an image file: the largest image uncompressed.
const MAX_FILE_BYTES: u64 = MAX_DECODED_BYTES;

/// Why an image file is of no use. The caller knows the file and names it.
#[derive(Debug, thiserror::Error, handeye_wording::Localized)]
#[non_exhaustive]
pub enum ImageFileError {
    /// Not there, not a file, or not permitted.
    #[error("the image cannot be opened: {0}")]
    Unreadable(Text),
    /// No image in a format that is read here, or a damaged one.
    #[error("the image cannot be decoded (PNG, JPEG, BMP and TIFF are read): {0}")]
    Undecodable(Text),
    /// The file ends before the image does.
    #[error("the image file is truncated: {0}; copy it again from its source")]
    Truncated(Text),
    /// More pixels or bytes than any camera delivers.
    #[error("the image is too large: {0} (at most {MAX_PIXELS} pixels)")]
    TooLarge(Text),
}

/// Width and height in pixels from the header of an image file; the pixels are not decoded.
///
/// # Errors
/// [`ImageFileError`] when the file has no readable header or states an absurd size.
pub fn image_size(path: &Path) -> Result<(u32, u32), ImageFileError> {
    check_file(path)?;
    let file = fs::File::open(path).map_err(|e| ImageFileError::Unreadable(foreign(&e)))?;
    let size = header::size(&mut BufReader::new(file))?;
    check_size(size)?;
    Ok(size)
}

fn check_file(path: &Path) -> Result<(), ImageFileError> {
    let metadata = fs::metadata(path).map_err(|e| ImageFileError::Unreadable(foreign(&e)))?;
    if !metadata.is_file() {
        return Err(ImageFileError::Unreadable(text!("it is not a file")));
    }
    if metadata.len() == 0 {
        return Err(ImageFileError::Truncated(text!("it is empty")));
    }
    if metadata.len() > MAX_FILE_BYTES {
        return Err(ImageFileError::TooLarge(text!("{count} bytes", count = metadata.len())));
    }
    Ok(())
}

fn check_size((width, height): (u32, u32)) -> Result<(), ImageFileError> {
    if u64::from(width) * u64::from(height) > MAX_PIXELS {
        return Err(ImageFileError::TooLarge(text!("{width}×{height} px", width = width, height = height)));
    }
    if width == 0 || height == 0 {
        let size = text!("its size is {width}×{height} px", width = width, height = height);
        return Err(ImageFileError::Undecodable(size));
    }
    Ok(())
}

#[cfg(all(test, feature = "pixels"))]
mod tests;
