//! COLMAP text model: `cameras.txt`, `images.txt` and an empty `points3D.txt`, without which COLMAP does not read the
//! model.
//!
//! The world is the robot's base. An image has `camera_from_base` as a quaternion w x y z and a translation in metres.
//! COLMAP's pixel (0, 0) is the corner of the top-left pixel: its principal point is half a pixel larger.
//! Source: COLMAP's documentation, "Output format" and "Camera models".

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};

use super::input::{CameraPose, bad_view};
use super::text::{compare_isometry, compare_numbers, compare_text, made_by, parse_exactly, parse_spaced, spaced};
use super::{ExportError, ExportFile, ExportInput, Format};
use handeye_geometry::camera::{Distortion, Intrinsics};
use handeye_geometry::frames::{Base, Camera, Pose};
use handeye_wording::Text;

pub(super) struct Colmap;

const CAMERAS: &str = "cameras.txt";
const IMAGES: &str = "images.txt";
const POINTS: &str = "points3D.txt";

/// COLMAP's name of the camera model and its parameters. It holds every model here.
fn model(k: &Intrinsics) -> (&'static str, Vec<f64>) {
    let pinhole = [k.fx, k.fy, k.cx + 0.5, k.cy + 0.5];
    let (name, coefficients) = match k.distortion {
        Distortion::None => ("PINHOLE", Vec::new()),
        Distortion::BrownConrady([k1, k2, p1, p2, 0.0]) => ("OPENCV", vec![k1, k2, p1, p2]),
        Distortion::BrownConrady([k1, k2, p1, p2, k3]) => ("FULL_OPENCV", vec![k1, k2, p1, p2, k3, 0.0, 0.0, 0.0]),
        Distortion::Rational(k) => ("FULL_OPENCV", k.to_vec()),
        Distortion::Fisheye(k) => ("OPENCV_FISHEYE", k.to_vec()),
    };
    (name, [&pinhole[..], &coefficients].concat())
}

fn camera_poses<'a>(input: &ExportInput<'a>) -> Result<Vec<CameraPose<'a>>, ExportError> {
    let spaced_out = |name: &str| name.is_empty() || name.contains(|c: char| c.is_whitespace() || c.is_control());
    let poses = input.camera_poses(Colmap.name())?;
    match input.views.iter().find(|view| spaced_out(&view.name)) {
        Some(view) => Err(bad_view(Colmap.name(), view, "COLMAP ends a name at a blank; rename the image and its row")),
        None => Ok(poses),
    }
}

fn images_text(poses: &[CameraPose<'_>], input: &ExportInput<'_>) -> String {
    let names = input.names;
    let about = format!(
        "# T_{0}_{1}: a point p in {1} is T * p in {0}; the world is {1}. Metres; quaternion w x y z, no Euler angles. {2}\n\
         # IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME, then a line of points that is empty\n",
        names.camera_frame,
        names.base_frame,
        made_by(input.result),
    );
    let image = |(index, pose): (usize, &CameraPose<'_>)| {
        let camera_from_base = pose.base_from_camera.inverse();
        let [x, y, z, w] = camera_from_base.xyzw();
        let [tx, ty, tz]: [f64; 3] = camera_from_base.translation().into();
        // Adding zero turns −0 into 0.
        let numbers = [w, x, y, z, tx, ty, tz].map(|v| v + 0.0);
        format!("{} {} 1 {}\n\n", index + 1, spaced(&numbers), pose.name)
    };
    let images: Vec<String> = poses.iter().enumerate().map(image).collect();
    about + &images.concat()
}

/// Lines that are neither comments nor empty.
fn content(text: &str) -> impl Iterator<Item = &str> {
    text.lines().filter(|line| !line.is_empty() && !line.starts_with('#'))
}

fn compare_cameras(text: &str, k: &Intrinsics) -> Result<(), String> {
    let lines: Vec<&str> = content(text).collect();
    let [line] = lines[..] else { return Err(format!("{} cameras", lines.len())) };
    let (name, parameters) = model(k);
    let words: Vec<&str> = line.split(' ').collect();
    let ["1", found, width, height, numbers @ ..] = &words[..] else { return Err(format!("{line:?} is no camera")) };
    compare_text("the camera model", found, name)?;
    let size = [parse_exactly::<1>("width", width)?[0], parse_exactly::<1>("height", height)?[0]];
    compare_numbers("the image size", &size, &[k.width.into(), k.height.into()])?;
    compare_numbers("the camera", &parse_spaced("the camera", &numbers.join(" "))?, &parameters)
}

fn compare_images(text: &str, poses: &[CameraPose<'_>]) -> Result<(), String> {
    let lines: Vec<&str> = content(text).collect();
    if lines.len() != poses.len() {
        return Err(format!("{} images, not {}", lines.len(), poses.len()));
    }
    for (index, (line, pose)) in lines.iter().zip(poses).enumerate() {
        let words: Vec<&str> = line.split(' ').collect();
        let [id, numbers @ .., camera, name] = &words[..] else { return Err(format!("{line:?} is no image")) };
        compare_text("the image", name, pose.name)?;
        compare_text("the number of the image", id, &(index + 1).to_string())?;
        compare_text("the number of the camera", camera, "1")?;
        let [w, x, y, z, tx, ty, tz] = parse_exactly(pose.name, &numbers.join(" "))?;
        let q = Quaternion::new(w, x, y, z);
        if (q.norm() - 1.0).abs() > 1e-9 || w < 0.0 {
            return Err(format!("the quaternion of {} is not a unit quaternion with w >= 0", pose.name));
        }
        let camera_from_base = Isometry3::from_parts(Translation3::new(tx, ty, tz), UnitQuaternion::from_quaternion(q));
        let got = Pose::<Camera, Base>::from_isometry(camera_from_base).inverse();
        compare_isometry(pose.name, got.isometry(), pose.base_from_camera.isometry())?;
    }
    Ok(())
}

impl Format for Colmap {
    fn name(&self) -> &'static str {
        "colmap"
    }

    fn description(&self) -> Text {
        handeye_wording::text!("text model with the camera's pose in every image, in the robot's base (COLMAP)")
    }

    fn render(&self, input: &ExportInput<'_>) -> Result<Vec<ExportFile>, ExportError> {
        let k = input.intrinsics(self.name())?;
        let poses = camera_poses(input)?;
        let (model, parameters) = model(&k);
        let cameras = format!(
            "# Intrinsics in pixels, (0.5, 0.5) is the centre of the top-left pixel; no transform and no Euler angles. {}\n\
             # CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]\n1 {model} {} {} {}\n",
            made_by(input.result),
            k.width,
            k.height,
            spaced(&parameters),
        );
        Ok(vec![
            ExportFile::new(CAMERAS, cameras),
            ExportFile::new(IMAGES, images_text(&poses, input)),
            ExportFile::new(POINTS, "# No points: a calibration has none. COLMAP wants this file beside the others.\n"),
        ])
    }

    fn compare(&self, file: &ExportFile, input: &ExportInput<'_>) -> Result<(), String> {
        match file.name.as_str() {
            CAMERAS => compare_cameras(&file.text, &input.intrinsics(self.name()).map_err(|e| e.to_string())?),
            IMAGES => compare_images(&file.text, &camera_poses(input).map_err(|e| e.to_string())?),
            _ if content(&file.text).next().is_none() && file.text.starts_with('#') => Ok(()),
            name => Err(format!("{name} has content")),
        }
    }
}
