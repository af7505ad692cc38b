//! Intrinsics from views of a flat target, by OpenCV.
//!
//! Reference: Zhang 2000, "A flexible new technique for camera calibration".

use nalgebra::Vector3;
use opencv::calib3d;
use opencv::core::{Mat, Point2f, Point3f, Size, TermCriteria, TermCriteria_Type, Vector};
use opencv::prelude::*;

use super::{VisionError, pnp};
use crate::camera::{Distortion, Intrinsics};
use crate::frames::{Camera, Pose, Target};
use crate::observation::Corner;
use crate::target::TargetSpec;

/// Least number of views.
const NEED: usize = 3;
/// When every target normal is within this of the first, focal length and distance trade against each other.
const LEAST_SPREAD_DEG: f64 = 2.0;
/// Calibrates to rounding: the default of OpenCV stops early on weak sets.
const MAX_STEPS: i32 = 200;

/// Intrinsics and what goes with them.
#[derive(Debug, Clone, PartialEq)]
pub struct IntrinsicsCalibration {
    /// The intrinsics.
    pub intrinsics: Intrinsics,
    /// Formal standard deviations of fx, fy, cx, cy in pixels; `None` where OpenCV gives none (fisheye).
    pub sigma: Option<[f64; 4]>,
    /// RMS of all 2-D residuals, pixels.
    pub rms_px: f64,
    /// One entry per view.
    pub views: Vec<IntrinsicsView>,
}

/// One view of an intrinsic calibration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct IntrinsicsView {
    /// Target in the camera.
    pub camera_from_target: Pose<Camera, Target>,
    /// RMS of its 2-D residuals, pixels.
    pub rms_px: f64,
    /// ‖residuals‖₂ / number of corners, as OpenCV's tutorials print it, pixels: the RMS over the root of the number of
    /// corners.
    pub norm_over_n_px: f64,
}

/// Estimates intrinsics of the given lens model, from `start` when there is one.
///
/// # Needs
/// Three views of the target, tilted differently.
///
/// # Errors
/// [`VisionError::TooFewViews`], [`VisionError::SameTilt`], [`VisionError::OpenCv`].
pub fn calibrate(
    views: &[&[Corner]],
    target: &TargetSpec,
    image_size: (u32, u32),
    model: Distortion,
    start: Option<Intrinsics>,
) -> Result<IntrinsicsCalibration, VisionError> {
    if views.len() < NEED {
        return Err(VisionError::TooFewViews { got: views.len(), need: NEED });
    }
    let solved = solve(views, target, image_size, model, start)?;
    let mut fits = Vec::with_capacity(views.len());
    let mut squared = 0.0;
    let mut corners = 0;
    for view in views {
        let pose = pnp::camera_from_target(view, target, &solved.intrinsics)?;
        squared += pose.rms_px.powi(2) * view.len() as f64;
        corners += view.len();
        fits.push(IntrinsicsView {
            camera_from_target: pose.camera_from_target,
            rms_px: pose.rms_px,
            norm_over_n_px: pose.rms_px / (view.len() as f64).sqrt(),
        });
    }
    check_tilts(&fits)?;
    Ok(IntrinsicsCalibration {
        intrinsics: solved.intrinsics,
        sigma: solved.sigma,
        rms_px: (squared / f64::from(corners.max(1) as u32)).sqrt(),
        views: fits,
    })
}

fn check_tilts(fits: &[IntrinsicsView]) -> Result<(), VisionError> {
    let normals: Vec<Vector3<f64>> = fits.iter().map(|f| f.camera_from_target.rotation() * Vector3::z()).collect();
    let spread = normals
        .iter()
        .flat_map(|a| normals.iter().map(move |b| a.cross(b).norm().atan2(a.dot(b))))
        .fold(0.0, f64::max)
        .to_degrees();
    if spread < LEAST_SPREAD_DEG {
        return Err(VisionError::SameTilt { views: fits.len(), spread_deg: spread });
    }
    Ok(())
}

struct Solved {
    intrinsics: Intrinsics,
    sigma: Option<[f64; 4]>,
}

fn solve(
    views: &[&[Corner]],
    target: &TargetSpec,
    (width, height): (u32, u32),
    model: Distortion,
    start: Option<Intrinsics>,
) -> Result<Solved, VisionError> {
    const DOING: &str = "calibrate the intrinsics";
    let grid = target.grid();
    let mut object_points = Vector::<Vector<Point3f>>::new();
    let mut image_points = Vector::<Vector<Point2f>>::new();
    for view in views {
        object_points.push(
            view.iter()
                .map(|c| grid.point(c.index))
                .map(|p| Point3f::new(p.x as f32, p.y as f32, p.z as f32))
                .collect(),
        );
        image_points.push(view.iter().map(|c| Point2f::new(c.px.x as f32, c.px.y as f32)).collect());
    }
    let size = Size::new(width as i32, height as i32);
    let criteria = TermCriteria {
        typ: TermCriteria_Type::COUNT as i32 | TermCriteria_Type::EPS as i32,
        max_count: MAX_STEPS,
        epsilon: f64::EPSILON,
    };
    let error = VisionError::opencv(DOING);
    let mut k = start_matrix(start.as_ref()).map_err(&error)?;
    let coefficients = start.map_or(model, |s| model.with_coefficients(s.distortion.coefficients()));
    let mut d = column(coefficients.coefficients()).map_err(&error)?;
    let (mut rvecs, mut tvecs) = (Vector::<Mat>::new(), Vector::<Mat>::new());
    let sigma = if let Distortion::Fisheye(_) = model {
        let mut flags = calib3d::Fisheye_CALIB_RECOMPUTE_EXTRINSIC | calib3d::Fisheye_CALIB_FIX_SKEW;
        if start.is_some() {
            flags |= calib3d::Fisheye_CALIB_USE_INTRINSIC_GUESS;
        }
        calib3d::calibrate(
            &object_points,
            &image_points,
            size,
            &mut k,
            &mut d,
            &mut rvecs,
            &mut tvecs,
            flags,
            criteria,
        )
        .map_err(&error)?;
        None
    } else {
        let mut flags = match model {
            Distortion::None => {
                calib3d::CALIB_ZERO_TANGENT_DIST | calib3d::CALIB_FIX_K1 | calib3d::CALIB_FIX_K2 | calib3d::CALIB_FIX_K3
            }
            Distortion::Rational(_) => calib3d::CALIB_RATIONAL_MODEL,
            _ => 0,
        };
        if start.is_some() {
            flags |= calib3d::CALIB_USE_INTRINSIC_GUESS;
        }
        let (mut sd_lens, mut sd_poses, mut errors) = (Mat::default(), Mat::default(), Mat::default());
        calib3d::calibrate_camera_extended(
            &object_points,
            &image_points,
            size,
            &mut k,
            &mut d,
            &mut rvecs,
            &mut tvecs,
            &mut sd_lens,
            &mut sd_poses,
            &mut errors,
            flags,
            criteria,
        )
        .map_err(&error)?;
        let sd: Vec<f64> = values(&sd_lens).map_err(&error)?;
        sd.first_chunk::<4>().copied()
    };
    let k = values(&k).map_err(&error)?;
    let d = values(&d).map_err(&error)?;
    let [fx, _, cx, _, fy, cy] =
        *k.first_chunk::<6>().ok_or(VisionError::NoPose { reason: "OpenCV gave no matrix" })?;
    let intrinsics = Intrinsics { width, height, fx, fy, cx, cy, distortion: model.with_coefficients(&d) };
    if let Err(bad) = intrinsics.validate() {
        return Err(VisionError::OpenCv { doing: DOING, message: format!("it diverged: {bad}") });
    }
    Ok(Solved { intrinsics, sigma })
}

fn start_matrix(start: Option<&Intrinsics>) -> opencv::Result<Mat> {
    let k = start.map_or_else(nalgebra::Matrix3::identity, Intrinsics::matrix);
    Mat::from_slice_2d(&[
        [k[(0, 0)], k[(0, 1)], k[(0, 2)]],
        [k[(1, 0)], k[(1, 1)], k[(1, 2)]],
        [k[(2, 0)], k[(2, 1)], k[(2, 2)]],
    ])
}

/// OpenCV decides the number of coefficients by the size of this matrix.
fn column(coefficients: &[f64]) -> opencv::Result<Mat> {
    let five = [0.0; 5];
    let data = if coefficients.is_empty() { &five[..] } else { coefficients };
    Mat::from_slice(data)?.try_clone()
}

/// All numbers of a matrix of doubles, row by row.
fn values(mat: &Mat) -> opencv::Result<Vec<f64>> {
    Ok(mat.data_typed::<f64>()?.to_vec())
}
