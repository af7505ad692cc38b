//! Photographs for viewers: pages of the browser, viewers of Rerun.

pub use jpeg_encoder::{ColorType, EncodingError};
use jpeg_encoder::{Encoder, SamplingFactor};

/// A JPEG of these pixels, row by row. Chroma has half the resolution of luma, as cameras store it: that is half of the work,
/// and what is measured is measured in the pixels themselves.
///
/// # Errors
/// An image without pixels, or with more than 65 535 in a row or column.
pub fn encoded(
    pixels: &[u8],
    colours: ColorType,
    (width, height): (usize, usize),
    quality: u8,
) -> Result<Vec<u8>, EncodingError> {
    // What is too large is refused because its length then does not match.
    let side = |length: usize| u16::try_from(length).unwrap_or(u16::MAX);
    let mut bytes = Vec::with_capacity(pixels.len() / 16);
    let mut encoder = Encoder::new(&mut bytes, quality);
    encoder.set_sampling_factor(SamplingFactor::F_2_2);
    encoder.encode(pixels, side(width), side(height), colours)?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use image::{ImageFormat, load_from_memory_with_format};

    use super::*;

    #[test]
    fn another_library_reads_the_same_colours() {
        let (width, height) = (64, 48);
        let pixels: Vec<u8> =
            (0..width * height).flat_map(|i| [(4 * (i % width)) as u8, (5 * (i / width)) as u8, 90, 255]).collect();
        let bytes = encoded(&pixels, ColorType::Rgba, (width, height), 85).expect("encoded");
        let read = load_from_memory_with_format(&bytes, ImageFormat::Jpeg).expect("a JPEG").into_rgb8();
        assert_eq!(read.dimensions(), (64, 48));
        for (seen, made) in read.pixels().zip(pixels.chunks_exact(4)) {
            for (seen, made) in seen.0.iter().zip(made) {
                assert!(seen.abs_diff(*made) < 12, "{seen} of {made}");
            }
        }
    }

    #[test]
    fn what_is_no_image_is_refused() {
        assert!(encoded(&[], ColorType::Rgb, (0, 0), 85).is_err());
        assert!(encoded(&[0; 30], ColorType::Rgb, (70_000, 1), 85).is_err());
    }
}
