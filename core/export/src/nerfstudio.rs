//! nerfstudio `transforms.json`.
//!
//! The world is the robot's base. A `transform_matrix` is `base_from_camera` in OpenGL's camera axes (x right, y up, z
//! backwards), in metres: the second and third column are negated. Pixel (0, 0) is the corner of the top-left pixel, so
//! the principal point is half a pixel larger. `file_path` is relative to the folder of this file, which belongs next
//! to the folder of images. JSON has no comments. Source: nerfstudio's documentation, "Data conventions".

use serde::{Deserialize, Serialize};

use super::text::{compare_numbers, compare_rows, compare_text};
use super::{ExportError, ExportFile, ExportInput, Format, rotation};
use handeye_files::json_text;
use handeye_geometry::camera::{Distortion, Intrinsics};
use handeye_result::ResultProblem;
use handeye_wording::Text;

pub(super) struct Nerfstudio;

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Document {
    camera_model: String,
    w: u32,
    h: u32,
    fl_x: f64,
    fl_y: f64,
    cx: f64,
    cy: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    k1: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    k2: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    k3: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    k4: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    p1: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    p2: Option<f64>,
    frames: Vec<Frame>,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Frame {
    file_path: String,
    transform_matrix: [[f64; 4]; 4],
}

/// nerfstudio's name of the model and k1 k2 k3 k4 p1 p2, where the model has them.
fn model(k: &Intrinsics) -> Result<(&'static str, [Option<f64>; 6]), ExportError> {
    match k.distortion {
        Distortion::None => Ok(("PINHOLE", [None; 6])),
        Distortion::BrownConrady([k1, k2, p1, p2, k3]) => {
            let k3 = (k3 != 0.0).then_some(k3);
            Ok(("OPENCV", [Some(k1), Some(k2), k3, None, Some(p1), Some(p2)]))
        }
        Distortion::Fisheye([k1, k2, k3, k4]) => {
            Ok(("OPENCV_FISHEYE", [Some(k1), Some(k2), Some(k3), Some(k4), None, None]))
        }
        Distortion::Rational(_) => Err(ExportError::NeedsModel {
            format: Nerfstudio.name(),
            model: k.distortion.name(),
            holds: "k1 k2 k3 and p1 p2 without a denominator, or a fisheye",
            instead: "model = \"brown_conrady\" or \"fisheye\"",
        }),
    }
}

/// Between the camera axes of OpenCV and those of OpenGL, either way: y and z are turned over.
fn turned_over(mut rows: [[f64; 4]; 4]) -> [[f64; 4]; 4] {
    for row in rows.iter_mut().take(3) {
        // Adding zero turns −0 into 0.
        row[1] = -row[1] + 0.0;
        row[2] = -row[2] + 0.0;
    }
    rows
}

impl Format for Nerfstudio {
    fn name(&self) -> &'static str {
        "nerfstudio"
    }

    fn description(&self) -> Text {
        handeye_wording::text!(
            "transforms.json with the camera's pose in every image, in the robot's base (nerfstudio)"
        )
    }

    fn render(&self, input: &ExportInput<'_>) -> Result<Vec<ExportFile>, ExportError> {
        let k = input.intrinsics(self.name())?;
        let (model, [k1, k2, k3, k4, p1, p2]) = model(&k)?;
        let frames = input.camera_poses(self.name())?.into_iter().map(|pose| Frame {
            file_path: pose.name.to_owned(),
            transform_matrix: turned_over(rotation::rows(pose.base_from_camera.isometry())),
        });
        let document = Document {
            camera_model: model.to_owned(),
            w: k.width,
            h: k.height,
            fl_x: k.fx,
            fl_y: k.fy,
            cx: k.cx + 0.5,
            cy: k.cy + 0.5,
            k1,
            k2,
            k3,
            k4,
            p1,
            p2,
            frames: frames.collect(),
        };
        let text =
            json_text::pretty(&document).map_err(|e| ExportError::BadResult(ResultProblem::Json(e.to_string())))?;
        Ok(vec![ExportFile::new("transforms.json", text)])
    }

    fn compare(&self, file: &ExportFile, input: &ExportInput<'_>) -> Result<(), String> {
        let k = input.intrinsics(self.name()).map_err(|e| e.to_string())?;
        let (model, distortion) = model(&k).map_err(|e| e.to_string())?;
        let read: Document = serde_json::from_str(&file.text).map_err(|e| e.to_string())?;
        compare_text("camera_model", &read.camera_model, model)?;
        compare_numbers("w and h", &[read.w.into(), read.h.into()], &[k.width.into(), k.height.into()])?;
        let pinhole = [k.fx, k.fy, k.cx + 0.5, k.cy + 0.5];
        compare_numbers("fl_x fl_y cx cy", &[read.fl_x, read.fl_y, read.cx, read.cy], &pinhole)?;
        let zero_filled = |values: [Option<f64>; 6]| values.map(|v| v.unwrap_or(0.0));
        let got = zero_filled([read.k1, read.k2, read.k3, read.k4, read.p1, read.p2]);
        compare_numbers("k1 k2 k3 k4 p1 p2", &got, &zero_filled(distortion))?;
        let poses = input.camera_poses(self.name()).map_err(|e| e.to_string())?;
        if read.frames.len() != poses.len() {
            return Err(format!("{} frames, not {}", read.frames.len(), poses.len()));
        }
        for (frame, pose) in read.frames.iter().zip(&poses) {
            compare_text("file_path", &frame.file_path, pose.name)?;
            compare_rows(pose.name, &turned_over(frame.transform_matrix), pose.base_from_camera.isometry())?;
        }
        Ok(())
    }
}
