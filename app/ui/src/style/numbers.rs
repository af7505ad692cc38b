//! Numbers as text, always of the same width so that they do not jump: the fonts have digits of equal width, and the
//! padding is as wide as a digit.

use handeye_geometry::frames::{Base, Pose};

/// A space as wide as a digit.
const FIGURE_SPACE: &str = "\u{2007}";

/// A number with a fixed number of decimals, padded on the left. The sign is a real minus, and −0 is 0.
pub fn fixed(value: f64, decimals: usize, width: usize) -> String {
    let text = format!("{value:.decimals$}");
    let is_zero = text.bytes().all(|byte| matches!(byte, b'-' | b'0' | b'.'));
    let text = if is_zero { text.trim_start_matches('-').to_owned() } else { text.replace('-', "−") };
    let padding = width.saturating_sub(text.chars().count());
    format!("{}{text}", FIGURE_SPACE.repeat(padding))
}

/// Several numbers in a row, with enough distance to separate two that fill their width.
pub fn row(values: &[f64], decimals: usize, width: usize) -> String {
    let between = format!("{FIGURE_SPACE} ");
    values.iter().map(|&value| fixed(value, decimals, width)).collect::<Vec<_>>().join(&between)
}

/// An error in millimetres: with hundredths, or with thousandths below a tenth.
pub fn error_mm(metres: f64) -> String {
    let mm = metres * 1e3;
    if mm < 0.1 { format!("{mm:.3}") } else { format!("{mm:.2}") }
}

/// Translation in millimetres.
pub fn translation_mm<Src>(pose: &Pose<Base, Src>) -> String {
    let translation = pose.translation() * 1e3;
    row(translation.as_slice(), 1, 6)
}

/// Roll, pitch and yaw in degrees: R = Rz(yaw) · Ry(pitch) · Rx(roll).
pub fn rpy_deg<Src>(pose: &Pose<Base, Src>) -> String {
    let (roll, pitch, yaw) = pose.rotation().euler_angles();
    row(&[roll.to_degrees(), pitch.to_degrees(), yaw.to_degrees()], 2, 7)
}

/// Quaternion x, y, z, w with w ≥ 0.
pub fn quaternion<Src>(pose: &Pose<Base, Src>) -> String {
    row(&pose.xyzw(), 4, 7)
}

#[cfg(test)]
mod tests {
    use handeye_geometry::frames::Tip;

    use super::*;

    fn plain(text: &str) -> String {
        text.replace(FIGURE_SPACE, " ")
    }

    #[test]
    fn numbers_keep_their_width_and_their_sign() {
        assert_eq!(plain(&fixed(1.25, 1, 7)), "    1.2");
        assert_eq!(plain(&fixed(-12.34, 1, 7)), "  −12.3");
        assert_eq!(plain(&fixed(-0.001, 1, 5)), "  0.0", "no negative zero");
        assert_eq!(fixed(123456.0, 1, 3), "123456.0", "never cut");
    }

    #[test]
    fn a_small_error_does_not_look_like_none() {
        assert_eq!([4e-6, 4.2e-4, 1.5e-3].map(error_mm), ["0.004", "0.42", "1.50"]);
    }

    #[test]
    fn a_tip_pose_is_written_in_millimetres_and_degrees() {
        let quarter = std::f64::consts::FRAC_PI_4;
        let pose =
            Pose::<Base, Tip>::from_translation_xyzw([0.11, -0.016, 0.847], [0.0, 0.0, quarter.sin(), quarter.cos()]);
        assert_eq!(plain(&translation_mm(&pose)), " 110.0   −16.0   847.0");
        assert_eq!(plain(&rpy_deg(&pose)), "   0.00     0.00    90.00");
        assert_eq!(plain(&quaternion(&pose)), " 0.0000   0.0000   0.7071   0.7071");
    }
}
