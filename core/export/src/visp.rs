//! ViSP: the hand-eye as `vpPoseVector` YAML, and the camera as `vpXmlParserCamera` XML.
//!
//! A `vpPoseVector` is a translation in metres and a rotation vector θu in radians. The file is `eMc.yaml` (camera in
//! the end effector) or `rMc.yaml` (camera in the robot's reference frame), as ViSP's hand-eye programs name them. Its
//! reader takes lines: everything before `rows:` is header, every line behind `data:` is a row.
//!
//! ViSP's lens has one radial coefficient each way (kud, kdu), and the one way is not exactly the inverse of the other.
//! So the camera is written for a lens without distortion alone; the pose file states when it is left out.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use super::input::NamedTransform;
use super::text::{
    Rotation, about_intrinsics, about_transform, compare_isometry, compare_numbers, compare_text, number,
};
use super::yaml::Yaml;
use super::{ExportError, ExportFile, ExportInput, Format, xml};
use handeye_estimate::handeye::Mode;
use handeye_geometry::camera::Intrinsics;
use handeye_geometry::se3;
use handeye_wording::Text;

pub(super) struct Visp;

const CAMERA: &str = "camera.xml";

fn pose_file(transform: &NamedTransform<'_>) -> &'static str {
    match transform.mode {
        Mode::EyeInHand => "eMc.yaml",
        Mode::EyeToHand => "rMc.yaml",
    }
}

fn pose_text(transform: &NamedTransform<'_>, has_camera: bool, input: &ExportInput<'_>) -> String {
    let rotation: [f64; 3] = se3::rotation_vector(&transform.isometry.rotation).into();
    let values = transform.translation().into_iter().chain(rotation);
    let rows: Vec<String> = values.map(|v| format!("  - [{}]\n", number(v + 0.0))).collect();
    let about = about_transform(transform, "Metres", Rotation::Vector, input.result);
    let left_out = if has_camera || input.result.intrinsics.is_none() {
        ""
    } else {
        "# There is no camera.xml: ViSP's lens models cannot hold this distortion.\n"
    };
    format!("# {about}\n{left_out}rows: 6\ncols: 1\ndata:\n{}", rows.concat())
}

/// The camera, when it has no distortion.
fn without_distortion(input: &ExportInput<'_>) -> Result<Intrinsics, ExportError> {
    let k = input.intrinsics(Visp.name())?;
    if k.distortion.coefficients().iter().all(|c| *c == 0.0) && k.distortion.name() != "fisheye" {
        return Ok(k);
    }
    Err(ExportError::NeedsModel {
        format: Visp.name(),
        model: k.distortion.name(),
        holds: "a lens without distortion, or one radial coefficient each way that only nearly undo each other",
        instead: "model = \"none\"",
    })
}

fn camera_text(k: &Intrinsics, input: &ExportInput<'_>) -> String {
    format!(
        "<?xml version=\"1.0\"?>\n{}\n<root>\n  <camera>\n    <name>{}</name>\n    <image_width>{}</image_width>\n    \
         <image_height>{}</image_height>\n    <model>\n      <type>perspectiveProjWithoutDistortion</type>\n      \
         <px>{}</px>\n      <py>{}</py>\n      <u0>{}</u0>\n      <v0>{}</v0>\n    </model>\n  </camera>\n</root>\n",
        xml::comment(&about_intrinsics(input.result)),
        input.names.camera_name,
        k.width,
        k.height,
        number(k.fx),
        number(k.fy),
        number(k.cx),
        number(k.cy),
    )
}

impl Format for Visp {
    fn name(&self) -> &'static str {
        "visp"
    }

    fn description(&self) -> Text {
        handeye_wording::text!("vpPoseVector YAML of the hand-eye, and camera XML for a lens without distortion (ViSP)")
    }

    fn render(&self, input: &ExportInput<'_>) -> Result<Vec<ExportFile>, ExportError> {
        let (transform, camera) = match (input.optical(self.name()), without_distortion(input)) {
            (Err(error), Err(ExportError::NeedsIntrinsics { .. })) | (Err(_), Err(error)) => return Err(error),
            (transform, camera) => (transform.ok(), camera.ok()),
        };
        let pose = transform.map(|t| ExportFile::new(pose_file(&t), pose_text(&t, camera.is_some(), input)));
        let camera = camera.map(|k| ExportFile::new(CAMERA, camera_text(&k, input)));
        Ok(pose.into_iter().chain(camera).collect())
    }

    fn compare(&self, file: &ExportFile, input: &ExportInput<'_>) -> Result<(), String> {
        if file.name == CAMERA {
            let k = without_distortion(input).map_err(|e| e.to_string())?;
            return compare_camera(&file.text, &k, &input.names.camera_name);
        }
        let transform = input.optical(self.name()).map_err(|e| e.to_string())?;
        compare_text("the name of the pose file", &file.name, pose_file(&transform))?;
        let yaml = Yaml::parse(&file.text)?;
        compare_numbers("rows and cols", &[yaml.number("rows")?, yaml.number("cols")?], &[6.0, 1.0])?;
        let &[x, y, z, rx, ry, rz] = yaml.numbers("data")? else { return Err("data has not six numbers".into()) };
        let rotation = UnitQuaternion::from_scaled_axis(Vector3::new(rx, ry, rz));
        let got = Isometry3::from_parts(Translation3::new(x, y, z), rotation);
        compare_isometry("the pose", &got, &transform.isometry)
    }
}

fn compare_camera(text: &str, k: &Intrinsics, name: &str) -> Result<(), String> {
    let document = xml::parse(text)?;
    compare_text("name", xml::element_text(&document, "name")?, name)?;
    compare_text("type", xml::element_text(&document, "type")?, "perspectiveProjWithoutDistortion")?;
    let expected = [
        ("image_width", k.width.into()),
        ("image_height", k.height.into()),
        ("px", k.fx),
        ("py", k.fy),
        ("u0", k.cx),
        ("v0", k.cy),
    ];
    for (element, value) in expected {
        let got = super::text::parse_number(element, xml::element_text(&document, element)?)?;
        compare_numbers(element, &[got], &[value])?;
    }
    Ok(())
}
