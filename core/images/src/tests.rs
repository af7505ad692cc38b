use std::io::Cursor;

use image::{ImageEncoder as _, ImageFormat, Rgb, RgbImage};

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

fn size(bytes: &[u8]) -> Result<(u32, u32), ImageFileError> {
    header::size(&mut Cursor::new(bytes))
}

#[test]
fn the_size_is_known_from_the_header_of_every_format_and_from_no_part_of_it() {
    for format in [ImageFormat::Png, ImageFormat::Jpeg, ImageFormat::Bmp, ImageFormat::Tiff] {
        let whole = encoded(format);
        assert_eq!(size(&whole).expect("a size"), (64, 48), "{format:?}");
        let enough = (1..whole.len()).find(|&kept| size(&whole[..kept]).is_ok()).unwrap_or(whole.len());
        assert!(enough > 20 && size(&whole[..enough]).expect("a size") == (64, 48), "{format:?} needs {enough} bytes");
    }
    let mut from_the_top = encoded(ImageFormat::Bmp);
    from_the_top[22..26].copy_from_slice(&(-48i32).to_le_bytes());
    assert_eq!(size(&from_the_top).expect("a size"), (64, 48));
    let mut without_frame = encoded(ImageFormat::Jpeg);
    let thumbnail = [0xFF, 0xFF, 0xE1, 0x00, 0x0B, 0xFF, 0xD8, 0xFF, 0xC0, 0x00, 0x07, 8, 0];
    without_frame.splice(2..2, thumbnail);
    assert_eq!(size(&without_frame).expect("a size"), (64, 48), "of the image and not of its thumbnail");
    without_frame.splice(2..2, [0xFF, 0xDA]);
    assert!(matches!(size(&without_frame), Err(ImageFileError::Undecodable(_))));
}

#[test]
fn the_size_of_a_big_tiff_of_the_other_order_of_bytes_is_known() {
    let field = |tag: u16, kind: u16, value: [u8; 8]| {
        [&tag.to_be_bytes()[..], &kind.to_be_bytes(), &1u64.to_be_bytes(), &value].concat()
    };
    let head = [b"MM\0\x2B\0\x08\0\0".as_slice(), &16u64.to_be_bytes(), &2u64.to_be_bytes()].concat();
    let short = [0x13, 0x88, 0, 0, 0, 0, 0, 0];
    let bytes = [head, field(256, 3, short), field(257, 16, 4000u64.to_be_bytes())].concat();
    assert_eq!(size(&bytes).expect("a size"), (5000, 4000));
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
