//! ROS `camera_info` YAML: keys and order of `camera_calibration_parsers` (`parse_yml.cpp`), distortion names of
//! `sensor_msgs/CameraInfo`.
//!
//! `projection_matrix` is the camera matrix as it is, which is valid for a single camera; ROS's own calibrator writes
//! the optimal new camera matrix there. Every camera driver with `camera_info_manager` reads the file.

use super::yaml::Yaml;
use super::{
    ExportError, ExportFile, ExportNames, Format, compare_numbers, compare_text, intrinsics_of, made_by, numbers,
    quoted,
};
use crate::camera::{Distortion, Intrinsics};
use crate::result::CalibrationResult;

pub(super) struct RosCameraInfo;

/// ROS's name of the model and its coefficients; a camera without distortion has `plumb_bob` with zeros.
fn model(distortion: &Distortion) -> (&'static str, Vec<f64>) {
    let name = match distortion {
        Distortion::None => return ("plumb_bob", vec![0.0; 5]),
        Distortion::BrownConrady(_) => "plumb_bob",
        Distortion::Rational(_) => "rational_polynomial",
        Distortion::Fisheye(_) => "equidistant",
    };
    (name, distortion.coefficients().to_vec())
}

fn camera_matrix(k: &Intrinsics) -> [f64; 9] {
    [k.fx, 0.0, k.cx, 0.0, k.fy, k.cy, 0.0, 0.0, 1.0]
}

fn projection_matrix(k: &Intrinsics) -> [f64; 12] {
    [k.fx, 0.0, k.cx, 0.0, 0.0, k.fy, k.cy, 0.0, 0.0, 0.0, 1.0, 0.0]
}

fn matrix(key: &str, rows: usize, values: &[f64]) -> String {
    let columns = values.len() / rows;
    format!("{key}:\n  rows: {rows}\n  cols: {columns}\n  data: [{}]\n", numbers(values))
}

impl Format for RosCameraInfo {
    fn name(&self) -> &'static str {
        "ros_camera_info"
    }

    fn description(&self) -> &'static str {
        "camera_info YAML for ROS 1 and ROS 2 camera drivers"
    }

    fn render(&self, result: &CalibrationResult, names: &ExportNames) -> Result<Vec<ExportFile>, ExportError> {
        let k = intrinsics_of(result)
            .ok_or(ExportError::NeedsIntrinsics { format: self.name(), alternative: "json or easy_handeye2" })?;
        let (model, coefficients) = model(&k.distortion);
        let rectification = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
        let text = format!(
            "# Intrinsics in pixels, pixel (0, 0) is the centre of the top-left pixel; no transform and no Euler \
             angles. The projection matrix is the camera matrix. {}\n\
             image_width: {}\nimage_height: {}\ncamera_name: {}\n{}distortion_model: {model}\n{}{}{}\
             binning_x: 0\nbinning_y: 0\nroi:\n  x_offset: 0\n  y_offset: 0\n  height: 0\n  width: 0\n  \
             do_rectify: false\n",
            made_by(result),
            k.width,
            k.height,
            quoted(&names.camera_name),
            matrix("camera_matrix", 3, &camera_matrix(&k)),
            matrix("distortion_coefficients", 1, &coefficients),
            matrix("rectification_matrix", 3, &rectification),
            matrix("projection_matrix", 3, &projection_matrix(&k)),
        );
        Ok(vec![ExportFile { name: "camera_info.yaml".into(), text }])
    }

    fn compare(&self, text: &str, result: &CalibrationResult, names: &ExportNames) -> Result<(), String> {
        let yaml = Yaml::parse(text)?;
        let k = intrinsics_of(result).ok_or("no intrinsics")?;
        let (model, coefficients) = model(&k.distortion);
        let size = [yaml.number("image_width")?, yaml.number("image_height")?];
        compare_numbers("the image size", &size, &[f64::from(k.width), f64::from(k.height)])?;
        compare_text("camera_name", yaml.text("camera_name")?, &names.camera_name)?;
        compare_text("distortion_model", yaml.text("distortion_model")?, model)?;
        compare_numbers("camera_matrix", &yaml.numbers("camera_matrix.data")?, &camera_matrix(&k))?;
        compare_numbers("distortion", &yaml.numbers("distortion_coefficients.data")?, &coefficients)?;
        compare_numbers("projection_matrix", &yaml.numbers("projection_matrix.data")?, &projection_matrix(&k))?;
        for key in ["camera_matrix", "distortion_coefficients", "rectification_matrix", "projection_matrix"] {
            let shape = yaml.number(&format!("{key}.rows"))? * yaml.number(&format!("{key}.cols"))?;
            let length = yaml.numbers(&format!("{key}.data"))?.len() as f64;
            compare_numbers(&format!("the shape of {key}"), &[shape], &[length])?;
        }
        Ok(())
    }
}
