//! Tracks a board through the images of a dataset folder, with the calibration made from the same images.
//!
//! ```text
//! cargo run --release -p handeye_track --example track_board -- FOLDER [SECONDS BETWEEN IMAGES]
//! ```
//!
//! Prints for each image whether the board is seen, where its first corner is in the robot's base, and the standard
//! deviation of that place. In a program of your own, images come from a camera, and [`Image::time_s`] is their time.

use std::error::Error;
use std::path::PathBuf;

use handeye_dataset::Dataset;
use handeye_detect::detect;
use handeye_estimate::Method;
use handeye_estimate::diagnose::calibrate;
use handeye_estimate::verify::Predictor;
use handeye_geometry::progress::CancelToken;
use handeye_track::{Image, MotionModel, Setup, Tracker};

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let folder: PathBuf = arguments.next().ok_or("usage: track_board FOLDER [SECONDS]")?.into();
    let interval_s: f64 = arguments.next().map_or(Ok(1.0), |text| text.parse())?;

    let dataset = Dataset::read(&folder)?;
    let mut images = Vec::new();
    for entry in &dataset.entries {
        images.push(dataset.load_gray(entry)?);
    }
    let observations = dataset.observations(|index| detect(&images[index], &dataset.target).ok().flatten());
    let calibration = calibrate(&observations, Method::Joint, &CancelToken::default())?;

    let mut tracker = Tracker::new(Setup {
        target: dataset.target,
        calibrated: Predictor::new(&calibration)?,
        motion: MotionModel::default(),
    })?;
    for (index, (entry, grey)) in dataset.entries.iter().zip(&images).enumerate() {
        let base_from_tip = entry.base_from_tip.ok_or("the folder has no robot poses")?;
        let time_s = index as f64 * interval_s;
        let update = tracker.see(&Image { time_s, grey, depth: None, far_plane_m: f32::INFINITY, base_from_tip })?;
        match update.estimate {
            Some(estimate) => {
                let at_mm = estimate.base_from_target.translation() * 1e3;
                let sigma_mm = estimate.covariance.fixed_view::<3, 3>(0, 0).trace().sqrt() * 1e3;
                println!("{}: {:?}, at {:.2?} mm ± {sigma_mm:.2} mm", entry.name, update.state, at_mm.as_slice());
            }
            None => println!("{}: {:?}", entry.name, update.state),
        }
    }
    Ok(())
}
