//! A pixel as a point in the base.

use nalgebra::{DMatrix, Isometry3, Matrix3, Matrix3xX, Point3, Vector2, Vector3};

use super::{Predictor, VerifyError};
use crate::corrected_arm::TipAt;
use crate::handeye::HandEye;
use crate::handeye::joint::SmallSample;
use handeye_geometry::camera::Intrinsics;
use handeye_geometry::frames::{Base, Camera, PointIn, Pose, Target};
use handeye_geometry::point_error;

/// A point that the camera measured.
#[derive(Debug, Clone, Copy)]
pub struct MeasuredPoint {
    /// Its place in the camera, metres.
    pub in_camera: PointIn<Camera>,
    /// Its place in the base of the robot, metres.
    pub in_base: PointIn<Base>,
    /// Covariance in base axes, square metres, due to the hand-eye transform, and to the errors of the arm where the tip is
    /// corrected for them: the noise of this robot pose, of the depth or the corners, and of the lens come on top. `None` when the
    /// calibration states none.
    pub covariance_in_base: Option<Matrix3<f64>>,
    /// How the error is distributed in units of that covariance.
    pub small_sample: SmallSample,
}

impl MeasuredPoint {
    /// Standard deviation along x, y and z of the base, metres; see [`covariance_in_base`](Self::covariance_in_base).
    pub fn sigma_m(&self) -> Option<Vector3<f64>> {
        self.covariance_in_base.map(|c| c.diagonal().map(|v| v.max(0.0).sqrt()))
    }

    /// The length that its error stays below with a probability of 95 %, metres; for the same part of the error, and by
    /// the same distribution as the expected error of the calibration.
    pub fn error_95_m(&self) -> Option<f64> {
        self.covariance_in_base.as_ref().map(|covariance| self.small_sample.radius_95(covariance))
    }
}

impl Predictor {
    /// The point at `depth_m` along the optical axis on the ray of a pixel.
    ///
    /// # Errors
    /// [`VerifyError::BadDepth`] for a value that is not positive or a ray that does not point forward,
    /// [`VerifyError::Camera`] for a pixel outside the lens model.
    pub fn point_at_depth(
        &self,
        tip: impl Into<TipAt>,
        px: &Vector2<f64>,
        depth_m: f64,
    ) -> Result<MeasuredPoint, VerifyError> {
        let ray = self.intrinsics.unproject(px)?;
        if !(depth_m > 0.0 && depth_m.is_finite() && ray.z > 0.0) {
            return Err(VerifyError::BadDepth { depth_m });
        }
        Ok(self.measured(&tip.into(), Point3::from(ray.into_inner() * (depth_m / ray.z))))
    }

    /// The point of the board's plane that a pixel sees, with the board's pose in this image by
    /// [`seen`](Self::seen).
    ///
    /// # Errors
    /// [`VerifyError::MissesBoard`] when the ray does not meet the plane in front of the camera,
    /// [`VerifyError::Camera`] for a pixel outside the lens model.
    pub fn point_on_board(
        &self,
        tip: impl Into<TipAt>,
        px: &Vector2<f64>,
        camera_from_target: &Pose<Camera, Target>,
    ) -> Result<MeasuredPoint, VerifyError> {
        let point = on_plane(&self.intrinsics, px, camera_from_target.isometry())?;
        Ok(self.measured(&tip.into(), point))
    }

    fn measured(&self, tip: &TipAt, in_camera: Point3<f64>) -> MeasuredPoint {
        let base_from_camera = self.base_from_camera(&tip.base_from_tip);
        let rotation = base_from_camera.rotation().to_rotation_matrix().into_inner();
        let by_hand_eye = rotation * point_error::by_hand_eye(&in_camera);
        let covariance_in_base = match (&self.uncertainty, self.hand_eye) {
            (Some(uncertainty), HandEye::EyeInHand { tip_from_camera, .. })
                if self.arm.is_some() && uncertainty.covariance.nrows() >= 12 + tip.by_errors.ncols() =>
            {
                let in_tip = tip_from_camera.isometry() * in_camera;
                let turn = tip.base_from_tip.rotation().to_rotation_matrix().into_inner();
                let by_errors: Matrix3xX<f64> = turn * point_error::by_hand_eye(&in_tip) * &tip.by_errors;
                let (all, count) = (uncertainty.covariance.nrows(), by_errors.ncols());
                let mut by_shared = DMatrix::zeros(3, all);
                by_shared.columns_mut(0, 6).copy_from(&by_hand_eye);
                by_shared.columns_mut(all - count, count).copy_from(&by_errors);
                let covariance = &by_shared * &uncertainty.covariance * by_shared.transpose();
                Some(covariance.fixed_view::<3, 3>(0, 0).into_owned())
            }
            _ => self.hand_eye_covariance.as_ref().map(|c| by_hand_eye * c * by_hand_eye.transpose()),
        };
        let in_camera = PointIn::new(in_camera);
        let in_base = base_from_camera * in_camera;
        MeasuredPoint { in_camera, in_base, covariance_in_base, small_sample: self.small_sample }
    }
}

/// Where the ray of a pixel meets the plane z = 0 of the board, camera coordinates in metres.
pub(super) fn on_plane(
    intrinsics: &Intrinsics,
    px: &Vector2<f64>,
    camera_from_target: &Isometry3<f64>,
) -> Result<Point3<f64>, VerifyError> {
    let ray = intrinsics.unproject(px)?.into_inner();
    let normal = camera_from_target.rotation * Vector3::z();
    let along = normal.dot(&camera_from_target.translation.vector) / normal.dot(&ray);
    // A ray along the plane gives infinity or NaN, one that meets it behind the camera a negative number.
    if along > 0.0 && along.is_finite() {
        Ok(Point3::from(ray * along))
    } else {
        Err(VerifyError::MissesBoard { u_px: px.x, v_px: px.y })
    }
}
