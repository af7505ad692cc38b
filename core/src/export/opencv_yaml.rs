//! OpenCV `FileStorage` YAML, with the keys of its calibration samples.
//!
//! `T_<parent>_<child>` is the 4×4 hand-eye matrix in metres; characters of frame names that cannot stand in a key are
//! written `_`. `distortion_model` is for people and programs that ask: `brown_conrady` and `rational` go with
//! `cv::projectPoints`, `fisheye` goes with `cv::fisheye::projectPoints`.

use super::yaml::Yaml;
use super::{
    ExportError, ExportFile, ExportNames, Format, NamedTransform, compare_numbers, compare_text, entry, intrinsics_of,
    made_by, numbers, transform_comment,
};
use crate::camera::{Distortion, Intrinsics};
use crate::frames::{Camera, Mount, Pose};
use crate::result::CalibrationResult;

pub(super) struct OpencvYaml;

fn coefficients(distortion: &Distortion) -> Vec<f64> {
    match distortion {
        // OpenCV's own files have five zeros here, and some readers want them.
        Distortion::None => vec![0.0; 5],
        other => other.coefficients().to_vec(),
    }
}

fn camera_matrix(k: &Intrinsics) -> [f64; 9] {
    [k.fx, 0.0, k.cx, 0.0, k.fy, k.cy, 0.0, 0.0, 1.0]
}

fn matrix(key: &str, rows: usize, values: &[f64]) -> String {
    let columns = values.len() / rows;
    let lines: Vec<String> = values.chunks(columns).map(numbers).collect();
    let data = lines.join(",\n       ");
    format!("{key}: !!opencv-matrix\n   rows: {rows}\n   cols: {columns}\n   dt: d\n   data: [ {data} ]\n")
}

fn transform_key(transform: &NamedTransform<'_>) -> String {
    let plain = |name: &str| name.replace(|c: char| !c.is_ascii_alphanumeric(), "_");
    format!("T_{}_{}", plain(transform.parent), plain(transform.child))
}

fn transform_values(transform: &NamedTransform<'_>) -> Vec<f64> {
    let pose = Pose::<Mount, Camera>::from_translation_xyzw(
        transform.estimate.translation_m,
        transform.estimate.rotation_xyzw,
    );
    // nalgebra stores columns.
    pose.matrix().transpose().iter().copied().collect()
}

impl Format for OpencvYaml {
    fn name(&self) -> &'static str {
        "opencv_yaml"
    }

    fn description(&self) -> &'static str {
        "YAML for cv::FileStorage with camera matrix, distortion and hand-eye matrix"
    }

    /// Writes what the result has, intrinsics, hand-eye or both; a result without either is refused.
    fn render(&self, result: &CalibrationResult, names: &ExportNames) -> Result<Vec<ExportFile>, ExportError> {
        let transform = NamedTransform::of(result, names);
        let intrinsics = intrinsics_of(result);
        if transform.is_none() && intrinsics.is_none() {
            return Err(ExportError::NeedsIntrinsics { format: self.name(), alternative: "json" });
        }
        let comment = transform.as_ref().map_or_else(
            || format!("# Intrinsics in pixels; no transform and no Euler angles. {}", made_by(result)),
            |transform| transform_comment(transform, result),
        );
        // OpenCV wants its directive first; the comment goes behind the start of the document.
        let mut text = format!("%YAML:1.0\n---\n{comment}\n");
        if let Some(k) = &intrinsics {
            text.push_str(&format_intrinsics(k));
        }
        if let Some(rms_px) = result.quality.rms_px {
            text.push_str(&entry(0, "avg_reprojection_error", rms_px));
        }
        if let Some(transform) = &transform {
            text.push_str(&matrix(&transform_key(transform), 4, &transform_values(transform)));
        }
        Ok(vec![ExportFile { name: "opencv.yaml".into(), text }])
    }

    fn compare(&self, text: &str, result: &CalibrationResult, names: &ExportNames) -> Result<(), String> {
        let yaml = Yaml::parse(text)?;
        if let Some(k) = intrinsics_of(result) {
            let size = [yaml.number("image_width")?, yaml.number("image_height")?];
            compare_numbers("the image size", &size, &[f64::from(k.width), f64::from(k.height)])?;
            compare_numbers("camera_matrix", &yaml.numbers("camera_matrix.data")?, &camera_matrix(&k))?;
            compare_text("distortion_model", yaml.text("distortion_model")?, k.distortion.name())?;
            let distortion = yaml.numbers("distortion_coefficients.data")?;
            compare_numbers("distortion", &distortion, &coefficients(&k.distortion))?;
        } else if yaml.has("camera_matrix.data") {
            return Err("a camera that the result does not have".into());
        }
        if let Some(transform) = NamedTransform::of(result, names) {
            let path = format!("{}.data", transform_key(&transform));
            compare_numbers(&path, &yaml.numbers(&path)?, &transform_values(&transform))?;
        }
        Ok(())
    }
}

fn format_intrinsics(k: &Intrinsics) -> String {
    format!(
        "image_width: {}\nimage_height: {}\n{}distortion_model: {}\n{}",
        k.width,
        k.height,
        matrix("camera_matrix", 3, &camera_matrix(k)),
        k.distortion.name(),
        matrix("distortion_coefficients", 1, &coefficients(&k.distortion)),
    )
}
