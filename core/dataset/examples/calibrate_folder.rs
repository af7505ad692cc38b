//! Calibrates a dataset folder whose corners are in a table, without OpenCV and without images.
//!
//! ```text
//! cargo run --release -p handeye_dataset --example calibrate_folder -- FOLDER
//! ```
//!
//! In a program of your own, `handeye_dataset` and `handeye_estimate` are all that it depends on.
//!
//! `dataset.toml` of the folder names the tables: `poses` under `[robot]` with the pose of the tip for each image, and
//! `corners` under `[target]` with a row `image,column,row,u,v` for each corner that a detector found, pixel (0, 0) being
//! the centre of the top-left pixel. `docs/reference/dataset.md` has all of it.
//!
//! What it prints is where the camera is: on the tip for an eye-in-hand set, in the base for an eye-to-hand set; and the
//! expected error of a point that is measured with it.

use std::error::Error;
use std::path::PathBuf;

use handeye_dataset::Dataset;
use handeye_estimate::Method;
use handeye_estimate::diagnose::calibrate;
use handeye_estimate::handeye::HandEye;
use handeye_geometry::frames::{Camera, Mount};
use handeye_geometry::progress::CancelToken;

fn main() -> Result<(), Box<dyn Error>> {
    let folder: PathBuf = std::env::args_os().nth(1).ok_or("usage: calibrate_folder FOLDER")?.into();
    let dataset = Dataset::read(&folder)?;
    // Corners that are not in a table would be detected in the images here.
    let observations = dataset.observations(|_| None);
    let calibration = calibrate(&observations, Method::Joint, &CancelToken::default())?;
    let hand_eye = calibration.hand_eye.ok_or("the folder has no robot poses")?;
    let (parent, pose) = match hand_eye {
        HandEye::EyeInHand { tip_from_camera, .. } => ("tip", tip_from_camera.relabel::<Mount, Camera>()),
        HandEye::EyeToHand { base_from_camera, .. } => ("base", base_from_camera.relabel()),
    };
    println!("{parent}_from_camera");
    println!("  translation [mm]: {:?}", (pose.translation() * 1e3).as_slice());
    println!("  rotation, quaternion xyzw: {:?}", pose.rotation().coords.as_slice());
    if let Some(error_m) = calibration.tip_error_95_m() {
        println!("expected error of a measured point, 95 %: {:.3} mm", error_m * 1e3);
    }
    Ok(())
}
