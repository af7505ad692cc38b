//! Decoded images.

use std::fs;
use std::io::{Cursor, ErrorKind};
use std::path::Path;

use image::{DynamicImage, GrayImage, ImageError, ImageFormat, ImageReader, Limits, RgbImage};

use super::{ImageFileError, MAX_DECODED_BYTES, check_file, check_size};
use handeye_wording::{foreign, text};

/// The image as 8-bit RGB.
///
/// # Errors
/// [`ImageFileError`]; a file that ends early is an error in every format, also where a lenient decoder would fill
/// the rest with grey.
pub fn load_rgb(path: &Path) -> Result<RgbImage, ImageFileError> {
    Ok(match decode(path)? {
        DynamicImage::ImageRgb8(rgb) => rgb,
        other => other.to_rgb8(),
    })
}

/// The image as 8-bit grey; colours are weighted as OpenCV does, see [`gray_from_rgb`].
///
/// # Errors
/// As [`load_rgb`].
pub fn load_gray(path: &Path) -> Result<GrayImage, ImageFileError> {
    Ok(match decode(path)? {
        DynamicImage::ImageLuma8(gray) => gray,
        other if !other.color().has_color() => other.to_luma8(),
        other => gray_from_rgb(&other.to_rgb8()),
    })
}

/// Luma by ITU-R BT.601 in OpenCV's integer arithmetic (`cvtColor` with `COLOR_RGB2GRAY`), so that a detector sees the
/// same grey values whichever library loaded the image.
pub fn gray_from_rgb(rgb: &RgbImage) -> GrayImage {
    let mut gray = GrayImage::new(rgb.width(), rgb.height());
    for (to, from) in gray.pixels_mut().zip(rgb.pixels()) {
        let [r, g, b] = from.0.map(u32::from);
        to.0 = [((r * 9798 + g * 19235 + b * 3735 + (1 << 14)) >> 15) as u8];
    }
    gray
}

fn decode(path: &Path) -> Result<DynamicImage, ImageFileError> {
    check_file(path)?;
    let bytes = fs::read(path).map_err(|e| ImageFileError::Unreadable(foreign(&e)))?;
    decode_bytes(&bytes)
}

/// The image of the bytes of a file.
pub fn decode_bytes(bytes: &[u8]) -> Result<DynamicImage, ImageFileError> {
    let open = || {
        ImageReader::new(Cursor::new(bytes)).with_guessed_format().map_err(|e| ImageFileError::Unreadable(foreign(&e)))
    };
    let reader = open()?;
    let format = reader.format();
    check_size(reader.into_dimensions().map_err(decode_error)?)?;
    match format {
        Some(ImageFormat::Jpeg) => check_jpeg_is_whole(bytes)?,
        Some(ImageFormat::Png) => check_png_is_whole(bytes)?,
        _ => {}
    }
    let mut reader = open()?;
    let mut limits = Limits::no_limits();
    limits.max_alloc = Some(MAX_DECODED_BYTES);
    reader.limits(limits);
    reader.decode().map_err(decode_error)
}

/// Walks the chunks of a PNG to its end chunk. The decoder stops at the last pixel and would not miss the rest.
fn check_png_is_whole(bytes: &[u8]) -> Result<(), ImageFileError> {
    const SIGNATURE: usize = 8;
    // Length, type and checksum around the data of a chunk.
    const FRAME: usize = 12;
    let mut at = SIGNATURE;
    while let Some(head) = bytes.get(at..at + 8) {
        let length = u32::from_be_bytes([head[0], head[1], head[2], head[3]]) as usize;
        let end = at + FRAME + length;
        if end > bytes.len() {
            break;
        }
        if &head[4..8] == b"IEND" {
            return Ok(());
        }
        at = end;
    }
    Err(ImageFileError::Truncated(text!("a PNG without its end chunk")))
}

/// Walks the segments and scans of a JPEG to its end marker. The decoder fills what is missing with grey and is
/// content, which would move corners without a word.
fn check_jpeg_is_whole(bytes: &[u8]) -> Result<(), ImageFileError> {
    const END_OF_IMAGE: u8 = 0xD9;
    let truncated = || ImageFileError::Truncated(text!("a JPEG without its end marker"));
    let mut at = 2;
    loop {
        let marker = next_jpeg_marker(bytes, &mut at).ok_or_else(truncated)?;
        match marker {
            END_OF_IMAGE => return Ok(()),
            // Start of image, restarts and TEM have no segment.
            0x01 | 0xD0..=0xD8 => {}
            _ => {
                let length = bytes.get(at..at + 2).ok_or_else(truncated)?;
                at += usize::from(u16::from_be_bytes([length[0], length[1]]));
            }
        }
    }
}

/// The next marker at or after `at`, past entropy-coded data; `at` moves behind it.
fn next_jpeg_marker(bytes: &[u8], at: &mut usize) -> Option<u8> {
    loop {
        let offset = bytes.get(*at..)?.iter().position(|&b| b == 0xFF)?;
        *at += offset + 1;
        let code = *bytes.get(*at)?;
        match code {
            // A stuffed data byte 0xFF: not a marker.
            0x00 => *at += 1,
            // Fill bytes before a marker.
            0xFF => {}
            _ => {
                *at += 1;
                return Some(code);
            }
        }
    }
}

fn decode_error(error: ImageError) -> ImageFileError {
    match error {
        ImageError::Limits(e) => ImageFileError::TooLarge(foreign(&e)),
        ImageError::IoError(e) if e.kind() == ErrorKind::UnexpectedEof => ImageFileError::Truncated(foreign(&e)),
        other => ImageFileError::Undecodable(foreign(&other)),
    }
}
