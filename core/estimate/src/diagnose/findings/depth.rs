//! Findings on a depth camera.

use super::{Finding, FindingCode, Severity};
use crate::resolution;
use crate::verify::{DepthErrors, DepthReport, Estimated};
use handeye_wording::text;
use handeye_wording::{Text, shown};

/// Units that depths come in, and how many of them make a metre.
const UNITS: [(f64, &str); 7] =
    [(1e3, "mm"), (1e2, "cm"), (1e4, "0.1 mm"), (1e6, "µm"), (4e3, "0.25 mm"), (39.37, "inch"), (3.281, "foot")];
/// How near the ratio of depths has to be to that of a unit.
const NEAR: f64 = 0.05;

/// A finding on the depths of the captures, where they are off by more than chance and by more than the calibration itself is
/// (95 %, metres; `None` where it states nothing, then by more than any robot resolves).
pub fn finding(report: &DepthReport, stated_error_m: Option<f64>) -> Option<Finding> {
    if report.is_gross() {
        return Some(gross(report.ratio));
    }
    let errors = report.errors.as_ref()?;
    let least_m = stated_error_m.unwrap_or(0.0).max(resolution::PLACE_M);
    let counts = |of: Estimated, moves_m: f64| errors.is_certain(of) && (of.value * moves_m).abs() > least_m;
    let scale = errors.scale.filter(|scale| counts(*scale, errors.at_m));
    let tilt = errors.tilt_rad.iter().any(|tilt| counts(*tilt, BOARD_M));
    if !(counts(errors.offset_m, 1.0) || scale.is_some() || tilt) {
        return None;
    }
    Some(off(errors))
}

/// A tilt of the depths is judged by how far it moves a point at this lateral distance, metres.
const BOARD_M: f64 = 0.1;

fn gross(ratio: f64) -> Finding {
    let unit = UNITS.iter().find(|(factor, _)| (ratio / factor - 1.0).abs() < NEAR);
    let what = match unit {
        Some((_, unit)) => text!("they are in {unit}, and were taken for metres", unit = *unit),
        None if (ratio * 1e3 - 1.0).abs() < NEAR => text!("they were in metres, and were taken for mm"),
        None => text!("they are of another camera or another image, or in another unit"),
    };
    let text = text!(
        "The depths are {ratio} times what they should be at the target: {what}. Calibrate again with depths in metres. The answer \
         does not depend on them.",
        ratio = shown(ratio, 3),
        what = what
    );
    Finding::new(FindingCode::DepthError, Severity::Warning, text).with("depth_ratio", ratio, "")
}

fn off(errors: &DepthErrors) -> Finding {
    let mm = |of: Estimated| (of.value * 1e3, of.sigma * 1e3);
    let (offset, sigma) = mm(errors.offset_m);
    let [x, y] = errors.tilt_rad.map(|tilt| tilt.value.to_degrees());
    let mut parts = vec![text!(
        "{offset} ± {sigma} mm at a distance of {at} mm",
        offset = signed(offset, 2),
        sigma = shown(sigma, 2),
        at = format!("{:.0}", errors.at_m * 1e3)
    )];
    parts.extend(errors.scale.filter(|scale| errors.is_certain(*scale)).map(|scale| {
        text!(
            "growing by {percent} ± {sigma} % of the distance",
            percent = signed(scale.value * 1e2, 2),
            sigma = shown(scale.sigma * 1e2, 2)
        )
    }));
    if errors.tilt_rad.iter().any(|tilt| errors.is_certain(*tilt)) {
        parts.push(text!("turned by {x}° and {y}° about the camera's x and y", x = signed(x, 2), y = signed(y, 2)));
    }
    let text = text!(
        "The depth camera does not agree with the calibrated lens: its depths of the target are off by {parts}. The answer allows for \
         that, but points that are taken by depth are off by as much: correct the depths by these numbers, or calibrate \
         the depth camera.",
        parts = Text::list(parts.into_iter())
    );
    let finding = Finding::new(FindingCode::DepthError, Severity::Advice, text);
    let finding = finding.with("depth_offset", offset, "mm").with("depth_offset_sigma", sigma, "mm");
    let finding = match errors.scale {
        Some(scale) => {
            finding.with("depth_scale", scale.value * 1e2, "%").with("depth_scale_sigma", scale.sigma * 1e2, "%")
        }
        None => finding,
    };
    finding.with("depth_tilt_x", x, "°").with("depth_tilt_y", y, "°")
}

fn signed(value: f64, least: usize) -> String {
    let sign = if value < 0.0 { "−" } else { "+" };
    format!("{sign}{}", shown(value.abs(), least))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn errors(offset_mm: f64, scale: f64) -> DepthErrors {
        let of = |value: f64, sigma: f64| Estimated { value, sigma };
        DepthErrors {
            offset_m: of(offset_mm * 1e-3, 1e-4),
            at_m: 0.5,
            scale: Some(of(scale, 1e-4)),
            slope_px: Some(of(0.0, 0.1)),
            tilt_rad: [of(0.0, 1e-3); 2],
            noise_m: 1e-3,
            between_m: 1e-4,
            degrees_of_freedom: 9,
        }
    }

    fn report(ratio: f64, errors: Option<DepthErrors>) -> DepthReport {
        DepthReport { captures: 12, fill: 1.0, ratio, errors }
    }

    #[test]
    fn an_error_beyond_chance_and_beyond_that_of_the_calibration_is_said_with_its_size() {
        let found = finding(&report(1.0, Some(errors(2.0, 0.003))), Some(5e-4)).expect("off");
        let reported = found.to_string();
        assert!(reported.contains("+2.00 ± 0.10 mm at a distance of 500 mm, growing by +0.30 ± 0.01 %"), "{reported}");
        assert_eq!((found.severity, found.value("depth_offset")), (Severity::Advice, Some(2.0)));
        assert_eq!(finding(&report(1.0, Some(errors(2.0, 0.0))), Some(3e-3)), None, "less than the calibration is off");
        assert_eq!(finding(&report(1.0, Some(errors(0.2, 0.0))), None), None, "two standard deviations");
        assert_eq!(finding(&report(1.0, None), None), None);
        let mut exact = errors(0.005, 0.0);
        exact.offset_m.sigma = 1e-8;
        assert_eq!(finding(&report(1.0, Some(exact)), None), None, "no robot resolves 0.005 mm");
    }

    #[test]
    fn a_unit_is_named() {
        let reported = |ratio| finding(&report(ratio, None), None).expect("gross").to_string();
        assert!(reported(1002.0).contains("they are in mm"), "{}", reported(1002.0));
        assert!(reported(0.7).contains("of another camera"), "{}", reported(0.7));
    }
}
