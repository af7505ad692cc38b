//! The calibration that is tracked with.

use std::path::Path;
use std::sync::Arc;

use handeye_estimate::corrected_arm::CorrectedArm;
use handeye_estimate::handeye::joint::SmallSample;
use handeye_estimate::handeye::{HandEye, Mode};
use handeye_estimate::verify::Predictor;
use handeye_geometry::targets::bent::BoardShape;
use handeye_geometry::targets::{Grid, TargetSpec};
use handeye_result::{ArmEstimate, BoardEstimate, CalibrationResult, PrintEstimate, TARGET_OPTION, TransformEstimate};
use handeye_session::{RESULT, Session};

use crate::Failure;

/// The content of a result.
pub struct Read {
    /// The calibration for the tip poses that the robot reports.
    pub calibrated: Predictor,
    /// The calibration for tip poses corrected for the errors of the arm, if correcting is expected to bring the tip
    /// nearer.
    pub corrected: Option<(Predictor, Arc<CorrectedArm>)>,
    /// The board it was made with, if that is known.
    pub target: Option<TargetSpec>,
}

/// Reads a result, or the result of a session.
pub fn read(path: &Path) -> Result<Read, Failure> {
    let is_session = Session::is_session(path);
    let file = if is_session { path.join(RESULT) } else { path.to_path_buf() };
    let result = CalibrationResult::read(&file).map_err(Failure::unusable)?;
    let unusable = |what: &str| {
        Failure::unusable(anyhow::anyhow!(
            "{} has no {what}: tracking needs a calibration of camera and hand-eye",
            file.display()
        ))
    };
    let (hand_eye, covariance) = links(&result).ok_or_else(|| unusable("hand-eye transform"))?;
    let intrinsics = result
        .intrinsics
        .as_ref()
        .and_then(handeye_result::IntrinsicsEstimate::intrinsics)
        .ok_or_else(|| unusable("intrinsics"))?;
    intrinsics.validate().map_err(Failure::unusable)?;
    let target = if is_session {
        Some(Session::open(path).map_err(Failure::unusable)?.document.meta.target)
    } else {
        let reported = result.provenance.options.get(TARGET_OPTION).cloned();
        reported.and_then(|value| serde_json::from_value(value).ok())
    };
    let board = result.estimate.as_ref().and_then(|estimate| estimate.board.as_ref());
    let shape = |board: Option<&BoardEstimate>| {
        board.map_or_else(BoardShape::default, |board| BoardShape {
            warp_m: board.warp_mm.map(|mm| mm * 1e-3),
            scale: board.scale,
        })
    };
    let print = result.estimate.as_ref().and_then(|estimate| estimate.print.as_ref());
    let calibrated = Predictor {
        hand_eye,
        intrinsics,
        shape: shape(board),
        print_errors_m: print.map_or_else(Vec::new, PrintEstimate::errors_m),
        field: result.estimate.as_ref().and_then(|estimate| Some(estimate.robot_field.as_ref()?.field())),
        arm: None,
        hand_eye_covariance: covariance,
        small_sample: small_sample(&result),
        uncertainty: None,
    };
    let helps = |arm: &&ArmEstimate| !arm.contradicted && result.quality.correcting_helps();
    let corrected = result.arm.as_ref().filter(helps).and_then(|arm| {
        let (hand_eye, covariance) = links_of(result.mode?, &arm.hand_eye, &arm.target)?;
        let corrected = arm.corrected_arm().ok()?;
        let by_arm = Predictor {
            hand_eye,
            intrinsics: arm.intrinsics.as_ref()?.intrinsics()?,
            shape: shape(arm.board.as_ref().or(board)),
            field: None,
            arm: Some(corrected.errors.clone()),
            hand_eye_covariance: covariance,
            small_sample: corrected.small_sample,
            ..calibrated.clone()
        };
        Some((by_arm, Arc::new(corrected)))
    });
    Ok(Read { calibrated, corrected, target })
}

/// How the error of the hand-eye transform is distributed; one without degrees of freedom is Gaussian.
fn small_sample(result: &CalibrationResult) -> SmallSample {
    let estimate = result.estimate.as_ref();
    let degrees_of_freedom = estimate.and_then(|estimate| estimate.degrees_of_freedom);
    let scale = estimate.and_then(|estimate| estimate.region_scale);
    SmallSample {
        degrees_of_freedom: degrees_of_freedom.unwrap_or(SmallSample::KNOWN.degrees_of_freedom),
        scale: scale.unwrap_or(SmallSample::KNOWN.scale),
        ..SmallSample::KNOWN
    }
}

fn links(result: &CalibrationResult) -> Option<(HandEye, Option<nalgebra::Matrix6<f64>>)> {
    links_of(result.mode?, result.hand_eye.as_ref()?, result.target.as_ref()?)
}

fn links_of(
    mode: Mode,
    hand_eye: &TransformEstimate,
    target: &TransformEstimate,
) -> Option<(HandEye, Option<nalgebra::Matrix6<f64>>)> {
    let links = match mode {
        Mode::EyeInHand => HandEye::EyeInHand { tip_from_camera: hand_eye.pose()?, base_from_target: target.pose()? },
        Mode::EyeToHand => HandEye::EyeToHand { base_from_camera: hand_eye.pose()?, tip_from_target: target.pose()? },
    };
    Some((links, hand_eye.covariance_matrix()))
}

/// Reads `10x7x15`: inner corners along x and y, and the side of a square in millimetres.
pub fn chessboard(text: &str) -> Result<TargetSpec, Failure> {
    let parts: Vec<&str> = text.split(['x', '×']).collect();
    let read = || -> Option<Grid> {
        let [columns, rows, square_mm] = parts.as_slice() else { return None };
        let square_m = square_mm.trim().parse::<f64>().ok()? * 1e-3;
        let grid = Grid { columns: columns.trim().parse().ok()?, rows: rows.trim().parse().ok()?, square_m };
        (grid.columns >= 3 && grid.rows >= 3 && square_m.is_finite() && square_m > 0.0).then_some(grid)
    };
    read().map(TargetSpec::Chessboard).ok_or_else(|| {
        Failure::unusable(anyhow::anyhow!(
            "{text:?} is not a chessboard: give inner corners along x and y, 3 or more, and the square in millimetres, as in \
             10x7x15"
        ))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_chessboard_is_read_from_the_command_line_and_nonsense_is_not() {
        let expected = Grid { columns: 10, rows: 7, square_m: 0.015 };
        assert!(matches!(chessboard("10x7x15"), Ok(TargetSpec::Chessboard(grid)) if grid == expected));
        for nonsense in ["", "10x7", "10x7x0", "10x7x-1", "2x7x15", "axbxc", "10x7xNaN", "10x7x15x2"] {
            assert!(chessboard(nonsense).is_err(), "{nonsense:?}");
        }
    }
}
