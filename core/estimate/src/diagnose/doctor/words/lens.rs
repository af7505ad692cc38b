//! A centre that was given wrongly, in words.

use nalgebra::Vector2;

use handeye_geometry::camera::Intrinsics;
use handeye_wording::Text;
use handeye_wording::text;

/// What is wrong and what to do, where the centre would move by `off` \[px\]; `half` if that is half a pixel.
pub fn centre(given: Option<Intrinsics>, off: [f64; 2], sigma: [f64; 2], half: Option<Vector2<f64>>) -> (Text, Text) {
    let what = text!(
        "The centre of the lens given does not fit the images: cx would be {x} ± {x_sigma} px off and cy {y} ± {y_sigma} px.",
        x = format!("{:+.2}", off[0]),
        x_sigma = format!("{:.2}", sigma[0]),
        y = format!("{:+.2}", off[1]),
        y_sigma = format!("{:.2}", sigma[1])
    );
    let Some((given, half)) = given.zip(half) else {
        return (what, text!("Let the lens be estimated, or give that of this camera at this image size."));
    };
    let why = text!(
        "That is half a pixel: other programs count pixels from the corner of the first one, here its middle is 0."
    );
    let to_do = text!(
        "Give cx = {cx} and cy = {cy}, or let the lens be estimated.",
        cx = format!("{:.2}", given.cx + half.x),
        cy = format!("{:.2}", given.cy + half.y)
    );
    (Text::sentences([what, why]), to_do)
}

#[cfg(test)]
mod tests {
    use super::*;
    use handeye_wording::English;

    #[test]
    fn half_a_pixel_comes_with_the_centre_to_give() {
        let given = Some(Intrinsics { cx: 320.0, cy: 240.0, ..Intrinsics::pinhole(640, 480, 600.0) });
        let reported = |half: Option<Vector2<f64>>| {
            let (what, to_do) = centre(given, [-0.47, -0.52], [0.05; 2], half);
            Text::sentences([what, to_do]).in_language(English)
        };
        let half = reported(Some(Vector2::repeat(-0.5)));
        assert!(half.contains("half a pixel") && half.contains("cx = 319.50 and cy = 239.50"), "{half}");
        assert!(!reported(None).contains("half a pixel"));
    }
}
