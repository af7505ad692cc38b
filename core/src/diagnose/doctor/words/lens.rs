//! A centre that was given wrongly, in words.

use crate::geometry::camera::Intrinsics;
use crate::text;
use crate::wording::Text;

/// Standard deviations that a centre may be from half a pixel and still be called that: passed by chance by one in two hundred,
/// of two coordinates.
const SIGMAS: f64 = 3.0;

/// What is wrong and what to do, where the centre would go by `off` \[px\].
pub fn centre(given: Option<Intrinsics>, off: [f64; 2], sigma: [f64; 2]) -> (Text, Text) {
    let what = text!(
        "The centre of the lens given does not fit the images: cx would be {x} ± {x_sigma} px off and cy {y} ± {y_sigma} px.",
        x = format!("{:+.2}", off[0]),
        x_sigma = format!("{:.2}", sigma[0]),
        y = format!("{:+.2}", off[1]),
        y_sigma = format!("{:.2}", sigma[1])
    );
    let Some(given) = given.filter(|_| off.iter().zip(sigma).all(|(off, sigma)| is(0.5, *off, sigma))) else {
        return (what, text!("Let the lens be estimated, or give that of this camera at this image size."));
    };
    let why = text!(
        "That is half a pixel: other programs count pixels from the corner of the first one, here its middle is 0."
    );
    let to_do = text!(
        "Give cx = {cx} and cy = {cy}, or let the lens be estimated.",
        cx = format!("{:.2}", given.cx + 0.5f64.copysign(off[0])),
        cy = format!("{:.2}", given.cy + 0.5f64.copysign(off[1]))
    );
    (Text::sentences([what, why]), to_do)
}

/// Whether a number is a step either way, by a precision that rules out both none and two of them.
fn is(step: f64, off: f64, sigma: f64) -> bool {
    SIGMAS * sigma < step && (off.abs() - step).abs() <= SIGMAS * sigma
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wording::English;

    #[test]
    fn half_a_pixel_is_named_only_where_the_data_tell_it_from_none_and_from_one() {
        let given = Some(Intrinsics { cx: 320.0, cy: 240.0, ..Intrinsics::pinhole(640, 480, 600.0) });
        let said = |off: [f64; 2], sigma: f64| {
            let (what, to_do) = centre(given, off, [sigma; 2]);
            Text::sentences([what, to_do]).say(English)
        };
        assert!(said([-0.47, -0.52], 0.05).contains("half a pixel"));
        assert!(said([-0.47, -0.52], 0.05).contains("cx = 319.50 and cy = 239.50"));
        assert!(said([0.47, -0.52], 0.05).contains("cx = 320.50 and cy = 239.50"));
        for (off, sigma) in [([-0.5, -0.5], 0.2), ([-0.9, -0.5], 0.1), ([-0.5, 0.0], 0.05), ([-4.0, 2.0], 0.1)] {
            assert!(!said(off, sigma).contains("half a pixel"), "{off:?} ± {sigma}");
        }
    }
}
