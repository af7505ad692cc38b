//! The JSON of ETH Zürich's `hand_eye_calibration`: `writeJson` in its `extrinsic_calibration.py`.
//!
//! Quaternions are Hamilton's, i j k w. `delay`, the time between the streams of robot and camera, is 0: here the robot
//! is at rest at every capture. JSON has no comments; extra keys are left out.

use serde::{Deserialize, Serialize};

use super::text::compare_numbers;
use super::{ExportError, ExportFile, ExportInput, Format};
use handeye_files::json_text;
use handeye_result::ResultProblem;
use handeye_wording::Text;

pub(super) struct Ethz;

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Document {
    delay: f64,
    rotation: Quaternion,
    translation: Vector,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Quaternion {
    i: f64,
    j: f64,
    k: f64,
    w: f64,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Vector {
    x: f64,
    y: f64,
    z: f64,
}

impl Format for Ethz {
    fn name(&self) -> &'static str {
        "ethz"
    }

    fn description(&self) -> Text {
        handeye_wording::text!("JSON of ETH Zürich's hand_eye_calibration")
    }

    fn render(&self, input: &ExportInput<'_>) -> Result<Vec<ExportFile>, ExportError> {
        let transform = input.optical(self.name())?;
        let [x, y, z] = transform.translation();
        let [i, j, k, w] = transform.xyzw();
        let document = Document { delay: 0.0, rotation: Quaternion { i, j, k, w }, translation: Vector { x, y, z } };
        let text =
            json_text::pretty(&document).map_err(|e| ExportError::BadResult(ResultProblem::Json(e.to_string())))?;
        Ok(vec![ExportFile::new("hand_eye_calibration.json", text)])
    }

    fn compare(&self, file: &ExportFile, input: &ExportInput<'_>) -> Result<(), String> {
        let transform = input.optical(self.name()).map_err(|e| e.to_string())?;
        let Document { delay, rotation: q, translation: t } =
            serde_json::from_str(&file.text).map_err(|e| e.to_string())?;
        compare_numbers("delay", &[delay], &[0.0])?;
        compare_numbers("rotation", &[q.i, q.j, q.k, q.w], &transform.xyzw())?;
        compare_numbers("translation", &[t.x, t.y, t.z], &transform.translation())
    }
}
