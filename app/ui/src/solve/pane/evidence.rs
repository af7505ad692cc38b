//! The numbers behind a finding in one line.

use handeye_estimate::diagnose::findings::{Evidence, Finding};
use handeye_wording::decimals;

use crate::style::numbers;
use handeye_workbench::text::Language;
use handeye_workbench::tr;

/// Every number with its name and unit.
pub fn line(finding: &Finding, language: Language) -> String {
    finding.evidence.iter().map(|evidence| stated(evidence, language)).collect::<Vec<_>>().join(" · ")
}

fn stated(evidence: &Evidence, language: Language) -> String {
    let Evidence { name, value, unit } = *evidence;
    let is_count = unit.is_empty() && value.fract() == 0.0;
    let value = numbers::fixed(value, if is_count { 0 } else { decimals(value, 3) }, 0);
    let gap = if unit.is_empty() || unit == "°" { "" } else { " " };
    format!("{} {value}{gap}{unit}", called(name, language))
}

/// The name in words; those of closed forms are kept.
fn called(name: &'static str, language: Language) -> &'static str {
    match name {
        "views" => tr!(language, "views"),
        "needed" => tr!(language, "needed"),
        "of" => tr!(language, "of"),
        "largest_turn" => tr!(language, "largest turn"),
        "spread" => tr!(language, "spread of the axes"),
        "tip_axis_x" => tr!(language, "tip axis x"),
        "tip_axis_y" => tr!(language, "tip axis y"),
        "tip_axis_z" => tr!(language, "tip axis z"),
        "turn_about_strongest" => tr!(language, "turn about the strongest axis"),
        "turn_about_second" => tr!(language, "about the second"),
        "turn_about_weakest" => tr!(language, "about the weakest"),
        "largest_tilt" => tr!(language, "largest tilt"),
        "focal_sigma" => tr!(language, "σ of the focal length"),
        "covered" => tr!(language, "covered"),
        "empty_ninths" => tr!(language, "empty ninths of the image"),
        "influence" => tr!(language, "influence"),
        "median_influence" => tr!(language, "median influence"),
        "expected_error_95" => tr!(language, "expected error (95 %)"),
        "reach_error_95" => tr!(language, "tool arrives within (95 %)"),
        "reach_error_corrected_95" => tr!(language, "with corrected commands (95 %)"),
        "repeatability_95" => tr!(language, "not repeated by the arm (95 %)"),
        "moved_by_arm" => tr!(language, "by errors of the arm"),
        "rms" => tr!(language, "RMS"),
        "median_rms" => tr!(language, "median RMS"),
        "correction" => tr!(language, "correction"),
        "correction_angle" => tr!(language, "correction of the angle"),
        "median_correction" => tr!(language, "median correction"),
        "median_correction_angle" => tr!(language, "median correction of the angle"),
        "heldout_rms" => tr!(language, "held-out RMS"),
        "heldout_rms_corrected" => tr!(language, "held-out RMS, corrected"),
        "fold_radius" => tr!(language, "radius of the fold"),
        "expected_error_at_half_a_pixel" => {
            tr!(language, "expected error if the lens is good to half a pixel (95 %)")
        }
        "lens_accuracy" => tr!(language, "accuracy of the lens given"),
        "lens_off" => tr!(language, "lens off by (RMS)"),
        "image_reach" => tr!(language, "reach of the image"),
        "field_sigma" => tr!(language, "σ of errors by position"),
        "field_sigma_angle" => tr!(language, "σ of errors of the angle by position"),
        "explained_rms" => tr!(language, "explained RMS"),
        "robot_effect" => tr!(language, "effect of the robot"),
        "corner_noise" => tr!(language, "corner noise"),
        "robot_sigma" => tr!(language, "σ of the robot"),
        "robot_sigma_angle" => tr!(language, "σ of its angles"),
        "median_distance" => tr!(language, "median distance"),
        "goal" => tr!(language, "goal"),
        "more_views" => tr!(language, "more views"),
        "distance" => tr!(language, "distance"),
        "angle" => tr!(language, "angle"),
        "corners" => tr!(language, "corners"),
        "warp_x" => tr!(language, "bend along x"),
        "warp_x_sigma" => tr!(language, "σ of the bend along x"),
        "warp_y" => tr!(language, "bend along y"),
        "warp_y_sigma" => tr!(language, "σ of the bend along y"),
        "times" => tr!(language, "times"),
        "position" => tr!(language, "σ of the level of position"),
        "orientation" => tr!(language, "σ of the level of orientation"),
        "weakest_sigma" => tr!(language, "σ of the weakest direction"),
        "weakest_over_best" => tr!(language, "weakest over best"),
        "camera_axis_x" => tr!(language, "camera axis x"),
        "camera_axis_y" => tr!(language, "camera axis y"),
        "camera_axis_z" => tr!(language, "camera axis z"),
        other => called_by_doctor(other, language),
    }
}

/// The names of the numbers behind a diagnosis.
fn called_by_doctor(name: &'static str, language: Language) -> &'static str {
    match name {
        "wrong_corners" => tr!(language, "wrong corners"),
        "misfit_as_stated" => tr!(language, "misfit as stated"),
        "misfit_so" => tr!(language, "misfit read this way"),
        "camera_distance" => tr!(language, "distance of the camera"),
        "target_distance" => tr!(language, "distance of the target"),
        "misfit" => tr!(language, "misfit"),
        "true_over_stated_size" => tr!(language, "true over stated size"),
        "true_over_stated_size_sigma" => tr!(language, "σ of the size"),
        "focal_change" => tr!(language, "change of the focal length"),
        "focal_by_itself" => tr!(language, "focal length by itself"),
        "focal_by_others" => tr!(language, "focal length by the others"),
        "focal_difference_sigma" => tr!(language, "σ of their difference"),
        "centre_apart" => tr!(language, "distance of the principal points"),
        "chance" => tr!(language, "probability by chance"),
        "sessions" => tr!(language, "sessions"),
        "odd_sessions" => tr!(language, "sessions that differ"),
        "first_view_after" => tr!(language, "index of the first view after"),
        "moved" => tr!(language, "moved"),
        "turned" => tr!(language, "turned"),
        "moved_at_target" => tr!(language, "moved at the target"),
        "joint" => tr!(language, "joint"),
        "offset" => tr!(language, "offset"),
        "offset_sigma" => tr!(language, "σ of the offset"),
        "displacement" => tr!(language, "displacement"),
        "turn" => tr!(language, "turn"),
        "centre_change_x" => tr!(language, "change of the principal point along x"),
        "centre_change_y" => tr!(language, "change of the principal point along y"),
        "views_behind" => tr!(language, "views with the board behind the camera"),
        "fx_over_fy" => tr!(language, "fx over fy"),
        "fx_over_fy_sigma" => tr!(language, "σ of fx over fy"),
        "lens_times" => tr!(language, "times, of the lens"),
        "print_rms" => tr!(language, "RMS off the drawing"),
        "print_largest" => tr!(language, "farthest off the drawing"),
        "depth_ratio" => tr!(language, "measured over expected depth"),
        "depth_offset" => tr!(language, "offset of the depth"),
        "depth_offset_sigma" => tr!(language, "σ of the offset of the depth"),
        "depth_scale" => tr!(language, "scale of the depth"),
        "depth_scale_sigma" => tr!(language, "σ of the scale of the depth"),
        "depth_tilt_x" => tr!(language, "tilt of the depth about x"),
        "depth_tilt_y" => tr!(language, "tilt of the depth about y"),
        "displacement_rms" => tr!(language, "displacement, RMS"),
        "log_likelihood_gain" => tr!(language, "gain in log likelihood"),
        "robot_sigma_without" => tr!(language, "σ of the robot without"),
        "robot_sigma_with" => tr!(language, "σ of the robot with"),
        "robot_angle_without" => tr!(language, "σ of its angles without"),
        "robot_angle_with" => tr!(language, "σ of its angles with"),
        "held_out_without" => tr!(language, "held out without"),
        "held_out_with" => tr!(language, "held out with"),
        other => other,
    }
}
