use image::{ImageEncoder as _, Rgb};

use super::*;

fn textured(width: u32, height: u32) -> RgbImage {
    RgbImage::from_fn(width, height, |x, y| Rgb([(x * 7 + y * 13) as u8, (x * y) as u8, (x ^ (y * 3)) as u8]))
}

fn encoded(format: ImageFormat) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    textured(64, 48).write_to(&mut bytes, format).expect("encode");
    bytes.into_inner()
}

#[test]
fn every_truncation_of_an_image_file_is_an_error() {
    for format in [ImageFormat::Png, ImageFormat::Jpeg, ImageFormat::Bmp, ImageFormat::Tiff] {
        let whole = encoded(format);
        assert!(decode_bytes(&whole).is_ok(), "{format:?}");
        for kept in (0..whole.len()).rev().step_by(if whole.len() > 4000 { 37 } else { 1 }).skip(1) {
            assert!(decode_bytes(&whole[..kept]).is_err(), "{format:?} cut to {kept} of {} bytes", whole.len());
        }
        // The last bytes matter most: there a lenient decoder has all pixels.
        for cut in 1..16 {
            assert!(decode_bytes(&whole[..whole.len() - cut]).is_err(), "{format:?} without its last {cut} bytes");
        }
    }
}

#[test]
fn a_truncated_file_is_called_truncated_where_the_format_shows_it() {
    for format in [ImageFormat::Png, ImageFormat::Jpeg] {
        let whole = encoded(format);
        let error = decode_bytes(&whole[..whole.len() / 2]).expect_err("half a file");
        assert!(error.to_string().contains("truncated"), "{format:?}: {error}");
    }
}

#[test]
fn a_jpeg_with_bytes_after_its_end_and_a_thumbnail_inside_is_whole() {
    let mut bytes = encoded(ImageFormat::Jpeg);
    let thumbnail = [0xFF, 0xE1, 0x00, 0x06, 0xFF, 0xD8, 0xFF, 0xD9];
    bytes.splice(2..2, thumbnail);
    bytes.extend_from_slice(b"trailing data of a phone");
    assert!(decode_bytes(&bytes).is_ok());
    assert!(decode_bytes(&bytes[..200]).is_err(), "the end marker of the thumbnail is not the end of the image");
}

#[test]
fn an_image_that_unpacks_to_more_than_a_camera_delivers_is_refused_unread() {
    // A PNG header that states 60000×60000 pixels and nothing behind it.
    let mut bytes = Vec::new();
    image::codecs::png::PngEncoder::new(&mut bytes)
        .write_image(&[0; 12], 2, 2, image::ExtendedColorType::Rgb8)
        .expect("encode");
    bytes[16..20].copy_from_slice(&60_000u32.to_be_bytes());
    bytes[20..24].copy_from_slice(&60_000u32.to_be_bytes());
    let crc = png_crc(&bytes[12..29]);
    bytes[29..33].copy_from_slice(&crc.to_be_bytes());
    let error = decode_bytes(&bytes).expect_err("a bomb");
    assert!(matches!(error, ImageFileError::TooLarge(_)), "{error}");
}

fn png_crc(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0u32, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |c, _| if c & 1 == 1 { 0xEDB8_8320 ^ (c >> 1) } else { c >> 1 })
    })
}

#[test]
fn grey_values_are_those_of_opencv() {
    // cv2.cvtColor(np.uint8([[[255, 0, 0], [0, 255, 0], [0, 0, 255], [10, 200, 90]]]), cv2.COLOR_RGB2GRAY)
    let colours = [([255, 0, 0], 76), ([0, 255, 0], 150), ([0, 0, 255], 29), ([10, 200, 90], 131)];
    for (rgb, gray) in colours {
        let image = RgbImage::from_pixel(1, 1, Rgb(rgb));
        assert_eq!(gray_from_rgb(&image).get_pixel(0, 0).0, [gray], "{rgb:?}");
    }
}

#[test]
fn a_folder_and_a_text_file_are_not_images() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    assert!(matches!(load_rgb(folder.path()), Err(ImageFileError::Unreadable(_))));
    let text = folder.path().join("image.png");
    fs::write(&text, "not an image").expect("write");
    assert!(matches!(image_size(&text), Err(ImageFileError::Undecodable(_))));
    fs::write(&text, "").expect("write");
    assert!(matches!(image_size(&text), Err(ImageFileError::Truncated(_))));
}
