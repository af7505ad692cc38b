//! Findings on the views themselves: how many, where, how much the robot turned.

use nalgebra::Vector3;

use super::{Finding, FindingCode, Severity, listed};
use crate::diagnose::Calibration;
use crate::diagnose::coverage::{Coverage, CoveredView};
use crate::handeye::motion::MIN_VIEWS;
use crate::handeye::{HandEyeError, motion};
use crate::{CameraKnowledge, GOOD_VIEWS, Observations, ObservedView, ViewStatus};
use handeye_geometry::frames::{Anchor, Mount, Pose};
use handeye_wording::Text;
use handeye_wording::text;

/// Largest turn between two views, degrees, below which views count as too similar: the published sessions turn by 60° and
/// more.
const ALIKE_DEG: f64 = 20.0;
/// RMS turn about the second axis, degrees, below which it is weak. In simulation (ten views, robot noise 0.1 mm and
/// 0.02°) tilts within 10° (RMS turn 7°) leave three times the error of tilts within 35° (25°), and within 20° twice.
const WEAK_DEG: f64 = 10.0;
/// The same for a piece of advice.
const BETTER_DEG: f64 = 17.0;
/// Largest tilt of the board against the optical axis, degrees, below which focal length and distance are hard to tell
/// apart: perspective grows with the sine of the tilt.
const TILT_DEG: f64 = 20.0;
/// Standard deviation of the focal length, relative, from which it matters: at half a metre 0.3 % is 1.5 mm.
const FOCAL_SIGMA: f64 = 0.003;
/// Cells of the image on which coverage is judged.
const CELLS: (usize, usize) = (8, 6);
/// Part of the cells that should have been seen: a lens is extrapolated over the rest. It gives advice, never an alarm.
const COVERED: f64 = 0.5;

pub fn findings(observations: &Observations, calibration: Option<&Calibration>) -> Vec<Finding> {
    let in_fit: Vec<&ObservedView> = observations.views.iter().filter(|v| v.in_fit).collect();
    let only_poses =
        in_fit.iter().all(|v| v.corners.is_none()) && in_fit.iter().any(|v| v.camera_from_target.is_some());
    let seen: Vec<&ObservedView> = in_fit
        .iter()
        .copied()
        .filter(|v| if only_poses { v.camera_from_target.is_some() } else { v.corners.is_some() })
        .collect();
    let mut found = Vec::new();
    found.extend(number(seen.len()));
    found.extend(not_found(&in_fit, only_poses));
    if observations.mode.is_some() {
        found.extend(turns(&seen));
    }
    found.extend(calibration.and_then(tilt));
    if !only_poses {
        found.extend(coverage(observations, &seen));
    }
    found
}

fn number(views: usize) -> Option<Finding> {
    let (severity, need, text) = if views < MIN_VIEWS {
        let text =
            text!("{views} {views|view|views} of the target: a calibration takes at least {need}. Capture more poses.");
        (Severity::Problem, MIN_VIEWS, text)
    } else if views < GOOD_VIEWS {
        let text = text!(
            "{views} views of the target: enough for an answer, few for the noise levels on which its stated uncertainty \
             rests. Capture {need} or more."
        );
        (Severity::Advice, GOOD_VIEWS, text)
    } else {
        return None;
    };
    let text = text.with("views", views).with("need", need);
    let finding = Finding::new(FindingCode::TooFewViews, severity, text);
    Some(finding.with("views", views as f64, "").with("needed", need as f64, ""))
}

fn not_found(in_fit: &[&ObservedView], only_poses: bool) -> Option<Finding> {
    if only_poses {
        return None;
    }
    let missing: Vec<String> = in_fit.iter().filter(|v| v.corners.is_none()).map(|v| v.name.clone()).collect();
    if missing.is_empty() {
        return None;
    }
    let text = text!(
        "The target was not found in {count} of {of} views ({list}). Look at these images: is it wholly in view, sharp and \
         lit, and are its columns and rows right?",
        count = missing.len(),
        of = in_fit.len(),
        list = listed(&missing)
    );
    let (count, of) = (missing.len() as f64, in_fit.len() as f64);
    let mut finding =
        Finding::new(FindingCode::TargetNotFound, Severity::Warning, text).with("views", count, "").with("of", of, "");
    finding.views = missing;
    Some(finding)
}

/// Turns of the tip, in tip axes for both set-ups: that is what a person can turn.
fn turns(seen: &[&ObservedView]) -> Option<Finding> {
    // Base and tip take the parts of anchor and mount, whichever of the two carries the camera.
    let poses: Vec<Pose<Anchor, Mount>> = seen.iter().filter_map(|v| v.base_from_tip).map(|p| p.relabel()).collect();
    match motion::analyse(&poses) {
        Err(HandEyeError::NoRotation { largest_deg }) => Some(alike(largest_deg, Severity::Problem)),
        Err(HandEyeError::ParallelAxes { axis, spread_deg, .. }) => {
            let axis = Vector3::from(axis);
            let text = text!(
                "All turns are about the same axis of the tip, {axis}, within {spread}°: the camera's place along it cannot \
                 be seen. Add views turned by 30° about an axis across it.",
                axis = named(&axis),
                spread = format!("{spread_deg:.1}")
            );
            let finding = Finding::new(FindingCode::OneRotationAxis, Severity::Problem, text);
            Some(with_axis(finding, &axis).with("spread", spread_deg, "°"))
        }
        // Too few views and poses that are not finite are reported elsewhere.
        Err(_) => None,
        Ok(summary) => {
            let largest_deg = summary.largest_rotation_rad.to_degrees();
            if largest_deg < ALIKE_DEG {
                return Some(alike(largest_deg, Severity::Warning));
            }
            let turns = summary.principal_rotations_rad.map(f64::to_degrees);
            if turns[1] >= BETTER_DEG {
                return None;
            }
            let severity = if turns[1] < WEAK_DEG { Severity::Warning } else { Severity::Advice };
            let weak = &summary.principal_axes[2];
            let text = text!(
                "The tip turned by {strongest}° (RMS between views) about its axis {axis}, but by only {second}° and \
                 {weakest}° about the axes across it. Add views turned by 30° to both sides, most of all about {weak}.",
                strongest = format!("{:.0}", turns[0]),
                axis = named(&summary.principal_axes[0]),
                second = format!("{:.0}", turns[1]),
                weakest = format!("{:.0}", turns[2]),
                weak = named(weak)
            );
            let finding = Finding::new(FindingCode::WeakRotation, severity, text);
            let finding = with_axis(finding, weak).with("turn_about_strongest", turns[0], "°");
            Some(finding.with("turn_about_second", turns[1], "°").with("turn_about_weakest", turns[2], "°"))
        }
    }
}

fn alike(largest_deg: f64, severity: Severity) -> Finding {
    let text = text!(
        "The views are all alike: the tip turned by no more than {largest}° between any two. Turn it by 30° and more to all \
         sides about two axes, with the board in view.",
        largest = format!("{largest_deg:.1}")
    );
    Finding::new(FindingCode::ViewsAlike, severity, text).with("largest_turn", largest_deg, "°")
}

fn with_axis(finding: Finding, axis: &Vector3<f64>) -> Finding {
    finding.with("tip_axis_x", axis.x, "").with("tip_axis_y", axis.y, "").with("tip_axis_z", axis.z, "")
}

/// An axis by the coordinate axis it lies near, with its components.
fn named(axis: &Vector3<f64>) -> String {
    let name = ["x", "y", "z"][axis.iamax()];
    // Within 15° one word is enough.
    if axis.amax() > 0.966 { name.to_owned() } else { format!("[{:.2} {:.2} {:.2}]", axis.x, axis.y, axis.z) }
}

/// Only where intrinsics were estimated.
fn tilt(calibration: &Calibration) -> Option<Finding> {
    let camera = calibration.camera.filter(|camera| !camera.fixed)?;
    let (intrinsics, sigma) = (camera.intrinsics, camera.sigma_px?);
    let used = calibration.views.iter().filter(|v| v.status == ViewStatus::Used);
    let largest_deg = used
        .filter_map(|v| v.camera_from_target)
        .map(|pose| (pose.rotation() * Vector3::z()).z.abs().min(1.0).acos().to_degrees())
        .reduce(f64::max)?;
    if largest_deg >= TILT_DEG {
        return None;
    }
    let relative = (sigma[0] / intrinsics.fx).max(sigma[1] / intrinsics.fy);
    let severity = if relative > FOCAL_SIGMA { Severity::Warning } else { Severity::Advice };
    let decimals = if relative < 1e-4 { 4 } else { 2 };
    let text = text!(
        "The board was never tilted by more than {largest}° against the camera, and the focal length is known to {sigma} % \
         (one standard deviation). Add views with the board tilted by 30° to 45°.",
        largest = format!("{largest_deg:.0}"),
        sigma = format!("{:.decimals$}", relative * 100.0)
    );
    let finding = Finding::new(FindingCode::LittleTilt, severity, text);
    Some(finding.with("largest_tilt", largest_deg, "°").with("focal_sigma", relative * 100.0, "%"))
}

fn coverage(observations: &Observations, seen: &[&ObservedView]) -> Option<Finding> {
    if seen.len() < MIN_VIEWS {
        return None;
    }
    let views =
        seen.iter().filter_map(|v| Some(CoveredView { name: &v.name, corners: v.corners.as_deref()?, in_fit: true }));
    let coverage = Coverage::new(observations.image_size, CELLS, views);
    let covered = coverage.covered();
    if covered >= COVERED {
        return None;
    }
    let empty = empty_ninths(&coverage);
    let empty_count = empty.len();
    let where_empty = if empty.is_empty() {
        text!("it is seen in patches")
    } else {
        text!("nothing was seen at the {places}", places = Text::list(empty))
    };
    // A lens that is given needs no coverage; a lens that is estimated is only known where something was seen.
    let (severity, why) = match observations.camera {
        CameraKnowledge::Fixed(_) | CameraKnowledge::Near(_) => {
            (Severity::Info, text!("The intrinsics are given, so this matters little"))
        }
        CameraKnowledge::Estimate { .. } => {
            (Severity::Advice, text!("Bring the board there: the lens is only known where it was seen"))
        }
    };
    let text = text!(
        "The board covered {covered} % of the image; {where}. {why}.",
        covered = format!("{:.0}", covered * 100.0),
        where = where_empty,
        why = why
    );
    let finding = Finding::new(FindingCode::PoorCoverage, severity, text).with("covered", covered * 100.0, "%");
    Some(finding.with("empty_ninths", empty_count as f64, ""))
}

/// The ninths of the image in which no corner was seen.
fn empty_ninths(coverage: &Coverage) -> Vec<Text> {
    let names = [
        text!("top left"),
        text!("top"),
        text!("top right"),
        text!("left"),
        text!("middle"),
        text!("right"),
        text!("bottom left"),
        text!("bottom"),
        text!("bottom right"),
    ];
    let mut seen = [false; 9];
    for row in 0..coverage.rows {
        for column in 0..coverage.columns {
            // The ninth that the middle of the cell lies in.
            let ninth = |i: usize, of: usize| ((2 * i + 1) * 3) / (2 * of);
            seen[ninth(row, coverage.rows) * 3 + ninth(column, coverage.columns)] |= coverage.count(column, row) > 0;
        }
    }
    names.into_iter().zip(seen).filter(|(_, seen)| !seen).map(|(name, _)| name).collect()
}
