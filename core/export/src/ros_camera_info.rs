//! ROS `camera_info` YAML: keys and order of `camera_calibration_parsers` (`parse_yml.cpp`), distortion names of
//! `sensor_msgs/CameraInfo`.
//!
//! `projection_matrix` is the camera matrix as it is, which is valid for a single camera; ROS's own calibrator writes
//! the optimal new camera matrix there. Every camera driver with `camera_info_manager` reads the file.

use super::text::{about_intrinsics, numbers, quoted};
use super::yaml::{Leaf, Yaml};
use super::{ExportError, ExportFile, ExportInput, Format};
use handeye_geometry::camera::{Distortion, Intrinsics};
use handeye_wording::Text;

pub(super) struct RosCameraInfo;

const RECTIFICATION: [f64; 9] = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];

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

    fn description(&self) -> Text {
        handeye_wording::text!("camera_info YAML that ROS camera drivers load (intrinsics)")
    }

    fn render(&self, input: &ExportInput<'_>) -> Result<Vec<ExportFile>, ExportError> {
        let k = input.intrinsics(self.name())?;
        let (model, coefficients) = model(&k.distortion);
        let text = format!(
            "# {} The projection matrix is the camera matrix.\n\
             image_width: {}\nimage_height: {}\ncamera_name: {}\n{}distortion_model: {model}\n{}{}{}\
             binning_x: 0\nbinning_y: 0\nroi:\n  x_offset: 0\n  y_offset: 0\n  height: 0\n  width: 0\n  \
             do_rectify: false\n",
            about_intrinsics(input.result),
            k.width,
            k.height,
            quoted(&input.names.camera_name),
            matrix("camera_matrix", 3, &camera_matrix(&k)),
            matrix("distortion_coefficients", 1, &coefficients),
            matrix("rectification_matrix", 3, &RECTIFICATION),
            matrix("projection_matrix", 3, &projection_matrix(&k)),
        );
        Ok(vec![ExportFile::new("camera_info.yaml", text)])
    }

    fn compare(&self, file: &ExportFile, input: &ExportInput<'_>) -> Result<(), String> {
        let k = input.intrinsics(self.name()).map_err(|e| e.to_string())?;
        let (model, coefficients) = model(&k.distortion);
        Yaml::parse(&file.text)?.compare(&[
            ("image_width", Leaf::Number(k.width.into())),
            ("image_height", Leaf::Number(k.height.into())),
            ("camera_name", Leaf::text(&input.names.camera_name)),
            ("camera_matrix.rows", Leaf::Number(3.0)),
            ("camera_matrix.cols", Leaf::Number(3.0)),
            ("camera_matrix.data", Leaf::Numbers(camera_matrix(&k).to_vec())),
            ("distortion_model", Leaf::text(model)),
            ("distortion_coefficients.rows", Leaf::Number(1.0)),
            ("distortion_coefficients.cols", Leaf::Number(coefficients.len() as f64)),
            ("distortion_coefficients.data", Leaf::Numbers(coefficients)),
            ("rectification_matrix.rows", Leaf::Number(3.0)),
            ("rectification_matrix.cols", Leaf::Number(3.0)),
            ("rectification_matrix.data", Leaf::Numbers(RECTIFICATION.to_vec())),
            ("projection_matrix.rows", Leaf::Number(3.0)),
            ("projection_matrix.cols", Leaf::Number(4.0)),
            ("projection_matrix.data", Leaf::Numbers(projection_matrix(&k).to_vec())),
            ("binning_x", Leaf::Number(0.0)),
            ("binning_y", Leaf::Number(0.0)),
            ("roi.x_offset", Leaf::Number(0.0)),
            ("roi.y_offset", Leaf::Number(0.0)),
            ("roi.height", Leaf::Number(0.0)),
            ("roi.width", Leaf::Number(0.0)),
            ("roi.do_rectify", Leaf::Flag(false)),
        ])
    }
}
