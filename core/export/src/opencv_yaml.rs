//! OpenCV `FileStorage` YAML, with the keys of its calibration samples.
//!
//! `T_<parent>_<child>` is the 4×4 hand-eye matrix in metres; characters of frame names that are not valid in a key are
//! written `_`. `distortion_model` is for people and programs that ask: `brown_conrady` and `rational` go with
//! `cv::projectPoints`, `fisheye` goes with `cv::fisheye::projectPoints`.

use super::input::NamedTransform;
use super::text::{Rotation, about_intrinsics, about_transform, entry, numbers};
use super::yaml::{Leaf, Yaml};
use super::{ExportError, ExportFile, ExportInput, Format};
use handeye_geometry::camera::{Distortion, Intrinsics};
use handeye_wording::Text;

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

impl Format for OpencvYaml {
    fn name(&self) -> &'static str {
        "opencv_yaml"
    }

    fn description(&self) -> Text {
        handeye_wording::text!("YAML for cv::FileStorage with camera matrix, distortion and hand-eye matrix")
    }

    /// Writes what the result has, intrinsics, hand-eye or both; a result without either is refused.
    fn render(&self, input: &ExportInput<'_>) -> Result<Vec<ExportFile>, ExportError> {
        let transform = input.optical(self.name()).ok();
        let intrinsics = input.intrinsics(self.name());
        let about = match &transform {
            Some(transform) => about_transform(transform, "Metres", Rotation::Matrix, input.result),
            None => about_intrinsics(input.result),
        };
        // OpenCV wants its directive first; the comment goes behind the start of the document.
        let mut text = format!("%YAML:1.0\n---\n# {about}\n");
        match (intrinsics, &transform) {
            (Ok(k), _) => text.push_str(&format_intrinsics(&k)),
            (Err(_), Some(_)) => {}
            (Err(error), None) => return Err(error),
        }
        if let Some(rms_px) = input.result.quality.rms_px {
            text.push_str(&entry(0, "avg_reprojection_error", rms_px));
        }
        if let Some(transform) = &transform {
            text.push_str(&matrix(&transform_key(transform), 4, transform.rows().as_flattened()));
        }
        Ok(vec![ExportFile::new("opencv.yaml", text)])
    }

    fn compare(&self, file: &ExportFile, input: &ExportInput<'_>) -> Result<(), String> {
        let mut expected: Vec<(String, Leaf)> = Vec::new();
        let mut matrix = |key: &str, rows: usize, values: Vec<f64>| {
            let columns = values.len() / rows;
            expected.push((format!("{key}.rows"), Leaf::Number(rows as f64)));
            expected.push((format!("{key}.cols"), Leaf::Number(columns as f64)));
            expected.push((format!("{key}.dt"), Leaf::text("d")));
            expected.push((format!("{key}.data"), Leaf::Numbers(values)));
        };
        if let Ok(transform) = input.optical(self.name()) {
            matrix(&transform_key(&transform), 4, transform.rows().as_flattened().to_vec());
        }
        if let Ok(k) = input.intrinsics(self.name()) {
            matrix("camera_matrix", 3, camera_matrix(&k).to_vec());
            matrix("distortion_coefficients", 1, coefficients(&k.distortion));
            expected.push(("image_width".into(), Leaf::Number(k.width.into())));
            expected.push(("image_height".into(), Leaf::Number(k.height.into())));
            expected.push(("distortion_model".into(), Leaf::text(k.distortion.name())));
        }
        if let Some(rms_px) = input.result.quality.rms_px {
            expected.push(("avg_reprojection_error".into(), Leaf::Number(rms_px)));
        }
        Yaml::parse(&file.text)?.compare(&expected)
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
