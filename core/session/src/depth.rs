//! Depth images as files: TIFF with one 32-bit float per pixel in metres, deflated.
//!
//! Lossless, so far planes, holes (NaN) and the last bit survive; OpenCV, Pillow, MATLAB and ImageJ read it. A 16-bit
//! PNG would end at 6.5 m for steps of 0.1 mm.

use std::io::Cursor;
use std::path::Path;

use tiff::decoder::{Decoder, DecodingResult};
use tiff::encoder::{Compression, DeflateLevel, TiffEncoder, colortype};

use handeye_geometry::depth::DepthImage;
use handeye_images::MAX_PIXELS;
use handeye_wording::one_line;

pub(super) fn encode(depth_m: &DepthImage) -> Result<Vec<u8>, String> {
    let mut bytes = Cursor::new(Vec::new());
    TiffEncoder::new(&mut bytes)
        .and_then(|encoder| {
            // Speed: a capture waits for this.
            let mut encoder = encoder.with_compression(Compression::Deflate(DeflateLevel::Fast));
            encoder.write_image::<colortype::Gray32Float>(depth_m.width, depth_m.height, &depth_m.metres)
        })
        .map_err(|e| one_line(&e))?;
    Ok(bytes.into_inner())
}

pub(super) fn load(path: &Path) -> Result<DepthImage, String> {
    let bytes = std::fs::read(path).map_err(|e| one_line(&e))?;
    decode(&bytes)
}

fn decode(bytes: &[u8]) -> Result<DepthImage, String> {
    let mut decoder = Decoder::new(Cursor::new(bytes)).map_err(|e| one_line(&e))?;
    let (width, height) = decoder.dimensions().map_err(|e| one_line(&e))?;
    if u64::from(width) * u64::from(height) > MAX_PIXELS {
        return Err(format!("it has {width}×{height} px, at most {MAX_PIXELS} pixels are read"));
    }
    let DecodingResult::F32(metres) = decoder.read_image().map_err(|e| one_line(&e))? else {
        return Err("it does not hold 32-bit floats".into());
    };
    DepthImage::new(width, height, metres).map_err(|e| one_line(&e))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn depth_survives_to_the_last_bit_with_holes_and_far_planes() {
        let mut metres: Vec<f32> = (0..17 * 9).map(|i| 0.2 + 0.0001 * i as f32).collect();
        metres[..3].copy_from_slice(&[f32::NAN, f32::INFINITY, 1234.567]);
        let depth = DepthImage::new(17, 9, metres).expect("as many as pixels");
        let bytes = encode(&depth).expect("encode");
        let read = decode(&bytes).expect("decode");
        let bits = |d: &DepthImage| d.metres.iter().map(|m| m.to_bits()).collect::<Vec<_>>();
        assert_eq!((read.width, read.height), (17, 9));
        assert_eq!(bits(&read), bits(&depth));
        for kept in 0..bytes.len() {
            // A TIFF may end with tables that are not needed; what is decoded is all there or an error.
            if let Ok(part) = decode(&bytes[..kept]) {
                assert_eq!(bits(&part), bits(&depth), "cut to {kept} bytes");
            }
        }
    }

    #[test]
    fn a_tiff_of_other_numbers_is_not_a_depth_image() {
        let mut bytes = Cursor::new(Vec::new());
        image::GrayImage::new(4, 4).write_to(&mut bytes, image::ImageFormat::Tiff).expect("encode");
        assert!(decode(bytes.get_ref()).is_err());
    }
}
