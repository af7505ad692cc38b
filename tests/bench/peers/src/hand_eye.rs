//! Calibrates camera and hand-eye of sessions in files by the crate `vision-calibration`, with its defaults for the robot:
//! poses are corrected, and their error is estimated. Prints a line of JSON for each file.

use std::error::Error;

use serde_json::{Value, json};
use vision_calibration::common::RobotPoseMeta;
use vision_calibration::core::{CameraFix, DistortionParams, Iso3};
use vision_calibration::optim::HandeyeMode;
use vision_calibration::prelude::*;
use vision_calibration::single_cam_handeye::{
    IntrinsicsManualInit, SingleCamHandeyeConfig, SingleCamHandeyeInput, SingleCamHandeyeProblem, step_handeye_init,
    step_handeye_optimize, step_intrinsics_init_with_seed, step_intrinsics_optimize,
};

use crate::{Session, session};

/// `mode` is `eye_in_hand` or `eye_to_hand`; a lens has fx fy cx cy k1 k2 p1 p2 k3, and is estimated when there is none.
pub fn run(mode: &str, lens: Option<&[f64]>, files: &[String]) {
    for file in files {
        let line = solve(mode, lens, file).unwrap_or_else(|error| json!({"missing": error.to_string()}));
        println!("{line}");
    }
}

fn solve(mode: &str, lens: Option<&[f64]>, file: &str) -> Result<Value, Box<dyn Error>> {
    let Session { views, base_from_tip } = session(file)?;
    let views = views.into_iter().zip(base_from_tip);
    let views = views.map(|(obs, pose)| View::new(obs, RobotPoseMeta { base_se3_gripper: pose })).collect();
    let mut config = SingleCamHandeyeConfig::default();
    config.handeye_init.handeye_mode =
        if mode == "eye_to_hand" { HandeyeMode::EyeToHand } else { HandeyeMode::EyeInHand };
    config.camera.fix = CameraFix { distortion: Some(Vec::new()), ..CameraFix::default() };
    let mut seed = IntrinsicsManualInit::default();
    if let Some(&[fx, fy, cx, cy, k1, k2, p1, p2, k3]) = lens {
        config.camera.fix = CameraFix::all(config.camera.model);
        seed.intrinsics = Some(FxFyCxCy { fx, fy, cx, cy });
        let params = BrownConrady5 { k1, k2, k3, p1, p2, ..BrownConrady5::default() };
        seed.distortion = Some(DistortionParams::BrownConrady5 { params });
    }
    let mut session = CalibrationSession::<SingleCamHandeyeProblem>::new();
    session.set_config(config)?;
    session.set_input(SingleCamHandeyeInput::new(views)?)?;
    step_intrinsics_init_with_seed(&mut session, seed, None)?;
    step_intrinsics_optimize(&mut session, None)?;
    step_handeye_init(&mut session, None)?;
    step_handeye_optimize(&mut session, None)?;
    let output = session.output().ok_or("no result")?;
    let camera = output.params.cameras.first().ok_or("no camera")?;
    let (k, covariance) = (camera.intrinsics, output.uncertainty.covariance());
    let sigma = |name: &str| {
        let covariance = covariance?;
        let label = covariance.labels.iter().find(|label| *label == name || label.ends_with(&format!(".{name}")))?;
        covariance.std_dev(label)
    };
    let of_link = |name: &str| {
        let covariance = covariance?;
        let label =
            covariance.labels.iter().find(|label| label.ends_with(&format!(".{name}")) && !label.contains("target"))?;
        covariance.std_dev(label)
    };
    Ok(json!({
        "hand_eye": matrix(&output.params.handeye),
        "translation_sigma_m": [of_link("tx"), of_link("ty"), of_link("tz")],
        "camera": [k.fx, k.fy, k.cx, k.cy],
        "camera_sigma": [sigma("fx"), sigma("fy"), sigma("cx"), sigma("cy")],
        "labels": covariance.map(|covariance| covariance.labels.clone()),
        "uncertainty": covariance.is_none().then(|| format!("{:?}", output.uncertainty)),
    }))
}

fn matrix(pose: &Iso3) -> Vec<Vec<f64>> {
    let m = pose.to_homogeneous();
    (0..4).map(|row| (0..4).map(|column| m[(row, column)]).collect()).collect()
}
