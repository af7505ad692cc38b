//! mrcal `.cameramodel`: a Python literal, read by `cameramodel.py` and `cameramodel-parser.re`.
//!
//! `extrinsics` are a rotation vector and a translation that map the reference frame to the camera: the inverse of the
//! hand-eye, with tip or base as reference. Pixels are counted as here.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use super::text::{Rotation, about_intrinsics, about_transform, compare_isometry, compare_numbers, compare_text};
use super::text::{numbers, parse_number};
use super::{ExportError, ExportFile, ExportInput, Format};
use handeye_geometry::camera::{Distortion, Intrinsics};
use handeye_geometry::se3;
use handeye_wording::Text;

pub(super) struct Mrcal;

/// mrcal's name of the model. Its coefficients are OpenCV's, in OpenCV's order.
fn model(k: &Intrinsics) -> Result<&'static str, ExportError> {
    match k.distortion {
        Distortion::None => Ok("LENSMODEL_PINHOLE"),
        Distortion::BrownConrady(_) => Ok("LENSMODEL_OPENCV5"),
        Distortion::Rational(_) => Ok("LENSMODEL_OPENCV8"),
        Distortion::Fisheye(_) => Err(ExportError::NeedsModel {
            format: Mrcal.name(),
            model: k.distortion.name(),
            holds: "OpenCV's pinhole models and no equidistant fisheye",
            instead: "model = \"rational\" or \"brown_conrady\"",
        }),
    }
}

fn quoted_after<'a>(text: &'a str, key: &str) -> Result<&'a str, String> {
    let (_, after) = text.split_once(&format!("'{key}':")).ok_or_else(|| format!("no {key}"))?;
    after.split('\'').nth(1).ok_or_else(|| format!("{key} is no text"))
}

fn list_after(text: &str, key: &str) -> Result<Vec<f64>, String> {
    let (_, after) = text.split_once(&format!("'{key}':")).ok_or_else(|| format!("no {key}"))?;
    let list = after.trim_start().strip_prefix('[').and_then(|list| list.split_once(']'));
    let (list, _) = list.ok_or_else(|| format!("{key} is no list"))?;
    list.split(',').map(str::trim).filter(|e| !e.is_empty()).map(|e| parse_number(key, e)).collect()
}

impl Format for Mrcal {
    fn name(&self) -> &'static str {
        "mrcal"
    }

    fn description(&self) -> Text {
        handeye_wording::text!(".cameramodel of mrcal with intrinsics, and the hand-eye as extrinsics")
    }

    /// Needs intrinsics; without a hand-eye the extrinsics are the identity, and the comment states that.
    fn render(&self, input: &ExportInput<'_>) -> Result<Vec<ExportFile>, ExportError> {
        let k = input.intrinsics(self.name())?;
        let model = model(&k)?;
        let (comment, extrinsics) = match input.optical(self.name()) {
            Ok(transform) => {
                let camera_from_parent = transform.isometry.inverse();
                let [rx, ry, rz]: [f64; 3] = se3::rotation_vector(&camera_from_parent.rotation).into();
                let [tx, ty, tz]: [f64; 3] = camera_from_parent.translation.vector.into();
                let about = about_transform(&transform, "Metres", Rotation::Vector, input.result);
                let parent = transform.parent;
                let comment = format!("{about}\n# The extrinsics are its inverse: they map {parent} to the camera.");
                (comment, [rx, ry, rz, tx, ty, tz].map(|v| v + 0.0))
            }
            Err(_no_hand_eye) => {
                let about = about_intrinsics(input.result);
                (format!("{about}\n# There is no hand-eye: the reference frame is the camera itself."), [0.0; 6])
            }
        };
        let text = format!(
            "# {comment}\n{{\n    'lensmodel':  '{model}',\n    'intrinsics': [ {},],\n    'extrinsics': [ {},],\n    \
             'imagersize': [ {}, {},],\n}}\n",
            numbers(&k.parameters()),
            numbers(&extrinsics),
            k.width,
            k.height,
        );
        Ok(vec![ExportFile::new("camera.cameramodel", text)])
    }

    fn compare(&self, file: &ExportFile, input: &ExportInput<'_>) -> Result<(), String> {
        let k = input.intrinsics(self.name()).map_err(|e| e.to_string())?;
        compare_text("lensmodel", quoted_after(&file.text, "lensmodel")?, model(&k).map_err(|e| e.to_string())?)?;
        compare_numbers("intrinsics", &list_after(&file.text, "intrinsics")?, &k.parameters())?;
        compare_numbers("imagersize", &list_after(&file.text, "imagersize")?, &[k.width.into(), k.height.into()])?;
        let extrinsics = list_after(&file.text, "extrinsics")?;
        let [rx, ry, rz, tx, ty, tz] = extrinsics[..] else { return Err("extrinsics are not six numbers".into()) };
        let rotation = UnitQuaternion::from_scaled_axis(Vector3::new(rx, ry, rz));
        let camera_from_parent = Isometry3::from_parts(Translation3::new(tx, ty, tz), rotation);
        let expected = input.optical(self.name()).map_or_else(|_| Isometry3::identity(), |t| t.isometry);
        compare_isometry("the inverse of the extrinsics", &camera_from_parent.inverse(), &expected)
    }
}
