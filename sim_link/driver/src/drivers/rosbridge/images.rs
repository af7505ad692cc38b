//! Images of ROS as frames of the driver protocol.

use std::io::Cursor;

use image::{ImageFormat, ImageReader};

use super::messages::AnyImage;
use crate::drivers::DepthFrame;
use crate::message::{DepthEncoding, ImageEncoding, MAX_IMAGE_SIDE};

/// An image without what is around it.
#[derive(Debug, PartialEq)]
pub(super) struct Picture {
    pub stamp_s: f64,
    pub width: u32,
    pub height: u32,
    pub encoding: ImageEncoding,
    pub bytes: Vec<u8>,
}

/// A colour or grey image.
///
/// # Errors
/// What is wrong with the message, or that its encoding is not read, and what to do.
pub(super) fn picture(image: AnyImage) -> Result<Picture, String> {
    let stamp_s = image.header.stamp.seconds();
    let (width, height) = (image.width, image.height);
    if let Some(format) = image.format {
        let (encoding, (width, height)) = compressed(&format, &image.data.0)?;
        return Ok(Picture { stamp_s, width, height, encoding, bytes: image.data.0 });
    }
    let encoding = image.encoding.unwrap_or_default();
    let (bytes_per_pixel, to) = match encoding.as_str() {
        "rgb8" => (3, ImageEncoding::Rgb8),
        "bgr8" => (3, ImageEncoding::Bgr8),
        "rgba8" => (4, ImageEncoding::Rgb8),
        "bgra8" => (4, ImageEncoding::Bgr8),
        "mono8" => (1, ImageEncoding::Mono8),
        other => {
            return Err(format!(
                "images are of the encoding {other:?}; rgb8, bgr8, rgba8, bgra8, mono8 and compressed images are read. Name a \
                 topic that has one of them, such as that of image_proc (…/image_color, …/image_mono)"
            ));
        }
    };
    let mut bytes = rows(&image.data.0, width, height, image.step, bytes_per_pixel)?;
    if bytes_per_pixel == 4 {
        bytes = bytes.as_chunks::<4>().0.iter().flat_map(|&[a, b, c, _]| [a, b, c]).collect();
    }
    Ok(Picture { stamp_s, width, height, encoding: to, bytes })
}

/// A depth image, with its size.
///
/// # Errors
/// As [`picture`].
pub(super) fn depth(image: AnyImage) -> Result<(DepthFrame, (u32, u32)), String> {
    let stamp = image.header.stamp.seconds();
    let size = (image.width, image.height);
    let encoding = image.encoding.or(image.format).unwrap_or_default();
    let (bytes_per_pixel, to) = match encoding.as_str() {
        "16UC1" | "mono16" => (2, DepthEncoding::U16Mm),
        "32FC1" => (4, DepthEncoding::F32M),
        other => {
            return Err(format!(
                "depth images are of the encoding {other:?}; 16UC1 (mm) and 32FC1 (m) are read: name the topic of the raw image"
            ));
        }
    };
    let mut bytes = rows(&image.data.0, size.0, size.1, image.step, bytes_per_pixel)?;
    if image.is_bigendian.0 {
        bytes.chunks_exact_mut(bytes_per_pixel).for_each(<[u8]>::reverse);
    }
    Ok((DepthFrame { stamp, encoding: to, bytes }, size))
}

/// The pixels without what pads each row.
fn rows(data: &[u8], width: u32, height: u32, step: u32, bytes_per_pixel: usize) -> Result<Vec<u8>, String> {
    let sides = 1..=MAX_IMAGE_SIDE;
    if !sides.contains(&width) || !sides.contains(&height) {
        return Err(format!("{width}×{height} is no size of an image"));
    }
    let (row, step, height) = (width as usize * bytes_per_pixel, step as usize, height as usize);
    let need = step.checked_mul(height);
    if step < row || need.is_none_or(|need| data.len() < need) {
        return Err(format!(
            "the image has {} bytes, where {height} rows of {step} bytes with {width} pixels each are said to be",
            data.len()
        ));
    }
    if step == row {
        return Ok(data[..row * height].to_vec());
    }
    Ok(data.chunks_exact(step).take(height).flat_map(|line| &line[..row]).copied().collect())
}

/// JPEG or PNG, by what the bytes are: the text of the format differs between publishers.
fn compressed(format: &str, bytes: &[u8]) -> Result<(ImageEncoding, (u32, u32)), String> {
    if format.contains("compressedDepth") {
        return Err("a compressed depth image: name the topic of the raw one".into());
    }
    let reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format().map_err(|error| error.to_string())?;
    let encoding = match reader.format() {
        Some(ImageFormat::Jpeg) => ImageEncoding::Jpeg,
        Some(ImageFormat::Png) => ImageEncoding::Png,
        _ => return Err(format!("compressed images are of the format {format:?}; jpeg and png are read")),
    };
    let size = reader.into_dimensions().map_err(|error| format!("a compressed image cannot be read: {error}"))?;
    Ok((encoding, size))
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::*;

    fn image(encoding: &str, step: u32, data: &[u8]) -> AnyImage {
        let text = data_encoding::BASE64.encode(data);
        from_json(json!({"encoding": encoding, "is_bigendian": 0, "step": step, "data": text}))
    }

    fn from_json(mut fields: Value) -> AnyImage {
        for (key, value) in
            [("width", json!(2)), ("height", json!(2)), ("header", json!({"stamp": {"sec": 7, "nanosec": 0}}))]
        {
            fields[key] = value;
        }
        serde_json::from_value(fields).expect("an image")
    }

    #[test]
    fn rows_lose_their_padding_and_alpha_and_keep_the_order_of_their_colours() {
        let bgr = picture(image("bgr8", 8, &[1, 2, 3, 4, 5, 6, 0, 0, 7, 8, 9, 10, 11, 12, 0, 0])).expect("an image");
        assert_eq!(bgr.encoding, ImageEncoding::Bgr8);
        assert_eq!(bgr.bytes, [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12]);
        assert_eq!(bgr.stamp_s.to_bits(), 7.0_f64.to_bits());
        let bgra = picture(image("bgra8", 8, &[1, 2, 3, 255, 4, 5, 6, 255, 7, 8, 9, 255, 10, 11, 12, 255]));
        assert_eq!(bgra.expect("an image").bytes, bgr.bytes);
        let grey = picture(image("mono8", 2, &[1, 2, 3, 4])).expect("an image");
        assert_eq!((grey.encoding, grey.bytes), (ImageEncoding::Mono8, vec![1, 2, 3, 4]));
    }

    #[test]
    fn depth_is_millimetres_or_metres_with_the_little_end_first() {
        let (millimetres, size) = depth(image("16UC1", 4, &[1, 0, 2, 0, 3, 0, 4, 1])).expect("depth");
        assert_eq!((size, millimetres.encoding), ((2, 2), DepthEncoding::U16Mm));
        assert_eq!(millimetres.bytes, [1, 0, 2, 0, 3, 0, 4, 1]);
        let big =
            from_json(json!({"encoding": "16UC1", "is_bigendian": true, "step": 4, "data": [0, 1, 0, 2, 0, 3, 1, 4]}));
        assert_eq!(depth(big).expect("depth").0.bytes, millimetres.bytes);
        let floats: Vec<u8> = [0.5_f32, 1.0, f32::NAN, 2.0].iter().flat_map(|v| v.to_le_bytes()).collect();
        assert_eq!(depth(image("32FC1", 8, &floats)).expect("depth").0.encoding, DepthEncoding::F32M);
    }

    #[test]
    fn what_cannot_be_read_says_what_could() {
        let bayer = picture(image("bayer_rggb8", 2, &[0; 4])).expect_err("refused");
        assert!(bayer.contains("bayer_rggb8") && bayer.contains("mono8"), "{bayer}");
        assert!(picture(image("rgb8", 6, &[0; 11])).expect_err("refused").contains("11 bytes"));
        assert!(picture(image("rgb8", 5, &[0; 12])).is_err(), "rows shorter than their pixels");
        assert!(picture(image("rgb8", u32::MAX, &[0; 12])).is_err());
        assert!(depth(image("rgb8", 6, &[0; 12])).expect_err("refused").contains("32FC1"));
        let jpeg = from_json(json!({"format": "jpeg", "data": "AAAA"}));
        assert!(picture(jpeg).is_err());
        let packed = from_json(json!({"format": "16UC1; compressedDepth png", "data": "AAAA"}));
        assert!(picture(packed).expect_err("refused").contains("raw"));
    }
}
