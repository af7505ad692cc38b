//! Where the tracked board is in the base, from all images and from the newest alone.

use egui::Ui;
use handeye_geometry::frames::{Base, Pose, Target};
use handeye_track::{Estimate, Update};
use nalgebra::{Matrix3, Vector3};

use crate::style::numbers;
use crate::style::parts;
use handeye_wording::{Text, text};
use handeye_workbench::model::{Model, RotationFormat, TrackError};
use handeye_workbench::text::Language;
use handeye_workbench::tr;

/// An error stays within this many standard deviations with a probability of 95 %.
const SIGMAS_95: f64 = 1.96;

/// Figures of a coordinate: up to 9999.99 mm with its sign.
const FIGURES: usize = 8;

/// Width at which no row of numbers wraps: of three coordinates, or of the four parts of a quaternion.
pub fn width(ui: &Ui, rotation: RotationFormat) -> f32 {
    let widest = match rotation {
        RotationFormat::RollPitchYaw => numbers::row(&[-8888.88; 3], 2, FIGURES),
        RotationFormat::Quaternion => numbers::row(&[-0.8888; 4], 4, FIGURES - 1),
    };
    parts::stated_width(ui, &widest)
}

/// The numbers.
pub fn pose_ui(ui: &mut Ui, model: &Model) {
    let language = model.view.language;
    let Some(newest) = model.track.newest.as_ref().filter(|_| model.track.on) else {
        parts::section_ui(ui, tr!(language, "Board in the base"));
        let hint = tr!(
            language,
            "While it is tracked, its pose, its velocity and how sure they are stand here: from its corners and from the \
             depths at them."
        );
        parts::hint_ui(ui, hint);
        return;
    };
    parts::section_ui(ui, tr!(language, "Board in the base"));
    if model.track.by.as_ref().is_some_and(|by| by.arm.is_some()) {
        let how = tr!(
            language,
            "By tip poses corrected for the errors of the arm; what the arm is sent is corrected as well."
        );
        parts::hint_ui(ui, how);
    }
    match &newest.update.estimate {
        Some(estimate) => {
            estimate_ui(ui, estimate, model.view.rotation, language);
            parts::hint_ui(ui, &calibration_text(model).in_language(language));
        }
        None => parts::hint_ui(ui, tr!(language, "Where it is now is not known.")),
    }
    newest_image_ui(ui, &newest.update, language);
    if let Some(error) = newest.error {
        truth_ui(ui, error, language);
    }
}

/// The error of the calibration, which is not included in the numbers of the estimate.
fn calibration_text(model: &Model) -> Text {
    let quality = model.solve.current().map(|solved| &solved.result.quality);
    let reach = quality.and_then(|quality| Some((quality.reach_error_95_mm?, quality.reach_error_corrected_95_mm)));
    let is_corrected = model.track.by.as_ref().is_some_and(|by| by.arm.is_some());
    let shown = |mm: f64| format!("{mm:.2}");
    match (reach, quality.and_then(|quality| quality.tip_error_95_mm)) {
        (Some((_, Some(corrected_mm))), _) if is_corrected => text!(
            "± is the noise of images and motion alone: by corrected commands a tool arrives within {mm} mm (95 %).",
            mm = shown(corrected_mm)
        ),
        (Some((as_it_is_mm, _)), _) => text!(
            "± is the noise of images and motion alone: a tool arrives within {mm} mm (95 %).",
            mm = shown(as_it_is_mm)
        ),
        (None, Some(point_mm)) => text!(
            "± is the noise of images and motion alone: the calibration puts a point within {mm} mm (95 %).",
            mm = shown(point_mm)
        ),
        (None, None) => text!("± is the noise of images and motion alone: the error of the calibration is not known."),
    }
}

/// 95 % of each coordinate in the base of a pose with this covariance: of its translation, or of its rotation about the
/// axes of the base.
fn within_95(base_from_target: &Pose<Base, Target>, in_target: &Matrix3<f64>) -> Vector3<f64> {
    let rotation = base_from_target.rotation().to_rotation_matrix();
    let in_base = rotation.matrix() * in_target * rotation.matrix().transpose();
    in_base.diagonal().map(|variance| SIGMAS_95 * variance.max(0.0).sqrt())
}

fn estimate_ui(ui: &mut Ui, estimate: &Estimate, rotation: RotationFormat, language: Language) {
    let pose = &estimate.base_from_target;
    let exact = tr!(
        language,
        "The part that corners and motion cause; the calibration is taken as exact. Its own error is stated with the result."
    );
    let what = tr!(language, "The first corner of the board, x y z in the base");
    parts::stated_ui(
        ui,
        tr!(language, "Position [mm]"),
        &numbers::row((pose.translation() * 1e3).as_slice(), 2, FIGURES),
    )
    .on_hover_text(what);
    let position = within_95(pose, &estimate.covariance.fixed_view::<3, 3>(0, 0).into_owned()) * 1e3;
    parts::stated_ui(ui, tr!(language, "± 95 % [mm]"), &numbers::row(position.as_slice(), 2, FIGURES))
        .on_hover_text(exact);
    match rotation {
        RotationFormat::RollPitchYaw => {
            let (roll, pitch, yaw) = pose.rotation().euler_angles();
            // In the columns of the other rows.
            let deg = [roll, pitch, yaw].map(f64::to_degrees);
            parts::stated_ui(ui, tr!(language, "roll pitch yaw [°]"), &numbers::row(&deg, 2, FIGURES));
        }
        RotationFormat::Quaternion => {
            parts::stated_ui(ui, tr!(language, "quaternion x y z w"), &numbers::quaternion(pose));
        }
    }
    let turn = within_95(pose, &estimate.covariance.fixed_view::<3, 3>(3, 3).into_owned()).map(f64::to_degrees);
    let about = tr!(language, "About x, y and z of the base; the calibration is taken as exact");
    parts::stated_ui(ui, tr!(language, "± 95 % [°]"), &numbers::row(turn.as_slice(), 2, FIGURES)).on_hover_text(about);
    let velocity = estimate.velocity_m_s * 1e3;
    parts::stated_ui(ui, tr!(language, "Velocity [mm/s]"), &numbers::row(velocity.as_slice(), 1, FIGURES));
}

/// The newest image alone, in two ways that share only the hand-eye transform.
fn newest_image_ui(ui: &mut Ui, update: &Update, language: Language) {
    if update.seen.is_none() && update.by_depth.is_none() {
        return;
    }
    parts::section_ui(ui, tr!(language, "Newest image only"));
    let position = |pose: &Pose<Base, Target>| numbers::row((pose.translation() * 1e3).as_slice(), 2, FIGURES);
    if let Some(seen) = &update.seen {
        let what = text!(
            "From the corners and the size of the squares; corners are {rms} px from where the pose has them",
            rms = format!("{:.2}", seen.rms_px)
        );
        parts::stated_ui(ui, tr!(language, "By corners [mm]"), &position(&seen.base_from_target))
            .on_hover_text(what.in_language(language));
    }
    let Some(by_depth) = &update.by_depth else {
        parts::hint_ui(ui, tr!(language, "The image has no depth at enough corners to compare with."));
        return;
    };
    let what = text!(
        "From pixel and depth at {count} corners; they are {rms} mm from a plane board",
        count = by_depth.corners,
        rms = format!("{:.2}", by_depth.rms_m * 1e3)
    );
    parts::stated_ui(ui, tr!(language, "By depth [mm]"), &position(&by_depth.base_from_target))
        .on_hover_text(what.in_language(language));
    if let Some(seen) = &update.seen {
        let (distance_m, angle_rad) = seen.base_from_target.distance_to(&by_depth.base_from_target);
        let apart = format!("{:.2} mm, {:.2}°", distance_m * 1e3, angle_rad.to_degrees());
        let what = tr!(
            language,
            "Between both. Corners do not use depth and depths do not use the size of the board, so that a wrong camera or \
             board shows here."
        );
        parts::stated_ui(ui, tr!(language, "Apart"), &apart).on_hover_text(what);
    }
}

fn truth_ui(ui: &mut Ui, error: TrackError, language: Language) {
    parts::section_ui(ui, tr!(language, "Against the simulator's truth"));
    let what =
        tr!(language, "Distance of the middle of the board from where the simulated cell had it in the same image");
    parts::stated_ui(ui, tr!(language, "Position error [mm]"), &numbers::fixed(error.position_m * 1e3, 3, FIGURES))
        .on_hover_text(what);
    let turned = numbers::fixed(error.rotation_rad.to_degrees(), 3, FIGURES);
    parts::stated_ui(ui, tr!(language, "Rotation error [°]"), &turned);
}

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry3, Translation3, UnitQuaternion};

    use super::*;

    #[test]
    fn the_uncertainty_along_the_axes_of_the_board_is_told_along_those_of_the_base() {
        // x of the board is y of the base.
        let turn = UnitQuaternion::from_euler_angles(0.0, 0.0, std::f64::consts::FRAC_PI_2);
        let pose = Pose::from_isometry(Isometry3::from_parts(Translation3::identity(), turn));
        let in_target = Matrix3::from_diagonal(&Vector3::new(4.0, 1.0, 0.25));
        let within = within_95(&pose, &in_target) / SIGMAS_95;
        assert!((within - Vector3::new(1.0, 2.0, 0.5)).norm() < 1e-12, "{within}");
    }
}
