//! From a frame as the kernel has it to an image of the driver protocol.

use std::fmt;

use crate::message::ImageEncoding;

/// A pixel format that is read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PixelFormat {
    /// Two pixels in four bytes: Y U Y V.
    Yuyv,
    /// One byte a pixel.
    Grey,
    /// A JPEG file each.
    Mjpg,
    /// Red, green, blue.
    Rgb3,
}

impl PixelFormat {
    /// Those that are read, the ones first that lose least: JPEG blurs the edges that corners are found at.
    pub const ALL: [Self; 4] = [Self::Rgb3, Self::Yuyv, Self::Grey, Self::Mjpg];

    /// Its name in V4L2.
    pub const fn code(self) -> [u8; 4] {
        match self {
            Self::Yuyv => *b"YUYV",
            Self::Grey => *b"GREY",
            Self::Mjpg => *b"MJPG",
            Self::Rgb3 => *b"RGB3",
        }
    }

    /// The one of this name.
    pub fn of(code: [u8; 4]) -> Option<Self> {
        Self::ALL.into_iter().find(|format| format.code() == code)
    }

    fn bytes_per_pixel(self) -> usize {
        match self {
            Self::Yuyv => 2,
            Self::Grey => 1,
            Self::Rgb3 | Self::Mjpg => 3,
        }
    }

    /// How its images are sent.
    pub fn encoding(self) -> ImageEncoding {
        match self {
            Self::Yuyv | Self::Rgb3 => ImageEncoding::Rgb8,
            Self::Grey => ImageEncoding::Mono8,
            Self::Mjpg => ImageEncoding::Jpeg,
        }
    }
}

impl fmt::Display for PixelFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&String::from_utf8_lossy(&self.code()))
    }
}

/// How the colours of a YUYV image are coded.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Range {
    /// Y from 16 to 235, as in video: what V4L2 takes for the default of Y'CbCr.
    #[default]
    Limited,
    /// All values from 0 to 255.
    Full,
}

/// How the bytes of a frame lie.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Layout {
    /// What a pixel is.
    pub format: PixelFormat,
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Bytes from one row to the next; 0 where the device does not say, and then nothing pads a row.
    pub stride: u32,
    /// Of YUYV.
    pub range: Range,
}

/// The bytes of an image in the encoding of its format.
///
/// # Errors
/// What is wrong with the frame: the camera has lost a part of it. The next one may be whole.
pub fn image(layout: &Layout, frame: &[u8]) -> Result<Vec<u8>, String> {
    if layout.format == PixelFormat::Mjpg {
        return jpeg(frame).map(<[u8]>::to_vec);
    }
    let rows = rows(layout, frame)?;
    Ok(match layout.format {
        PixelFormat::Yuyv => {
            let mut rgb = Vec::with_capacity(3 * (layout.width * layout.height) as usize);
            for row in rows {
                for &[y0, u, y1, v] in row.as_chunks::<4>().0 {
                    rgb.extend(colour(y0, u, v, layout.range));
                    rgb.extend(colour(y1, u, v, layout.range));
                }
            }
            rgb
        }
        PixelFormat::Grey | PixelFormat::Rgb3 | PixelFormat::Mjpg => rows.flatten().copied().collect(),
    })
}

/// The rows without what pads them.
fn rows<'a>(layout: &Layout, frame: &'a [u8]) -> Result<impl Iterator<Item = &'a [u8]>, String> {
    let (width, height) = (layout.width as usize, layout.height as usize);
    let row = width * layout.format.bytes_per_pixel();
    let stride = if layout.stride == 0 { row } else { layout.stride as usize };
    if layout.format == PixelFormat::Yuyv && !width.is_multiple_of(2) {
        return Err(format!("YUYV has pairs of pixels, and a row has {width} pixels"));
    }
    // The last row need not be padded.
    let need = (stride * height).saturating_sub(stride.saturating_sub(row));
    if width == 0 || height == 0 || stride < row || frame.len() < need {
        return Err(format!(
            "a frame has {} bytes, and {width}×{height} of {} with {stride} bytes a row needs {need}",
            frame.len(),
            layout.format
        ));
    }
    Ok(frame.chunks(stride).take(height).map(move |padded| &padded[..row]))
}

/// A frame that begins and ends as a JPEG file does: what is cut off on its way over USB does not. Some cameras fill up the buffer
/// behind the end.
fn jpeg(frame: &[u8]) -> Result<&[u8], String> {
    const BEGIN: [u8; 2] = [0xff, 0xd8];
    const END: [u8; 2] = [0xff, 0xd9];
    let end = frame.windows(2).rposition(|pair| pair == END).map(|at| at + 2);
    match end {
        Some(end) if frame.starts_with(&BEGIN) => Ok(&frame[..end]),
        _ => Err(format!("a frame of {} bytes is no whole JPEG", frame.len())),
    }
}

/// Y'CbCr to RGB by ITU-R BT.601, what V4L2 takes for the default of cameras.
fn colour(y: u8, u: u8, v: u8, range: Range) -> [u8; 3] {
    let (y, u, v) = (f32::from(y), f32::from(u) - 128.0, f32::from(v) - 128.0);
    let (y, chroma) = match range {
        Range::Limited => ((y - 16.0) * 255.0 / 219.0, 255.0 / 224.0),
        Range::Full => (y, 1.0),
    };
    let (u, v) = (u * chroma, v * chroma);
    // `as` saturates.
    [y + 1.402 * v, y - 0.344_136 * u - 0.714_136 * v, y + 1.772 * u].map(|value| value.round() as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn layout(format: PixelFormat, width: u32, height: u32, stride: u32) -> Layout {
        Layout { format, width, height, stride, range: Range::Limited }
    }

    #[test]
    fn white_black_and_the_primaries_of_video_are_those_of_a_screen() {
        // BT.601, limited range, as tables of video have them.
        let known = [
            ([235, 128, 128], [255, 255, 255]),
            ([16, 128, 128], [0, 0, 0]),
            ([81, 90, 240], [255, 0, 0]),
            ([145, 54, 34], [0, 255, 0]),
            ([41, 240, 110], [0, 0, 255]),
        ];
        for ([y, u, v], rgb) in known {
            let got = colour(y, u, v, Range::Limited);
            // Those codes are rounded to whole numbers.
            assert!(got.iter().zip(rgb).all(|(&a, b)| a.abs_diff(b) <= 2), "{got:?} {rgb:?}");
        }
        assert_eq!(colour(255, 128, 128, Range::Full), [255; 3]);
        assert_eq!(colour(0, 128, 128, Range::Full), [0; 3]);
    }

    #[test]
    fn a_pair_of_pixels_shares_its_colour_and_keeps_its_order_and_rows_are_not_shifted_by_what_pads_them() {
        // Two rows of two pixels and two bytes that pad each: black and white, white and black.
        let frame = [16, 128, 235, 128, 9, 9, 235, 128, 16, 128, 9, 9];
        let want = [[0; 3], [255; 3], [255; 3], [0; 3]].concat();
        assert_eq!(image(&layout(PixelFormat::Yuyv, 2, 2, 6), &frame), Ok(want.clone()));
        assert_eq!(
            image(&layout(PixelFormat::Yuyv, 2, 2, 6), &frame[..10]),
            Ok(want),
            "the last row need not be padded"
        );
        let grey = image(&layout(PixelFormat::Grey, 3, 2, 4), &[1, 2, 3, 0, 4, 5, 6, 0]);
        assert_eq!(grey, Ok(vec![1, 2, 3, 4, 5, 6]));
        let rgb = image(&layout(PixelFormat::Rgb3, 1, 2, 0), &[1, 2, 3, 4, 5, 6]);
        assert_eq!(rgb, Ok(vec![1, 2, 3, 4, 5, 6]));
    }

    #[test]
    fn a_frame_that_is_cut_off_is_no_image() {
        for format in [PixelFormat::Yuyv, PixelFormat::Grey, PixelFormat::Rgb3] {
            let why = image(&layout(format, 4, 4, 0), &[0; 12]).expect_err("it is too short");
            assert!(why.contains("12 bytes") && why.contains(&format.to_string()), "{why}");
        }
        let mjpg = layout(PixelFormat::Mjpg, 4, 4, 0);
        assert!(image(&mjpg, &[0xff, 0xd8, 1, 2, 3]).is_err());
        assert!(image(&mjpg, &[1, 2, 0xff, 0xd9]).is_err());
        assert!(image(&mjpg, &[]).is_err());
        assert_eq!(image(&mjpg, &[0xff, 0xd8, 1, 0xff, 0xd9, 0, 0]), Ok(vec![0xff, 0xd8, 1, 0xff, 0xd9]));
    }
}
