//! Kalibr `camchain.yaml` with one camera: `ConfigReader.py` of Kalibr.
//!
//! The file is about the camera alone. Kalibr's `radtan` has k1 k2 p1 p2 and no k3: a lens with k3 is refused.

use super::text::{about_intrinsics, numbers};
use super::yaml::{Leaf, Yaml};
use super::{ExportError, ExportFile, ExportInput, Format};
use handeye_geometry::camera::{Distortion, Intrinsics};
use handeye_wording::Text;

pub(super) struct Kalibr;

/// Kalibr's name of the model and its coefficients.
fn model(k: &Intrinsics) -> Result<(&'static str, Vec<f64>), ExportError> {
    match k.distortion {
        Distortion::None => Ok(("none", Vec::new())),
        Distortion::BrownConrady([k1, k2, p1, p2, 0.0]) => Ok(("radtan", vec![k1, k2, p1, p2])),
        Distortion::Fisheye(k) => Ok(("equidistant", k.to_vec())),
        Distortion::BrownConrady(_) | Distortion::Rational(_) => Err(ExportError::NeedsModel {
            format: Kalibr.name(),
            model: k.distortion.name(),
            holds: "radtan with k1 k2 p1 p2 and no k3, and equidistant",
            instead: "model = \"fisheye\" or \"none\"",
        }),
    }
}

fn topic(input: &ExportInput<'_>) -> String {
    format!("/{}/image_raw", input.names.camera_name.trim_start_matches('/'))
}

fn intrinsics(k: &Intrinsics) -> Vec<f64> {
    vec![k.fx, k.fy, k.cx, k.cy]
}

impl Format for Kalibr {
    fn name(&self) -> &'static str {
        "kalibr"
    }

    fn description(&self) -> Text {
        handeye_wording::text!("camchain.yaml of Kalibr with one camera (intrinsics)")
    }

    fn render(&self, input: &ExportInput<'_>) -> Result<Vec<ExportFile>, ExportError> {
        let k = input.intrinsics(self.name())?;
        let (model, coefficients) = model(&k)?;
        let text = format!(
            "# {} The topic is a guess from the name of the camera.\ncam0:\n  cam_overlaps: []\n  camera_model: pinhole\n  \
             distortion_coeffs: [{}]\n  distortion_model: {model}\n  intrinsics: [{}]\n  resolution: [{}, {}]\n  \
             rostopic: {}\n",
            about_intrinsics(input.result),
            numbers(&coefficients),
            numbers(&intrinsics(&k)),
            k.width,
            k.height,
            topic(input),
        );
        Ok(vec![ExportFile::new("camchain.yaml", text)])
    }

    fn compare(&self, file: &ExportFile, input: &ExportInput<'_>) -> Result<(), String> {
        let k = input.intrinsics(self.name()).map_err(|e| e.to_string())?;
        let (model, coefficients) = model(&k).map_err(|e| e.to_string())?;
        Yaml::parse(&file.text)?.compare(&[
            ("cam0.cam_overlaps", Leaf::Numbers(Vec::new())),
            ("cam0.camera_model", Leaf::text("pinhole")),
            ("cam0.distortion_coeffs", Leaf::Numbers(coefficients)),
            ("cam0.distortion_model", Leaf::text(model)),
            ("cam0.intrinsics", Leaf::Numbers(intrinsics(&k))),
            ("cam0.resolution", Leaf::Numbers(vec![k.width.into(), k.height.into()])),
            ("cam0.rostopic", Leaf::text(topic(input))),
        ])
    }
}
