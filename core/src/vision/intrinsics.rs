//! Intrinsic calibration from views of a flat target.

use nalgebra::{DMatrix, Isometry3, Matrix3, Matrix6, Point3, SMatrix, SymmetricEigen, Vector2, Vector3};
use opencv::calib3d;
use opencv::core::{Mat, Point2f, Point3f, Size, TermCriteria, TermCriteria_EPS, TermCriteria_MAX_ITER, Vec3d, Vector};

use super::VisionError;
use super::bridge::{camera_matrix, coefficients, failed, isometries, numbers, to_points2f, to_points3f};
use super::pnp::{check_corners, px_by_pose};
use crate::camera::{Distortion, Intrinsics, MAX_PARAMETERS};
use crate::frames::{Camera, Pose, Target};
use crate::observation::Corner;
use crate::target::TargetSpec;

/// Views that a calibration needs: two orientations determine the four numbers of a pinhole, a third checks them.
pub const MIN_VIEWS: usize = 3;
/// Normals of the target that agree within this angle [deg] in all views leave the focal length undetermined.
const MIN_SPREAD_DEG: f64 = 2.0;
/// Corner noise [px] for which a calibration is judged determined or not: that of a good camera.
const TYPICAL_NOISE_PX: f64 = 0.1;
/// Largest standard deviation of the pinhole's numbers for that noise, as a part of the focal length: at 5 % every
/// distance measured is off by a centimetre in twenty.
const MAX_RELATIVE_SIGMA: f64 = 0.05;
/// Eigenvalues of the information matrix, scaled to unit diagonal, are not trusted below this: it is rounding. Only
/// combinations of distortion coefficients come near it (the rational model has such), and those do no harm.
const MIN_EIGENVALUE: f64 = 1e-14;
const PINHOLE_NAMES: [&str; 4] = ["fx", "fy", "cx", "cy"];

/// Standard deviations of the pinhole's four numbers in pixels, for independent corner noise of the size that the
/// residuals show. Errors of the board (bent, misprinted) are not in them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PinholeSigma {
    /// Of the focal length along x.
    pub fx: f64,
    /// Of the focal length along y.
    pub fy: f64,
    /// Of the principal point's column.
    pub cx: f64,
    /// Of the principal point's row.
    pub cy: f64,
}

/// Residuals of one view.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ViewError {
    /// Root mean square of the 2-D distances, pixels.
    pub rms_px: f64,
    /// Norm of all residuals over the number of corners, `‖·‖₂ / N`: a figure that many scripts print as the error of
    /// a view. It is the RMS over √N, so 0.027 with 70 corners means 0.23 px.
    pub norm_per_corner_px: f64,
}

/// A calibrated camera with the evidence.
#[derive(Debug, Clone, PartialEq)]
pub struct IntrinsicsCalibration {
    /// The camera.
    pub intrinsics: Intrinsics,
    /// The target's pose in each view, in the order given.
    pub camera_from_target: Vec<Pose<Camera, Target>>,
    /// The errors of each view, in the order given.
    pub views: Vec<ViewError>,
    /// Root mean square of all 2-D distances, pixels.
    pub rms_px: f64,
    /// Standard deviations.
    pub sigma: PinholeSigma,
}

/// Estimates the intrinsics and the target's pose in each view by least squares on the reprojection error.
///
/// `model` says which distortion to estimate (its numbers do not matter); `guess` is where to start, else OpenCV
/// finds a start from the views. The lens models are OpenCV's `calibrateCamera` (none, 5 or 8 coefficients) and
/// `fisheye::calibrate`. The board is taken to be flat and its points exact.
///
/// # Needs
/// [`MIN_VIEWS`] views with corners, tilted in different directions. Views without corners must be left out before.
///
/// # Errors
/// [`VisionError::TooFewViews`], [`VisionError::ParallelViews`] when the target's tilt is the same in all views,
/// [`VisionError::Undetermined`] when the information in the views leaves a number free, [`VisionError::NotACamera`]
/// when the optimisation diverged, those of the corners ([`VisionError::TooFewCorners`], [`VisionError::BadCorner`],
/// [`VisionError::CollinearCorners`]) with the index of the view, and [`VisionError::OpenCv`].
///
/// # Reference
/// Zhang 2000, "A flexible new technique for camera calibration"; Kannala & Brandt 2006 for the fisheye.
pub fn calibrate<V: AsRef<[Corner]>>(
    views: &[V],
    target: &TargetSpec,
    (width, height): (u32, u32),
    model: Distortion,
    guess: Option<Intrinsics>,
) -> Result<IntrinsicsCalibration, VisionError> {
    if views.len() < MIN_VIEWS {
        return Err(VisionError::TooFewViews { got: views.len(), need: MIN_VIEWS });
    }
    let Some(nominal) = nominal_camera(width, height, guess) else {
        return Err(VisionError::BadImage { width, height });
    };
    nominal.validate()?;
    let mut seen = Vec::with_capacity(views.len());
    for (index, view) in views.iter().enumerate() {
        check_corners(view.as_ref(), target, index)?;
        let points = view.as_ref().iter().map(|c| target.grid().point(c.index)).collect();
        seen.push(Seen { points, pixels: view.as_ref().iter().map(|c| c.px).collect() });
    }
    let spread_deg = normal_spread_deg(&seen, &nominal)?;
    if spread_deg < MIN_SPREAD_DEG {
        return Err(VisionError::ParallelViews { views: views.len(), spread_deg });
    }
    let start = start_camera(&nominal, model, guess);
    let (intrinsics, poses) = match model {
        Distortion::Fisheye(_) => run_fisheye(&seen, &start, guess.is_some())?,
        _ => run_pinhole(&seen, &start, guess.is_some())?,
    };
    assess(&seen, intrinsics, poses)
}

/// One view: points of the target and where they are seen.
struct Seen {
    points: Vec<Point3<f64>>,
    pixels: Vec<Vector2<f64>>,
}

/// The guess, or a camera of usual angle: for judging tilts only.
fn nominal_camera(width: u32, height: u32, guess: Option<Intrinsics>) -> Option<Intrinsics> {
    let fits = i32::try_from(width).is_ok() && i32::try_from(height).is_ok() && width > 0 && height > 0;
    let usual = Intrinsics::pinhole(width, height, f64::from(width.max(height)));
    fits.then(|| guess.map_or(usual, |g| Intrinsics { width, height, ..g }))
}

/// The camera to start from: numbers of the guess as far as its distortion is of the model wanted.
fn start_camera(nominal: &Intrinsics, model: Distortion, guess: Option<Intrinsics>) -> Intrinsics {
    let zero = model.with_coefficients(&[0.0; MAX_PARAMETERS]);
    let distortion = guess.map_or(zero, |g| if g.distortion.name() == model.name() { g.distortion } else { zero });
    Intrinsics { distortion, ..*nominal }
}

/// Largest angle between the target's normals in two views, from the vanishing lines of its plane.
///
/// The homography `H` from the target to the image sends the line at infinity to `H⁻ᵀ e₃`, and the normal in the
/// camera is `Kᵀ` of that. A wrong focal length stretches the angles and leaves parallel normals parallel.
fn normal_spread_deg(seen: &[Seen], nominal: &Intrinsics) -> Result<f64, VisionError> {
    let mut normals: Vec<Vector3<f64>> = Vec::with_capacity(seen.len());
    for view in seen {
        let flat: Vec<Vector2<f64>> = view.points.iter().map(|p| p.coords.xy()).collect();
        let homography = calib3d::find_homography_ext_def(&to_points2f(&flat), &to_points2f(&view.pixels))
            .map_err(failed("fit the target's plane"))?;
        let numbers = numbers(&homography)?;
        let inverse = (numbers.len() == 9).then(|| Matrix3::from_row_slice(&numbers)).and_then(Matrix3::try_inverse);
        if let Some(inverse) = inverse {
            let normal = nominal.matrix().transpose() * inverse.transpose() * Vector3::z();
            normals.push(if normal.z < 0.0 { -normal } else { normal });
        }
    }
    let mut spread: f64 = 0.0;
    for (i, a) in normals.iter().enumerate() {
        for b in &normals[..i] {
            spread = spread.max(a.angle(b));
        }
    }
    Ok(spread.to_degrees())
}

fn criteria() -> TermCriteria {
    TermCriteria { typ: TermCriteria_EPS + TermCriteria_MAX_ITER, max_count: 100, epsilon: 1e-12 }
}

fn size(camera: &Intrinsics) -> Size {
    // `nominal_camera` has checked that both fit.
    Size::new(camera.width as i32, camera.height as i32)
}

/// OpenCV calibrates from single precision: at 2000 px that rounds to 10⁻⁴ px, far below any corner's noise.
fn points(seen: &[Seen]) -> (Vector<Vector<Point3f>>, Vector<Vector<Point2f>>) {
    (
        seen.iter().map(|view| to_points3f(&view.points)).collect(),
        seen.iter().map(|view| to_points2f(&view.pixels)).collect(),
    )
}

fn run_pinhole(
    seen: &[Seen],
    start: &Intrinsics,
    use_guess: bool,
) -> Result<(Intrinsics, Vec<Isometry3<f64>>), VisionError> {
    let (objects, images) = points(seen);
    let mut flags = match start.distortion {
        Distortion::None => {
            calib3d::CALIB_FIX_K1 + calib3d::CALIB_FIX_K2 + calib3d::CALIB_FIX_K3 + calib3d::CALIB_ZERO_TANGENT_DIST
        }
        Distortion::Rational(_) => calib3d::CALIB_RATIONAL_MODEL,
        _ => 0,
    };
    if use_guess {
        flags += calib3d::CALIB_USE_INTRINSIC_GUESS;
    }
    let mut matrix = camera_matrix(start)?;
    let mut distortion = coefficients(start);
    if distortion.is_empty() {
        distortion = Vector::from_slice(&[0.0; 5]);
    }
    let (mut rotations, mut translations) = (Vector::<Vec3d>::new(), Vector::<Vec3d>::new());
    calib3d::calibrate_camera(
        &objects,
        &images,
        size(start),
        &mut matrix,
        &mut distortion,
        &mut rotations,
        &mut translations,
        flags,
        criteria(),
    )
    .map_err(failed("calibrate the camera"))?;
    let intrinsics = from_opencv(start, &matrix, &distortion.iter().collect::<Vec<_>>())?;
    Ok((intrinsics, isometries(&rotations, &translations)))
}

fn run_fisheye(
    seen: &[Seen],
    start: &Intrinsics,
    use_guess: bool,
) -> Result<(Intrinsics, Vec<Isometry3<f64>>), VisionError> {
    let (objects, images) = points(seen);
    let mut flags = calib3d::Fisheye_CALIB_RECOMPUTE_EXTRINSIC + calib3d::Fisheye_CALIB_FIX_SKEW;
    if use_guess {
        flags += calib3d::Fisheye_CALIB_USE_INTRINSIC_GUESS;
    }
    let mut matrix = camera_matrix(start)?;
    let mut distortion = coefficients(start);
    let (mut rotations, mut translations) = (Vector::<Vec3d>::new(), Vector::<Vec3d>::new());
    calib3d::calibrate(
        &objects,
        &images,
        size(start),
        &mut matrix,
        &mut distortion,
        &mut rotations,
        &mut translations,
        flags,
        criteria(),
    )
    .map_err(failed("calibrate the fisheye camera"))?;
    let intrinsics = from_opencv(start, &matrix, &distortion.iter().collect::<Vec<_>>())?;
    Ok((intrinsics, isometries(&rotations, &translations)))
}

fn from_opencv(start: &Intrinsics, matrix: &Mat, distortion: &[f64]) -> Result<Intrinsics, VisionError> {
    let k = numbers(matrix)?;
    let (&[fx, _, cx, _, fy, cy, ..], true) = (&k[..], k.len() == 9) else {
        return Err(VisionError::NotACamera { reason: "the camera matrix is not 3×3".into() });
    };
    let camera = Intrinsics { fx, fy, cx, cy, distortion: start.distortion.with_coefficients(distortion), ..*start };
    camera.validate().map_err(|e| VisionError::NotACamera { reason: e.to_string() })?;
    Ok(camera)
}

/// Sums over views of the least-squares problem in the camera's parameters, the poses eliminated.
struct Evidence {
    information: DMatrix<f64>,
    views: Vec<ViewError>,
    squared_px: f64,
    corners: usize,
}

fn assess(
    seen: &[Seen],
    intrinsics: Intrinsics,
    poses: Vec<Isometry3<f64>>,
) -> Result<IntrinsicsCalibration, VisionError> {
    let evidence = gather(seen, &intrinsics, &poses)?;
    let covariance = unit_covariance(&evidence.information, &intrinsics)?;
    let unknowns = intrinsics.parameter_count() + 6 * seen.len();
    // Four corners a view can leave no more equations than unknowns; then nothing is known of the noise.
    let freedom = (2 * evidence.corners).saturating_sub(unknowns);
    let noise_px = if freedom > 0 { (evidence.squared_px / freedom as f64).sqrt() } else { f64::NAN };
    let sigma = |i: usize| noise_px * covariance[i].sqrt();
    Ok(IntrinsicsCalibration {
        intrinsics,
        camera_from_target: poses.into_iter().map(Pose::from_isometry).collect(),
        rms_px: (evidence.squared_px / evidence.corners as f64).sqrt(),
        views: evidence.views,
        sigma: PinholeSigma { fx: sigma(0), fy: sigma(1), cx: sigma(2), cy: sigma(3) },
    })
}

fn gather(seen: &[Seen], intrinsics: &Intrinsics, poses: &[Isometry3<f64>]) -> Result<Evidence, VisionError> {
    let n = intrinsics.parameter_count();
    let mut full = SMatrix::<f64, MAX_PARAMETERS, MAX_PARAMETERS>::zeros();
    let mut out = Evidence {
        information: DMatrix::zeros(n, n),
        views: Vec::with_capacity(seen.len()),
        squared_px: 0.0,
        corners: 0,
    };
    for (index, (view, pose)) in seen.iter().zip(poses).enumerate() {
        let mut pose_block = Matrix6::zeros();
        let mut cross = SMatrix::<f64, MAX_PARAMETERS, 6>::zeros();
        let mut squared_px = 0.0;
        let rotation = pose.rotation.to_rotation_matrix();
        for (point, px) in view.points.iter().zip(&view.pixels) {
            let projection = intrinsics
                .project_with_jacobians(&(pose * point))
                .map_err(|e| VisionError::NotACamera { reason: format!("view {index} is not in front of it: {e}") })?;
            let by_pose = px_by_pose(&projection.px_by_point, rotation.matrix(), point);
            let by_parameters = projection.px_by_parameters;
            squared_px += (projection.px - px).norm_squared();
            full += by_parameters.transpose() * by_parameters;
            cross += by_parameters.transpose() * by_pose;
            pose_block += by_pose.transpose() * by_pose;
        }
        let inverse = pose_block.try_inverse().ok_or(VisionError::CollinearCorners { view: index })?;
        full -= cross * inverse * cross.transpose();
        let count = view.points.len();
        out.views.push(ViewError {
            rms_px: (squared_px / count as f64).sqrt(),
            norm_per_corner_px: squared_px.sqrt() / count as f64,
        });
        out.squared_px += squared_px;
        out.corners += count;
    }
    out.information.copy_from(&full.view((0, 0), (n, n)));
    Ok(out)
}

/// Variances of the parameters for noise of 1 px per axis; refuses those that leave the pinhole undetermined.
fn unit_covariance(information: &DMatrix<f64>, camera: &Intrinsics) -> Result<Vec<f64>, VisionError> {
    let n = information.nrows();
    let scale: Vec<f64> = (0..n).map(|i| information[(i, i)].max(f64::MIN_POSITIVE).sqrt()).collect();
    // Parameters differ in size by many orders; scaled to unit diagonal the eigenvalues can be compared.
    let scaled = DMatrix::from_fn(n, n, |i, j| information[(i, j)] / (scale[i] * scale[j]));
    let eigen = SymmetricEigen::new(scaled);
    let variance = |i: usize| {
        let sum: f64 =
            (0..n).map(|k| eigen.eigenvectors[(i, k)].powi(2) / eigen.eigenvalues[k].max(MIN_EIGENVALUE)).sum();
        sum / (scale[i] * scale[i])
    };
    let variances: Vec<f64> = (0..n).map(variance).collect();
    for ((parameter, variance), focal) in
        PINHOLE_NAMES.into_iter().zip(&variances).zip([camera.fx, camera.fy, camera.fx, camera.fy])
    {
        let sigma_px = TYPICAL_NOISE_PX * variance.sqrt();
        if sigma_px.is_nan() || sigma_px > MAX_RELATIVE_SIGMA * focal {
            return Err(VisionError::Undetermined { parameter, sigma_px });
        }
    }
    Ok(variances)
}
