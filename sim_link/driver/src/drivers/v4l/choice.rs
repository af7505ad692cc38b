//! Which of the formats and sizes that a camera offers is taken.

use super::pixels::PixelFormat;
use crate::message::MAX_IMAGE_SIDE;

/// A pixel format that a camera offers.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Offer {
    /// Its name in V4L2.
    pub code: [u8; 4],
    /// Its name for people.
    pub name: String,
    /// Sizes in pixels.
    pub sizes: Vec<Sizes>,
}

/// One size, or sizes in steps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sizes {
    /// One.
    One([u32; 2]),
    /// From the least to the greatest, in steps.
    Steps {
        /// Least width and height.
        least: [u32; 2],
        /// Greatest width and height.
        greatest: [u32; 2],
        /// Steps of width and height.
        step: [u32; 2],
    },
}

impl Sizes {
    fn has(&self, size: [u32; 2]) -> bool {
        match *self {
            Self::One(one) => one == size,
            Self::Steps { least, greatest, step } => (0..2).all(|i| {
                let of = size[i].checked_sub(least[i]);
                size[i] <= greatest[i] && of.is_some_and(|above| above.is_multiple_of(step[i].max(1)))
            }),
        }
    }

    fn greatest(&self) -> [u32; 2] {
        match *self {
            Self::One(size) | Self::Steps { greatest: size, .. } => size,
        }
    }

    fn said(&self) -> String {
        match *self {
            Self::One([width, height]) => format!("{width}x{height}"),
            Self::Steps { least, greatest, .. } => {
                format!("{}x{} to {}x{}", least[0], least[1], greatest[0], greatest[1])
            }
        }
    }
}

impl Offer {
    fn said(&self) -> String {
        let sizes: Vec<String> = self.sizes.iter().map(Sizes::said).collect();
        format!("{} ({}): {}", String::from_utf8_lossy(&self.code), self.name, sizes.join(", "))
    }
}

/// The format and the size to ask for: what is wished, or the largest of the format that loses least.
///
/// # Errors
/// None is as wished: names those that there are.
pub fn choose(
    offers: &[Offer],
    format: Option<PixelFormat>,
    size: Option<(u32, u32)>,
) -> Result<(PixelFormat, [u32; 2]), String> {
    let size = size.map(|(width, height)| [width, height]);
    let of = |format: PixelFormat| offers.iter().find(|offer| offer.code == format.code());
    let fits = |sizes: &Sizes| size.is_none_or(|size| sizes.has(size));
    let wanted = |candidate: &PixelFormat| format.is_none_or(|format| format == *candidate);
    for candidate in PixelFormat::ALL.into_iter().filter(wanted) {
        let Some(offer) = of(candidate) else { continue };
        let fitting = offer.sizes.iter().filter(|sizes| fits(sizes)).map(|sizes| size.unwrap_or(sizes.greatest()));
        let sendable = fitting.filter(|size| size.iter().all(|&side| (1..=MAX_IMAGE_SIDE).contains(&side)));
        if let Some(size) = sendable.max_by_key(|&[width, height]| u64::from(width) * u64::from(height)) {
            return Ok((candidate, size));
        }
    }
    let offered: Vec<String> = offers.iter().map(Offer::said).collect();
    let wanted = match (format, size) {
        (None, None) => {
            let read: Vec<String> = PixelFormat::ALL.iter().map(ToString::to_string).collect();
            format!("none of the formats that are read ({})", read.join(", "))
        }
        (Some(format), None) => format!("no {format}"),
        (None, Some([width, height])) => format!("no {width}x{height} in a format that is read"),
        (Some(format), Some([width, height])) => format!("no {format} of {width}x{height}"),
    };
    Err(format!("the camera offers {wanted}. It offers {}", offered.join("; ")))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn webcam() -> Vec<Offer> {
        let sizes = |list: &[[u32; 2]]| list.iter().copied().map(Sizes::One).collect();
        vec![
            Offer { code: *b"MJPG", name: "Motion-JPEG".into(), sizes: sizes(&[[1920, 1080], [640, 480]]) },
            Offer { code: *b"YUYV", name: "YUYV 4:2:2".into(), sizes: sizes(&[[320, 240], [640, 480]]) },
            Offer { code: *b"H264", name: "H.264".into(), sizes: sizes(&[[1920, 1080]]) },
        ]
    }

    #[test]
    fn what_loses_least_is_taken_and_another_format_where_the_size_asks_for_it() {
        assert_eq!(choose(&webcam(), None, None), Ok((PixelFormat::Yuyv, [640, 480])));
        assert_eq!(choose(&webcam(), None, Some((1920, 1080))), Ok((PixelFormat::Mjpg, [1920, 1080])));
        assert_eq!(choose(&webcam(), Some(PixelFormat::Mjpg), None), Ok((PixelFormat::Mjpg, [1920, 1080])));
    }

    #[test]
    fn sizes_in_steps_are_asked_for_as_they_are_offered() {
        let steps = Sizes::Steps { least: [16, 16], greatest: [1920, 1200], step: [8, 2] };
        let offers = [Offer { code: *b"GREY", name: "grey".into(), sizes: vec![steps] }];
        assert_eq!(choose(&offers, None, None), Ok((PixelFormat::Grey, [1920, 1200])));
        assert_eq!(choose(&offers, None, Some((640, 480))), Ok((PixelFormat::Grey, [640, 480])));
        assert!(choose(&offers, None, Some((641, 480))).is_err() && choose(&offers, None, Some((8, 8))).is_err());
    }

    #[test]
    fn what_is_not_offered_is_answered_with_what_is() {
        let why = choose(&webcam(), Some(PixelFormat::Grey), None).expect_err("there is none");
        assert!(why.contains("offers no GREY") && why.contains("MJPG (Motion-JPEG): 1920x1080, 640x480"), "{why}");
        let why = choose(&webcam(), None, Some((800, 600))).expect_err("there is none");
        assert!(why.contains("no 800x600") && why.contains("YUYV (YUYV 4:2:2): 320x240"), "{why}");
        let why = choose(&webcam()[2..], None, None).expect_err("H.264 is not read");
        assert!(why.contains("RGB3, YUYV, GREY, MJPG") && why.contains("H264"), "{why}");
    }
}
