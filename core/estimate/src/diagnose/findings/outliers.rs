//! Findings on what the estimate decided on its own: views and corners left out as an outlier, views numbered from the other end,
//! a bent target, a widened uncertainty, noise levels that cannot be told apart.

use super::{Finding, FindingCode, Severity, listed};
use crate::diagnose::Calibration;
use crate::{JointFit, ViewResult, ViewStatus, resolution};
use handeye_wording::text;
use handeye_wording::{Text, shown};

/// Relative standard deviation of a noise level above which it counts as not determined: where it is with a probability of
/// 95 % the highest is then seven times the lowest, e^(4 · 0.5).
const UNCLEAR: f64 = 0.5;
/// A level whose effect on a pose is no more than this part of that of corner noise need not be told apart from it: it is a
/// fifth of the variance of both together.
const NO_MATTER: f64 = 0.5;
/// A stated uncertainty that was widened by fewer times is not worth reporting: standard deviations are read to one
/// figure.
pub const WIDENING_WORTH_SAYING: f64 = 1.05;

pub fn findings(calibration: &Calibration) -> Vec<Finding> {
    let mut found = Vec::new();
    found.extend(outliers(calibration));
    found.extend(corners(calibration));
    found.extend(renumbered(calibration));
    found.extend(bent(calibration));
    found.extend(widened(calibration));
    found.extend(lens_widened(calibration));
    found.extend(unclear(calibration));
    found
}

fn named<'a>(views: impl Iterator<Item = &'a ViewResult>) -> Vec<String> {
    views.map(|view| view.name.clone()).collect()
}

fn with_views(finding: Finding, names: &[String]) -> Finding {
    names.iter().fold(finding, |finding, name| finding.of_view(name))
}

fn outliers(calibration: &Calibration) -> Option<Finding> {
    let rejected = || calibration.views.iter().filter(|view| view.status == ViewStatus::Outlier);
    let names = named(rejected());
    if names.is_empty() {
        return None;
    }
    let worst = rejected()
        .filter_map(|view| view.distance)
        .filter(|d| d.metres.is_finite())
        .max_by(|a, b| a.of_limit.total_cmp(&b.of_limit));
    let how_far = worst.map_or_else(
        || text!("its corners are no image of the target"),
        |d| {
            text!(
                "the target is up to {mm} mm and {deg}° from where the other views put it",
                mm = shown(d.metres * 1e3, 1),
                deg = shown(d.radians.to_degrees(), 2)
            )
        },
    );
    let what = text!(
        "{count} outlier {count|view|views}, the answer is without: {list} ({how_far}).",
        count = names.len(),
        list = listed(&names),
        how_far = how_far
    );
    let advice = text!(
        "The arm may still have moved, the board may have been touched, or another pose was written down; capture again, or \
         keep all views to see the difference."
    );
    let text = Text::sentences([what, advice]);
    let finding = Finding::new(FindingCode::OutlierView, Severity::Warning, text).with("views", names.len() as f64, "");
    let finding = match worst {
        Some(d) => finding.with("distance", d.metres * 1e3, "mm").with("angle", d.radians.to_degrees(), "°"),
        None => finding,
    };
    Some(with_views(finding, &names))
}

fn corners(calibration: &Calibration) -> Option<Finding> {
    let names = named(calibration.views.iter().filter(|view| !view.rejected_corners.is_empty()));
    if names.is_empty() {
        return None;
    }
    let count: usize = calibration.views.iter().map(|view| view.rejected_corners.len()).sum();
    let what = text!(
        "{count} outlier {count|corner|corners}, far from where the rest of the view puts {count|it|them}: in {list}.",
        count = count,
        list = listed(&names)
    );
    let text = Text::sentences([what, text!("Look for reflections and things in front of the target.")]);
    let finding = Finding::new(FindingCode::OutlierCorners, Severity::Info, text).with("corners", count as f64, "");
    Some(with_views(finding, &names))
}

fn renumbered(calibration: &Calibration) -> Option<Finding> {
    let names = named(calibration.views.iter().filter(|view| view.quarter_turns != 0));
    if names.is_empty() {
        return None;
    }
    let is_square = calibration.views.iter().any(|view| view.quarter_turns % 2 == 1);
    let text = if is_square {
        text!(
            "The target looks the same after a quarter turn, and was counted from another corner in {list} to agree with the rest. A \
             ChArUco board has no such choice.",
            list = listed(&names)
        )
    } else {
        text!(
            "The target looks the same from both ends, and was counted from the other end in {list} to agree with the rest. A \
             target with an odd sum of inner corners, or a ChArUco board, has no such choice.",
            list = listed(&names)
        )
    };
    let finding = Finding::new(FindingCode::Renumbered, Severity::Info, text).with("views", names.len() as f64, "");
    Some(with_views(finding, &names))
}

fn bent(calibration: &Calibration) -> Option<Finding> {
    let by_robot = calibration.joint.as_ref().and_then(|joint| joint.shape);
    let by_camera = || calibration.camera_fit.as_ref().and_then(|fit| fit.shape);
    let estimate = by_robot.or_else(by_camera)?;
    let sigma = estimate.warp_sigma_m?.map(|m| m * 1e3);
    let [x, y] = estimate.shape.warp_m.map(|m| m * 1e3);
    let text = text!(
        "The target is bent by {x} ± {x_sigma} mm along x and {y} ± {y_sigma} mm along y (middle against edges, one standard \
         deviation). The answer allows for it; fix the target to a flat plate for a better one.",
        x = shown(x, 2),
        x_sigma = shown(sigma[0], 2),
        y = shown(y, 2),
        y_sigma = shown(sigma[1], 2)
    );
    let finding = Finding::new(FindingCode::BoardBent, Severity::Advice, text);
    let finding = finding.with("warp_x", x, "mm").with("warp_x_sigma", sigma[0], "mm");
    Some(finding.with("warp_y", y, "mm").with("warp_y_sigma", sigma[1], "mm"))
}

fn widened(calibration: &Calibration) -> Option<Finding> {
    let widening = &calibration.joint.as_ref()?.widening;
    let by = widening.by?;
    let times = widening.factor.sqrt();
    if times < WIDENING_WORTH_SAYING {
        return None;
    }
    let text = text!(
        "The stated uncertainty is {times} times what independent noise explains, because {why}. It counts what the data \
         show; more poses in other places of the workspace help more than many in one.",
        times = shown(times, 1),
        why = by.reason()
    );
    Some(Finding::new(FindingCode::UncertaintyWidened, Severity::Info, text).with("times", times, ""))
}

/// An estimated lens that single views pull about by more than their noise.
fn lens_widened(calibration: &Calibration) -> Option<Finding> {
    let widening = &calibration.joint.as_ref()?.widening;
    let times = widening.lens.sqrt();
    if !widening.lens_is_refuted() || times < WIDENING_WORTH_SAYING {
        return None;
    }
    let text = text!(
        "The views disagree about the lens: its stated uncertainty is {times} times what independent corners explain, and the \
         answer's is larger as far as it rests on the lens. Views tilted by 30° to 45° that cover the whole image make it \
         smaller.",
        times = format!("{times:.1}")
    );
    Some(Finding::new(FindingCode::UncertaintyWidened, Severity::Info, text).with("lens_times", times, ""))
}

/// When robot and corner noise cannot be told apart, the robot's level is a guess between zero and what is stated.
fn unclear(calibration: &Calibration) -> Option<Finding> {
    let JointFit { small_sample: sample, noise, robot_effect_px: robot_px, .. } = *calibration.joint.as_ref()?;
    let [_, position, orientation] = sample.level_sigma;
    let [_, [m_low, m_high], [rad_low, rad_high]] = sample.level_range;
    let unclear = position.max(orientation);
    let is_fine = robot_px < NO_MATTER * noise.corner_px || !resolution::is_resolved(m_high, rad_high);
    if unclear < UNCLEAR || is_fine {
        return None;
    }
    let level = |low: f64, high: f64, least: f64, reported: &dyn Fn(f64) -> String| {
        // Below what a robot resolves it cannot be distinguished from zero.
        if low < least {
            text!("below {high}", high = reported(high))
        } else {
            text!("between {low} and {high}", low = reported(low), high = reported(high))
        }
    };
    let text = text!(
        "Robot and corner noise can hardly be told apart: the robot's noise per axis is {position} and {orientation} (95 %). The \
         expected error allows for it. More views, or better images, tell them apart.",
        position = level(m_low, m_high, resolution::PLACE_M, &|m| format!("{} mm", shown(m * 1e3, 3))),
        orientation =
            level(rad_low, rad_high, resolution::ANGLE_RAD, &|rad| format!("{}°", shown(rad.to_degrees(), 4)))
    );
    let finding = Finding::new(FindingCode::NoiseUnclear, Severity::Info, text);
    Some(finding.with("position", position * 100.0, "%").with("orientation", orientation * 100.0, "%"))
}
