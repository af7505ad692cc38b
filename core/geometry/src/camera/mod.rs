//! Camera models: a pinhole with OpenCV's lens distortions.
//!
//! Camera axes are x right, y down, z forward. Pixel (0, 0) is the centre of the top-left pixel (OpenCV, mrcal).
//! Coefficient orders are OpenCV's. Parameters as a vector are `[fx fy cx cy, distortion…]`.

mod distortion;
mod fold;
pub mod residual_distortion;

use nalgebra::{Matrix2x3, Point3, SMatrix, Unit, Vector2, Vector3};
use serde::{Deserialize, Serialize};

pub use distortion::Distortion;
pub use fold::FoldsBack;
pub use residual_distortion::ResidualDistortion;

/// The most parameters any model has: four of the pinhole and eight of the rational distortion.
pub const MAX_PARAMETERS: usize = 12;

/// Derivative of a pixel by the camera's parameters; columns past [`Intrinsics::parameter_count`] are zero.
pub(crate) type PixelByParameters = SMatrix<f64, 2, MAX_PARAMETERS>;

/// Why a camera model cannot handle a point or a pixel.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error, handeye_wording::Localized)]
#[non_exhaustive]
pub enum CameraError {
    /// The point has no image: it is on or behind the camera plane.
    #[error("point at z = {z_m} m is not in front of the camera")]
    BehindCamera {
        /// Its depth in metres.
        z_m: f64,
    },
    /// No ray of the lens model hits this pixel: the pixel is past the radius where the distortion folds back.
    #[error("pixel ({u_px}, {v_px}) is outside the range of the lens model")]
    OutsideModel {
        /// Column in pixels.
        u_px: f64,
        /// Row in pixels.
        v_px: f64,
    },
    /// Focal length, size or coefficients are not usable numbers.
    #[error("camera parameter {name} = {value} is not usable: it must be finite, focal lengths and sizes positive")]
    BadParameter {
        /// Name of the parameter.
        name: &'static str,
        /// The value of the parameter, pixels or without a unit.
        value: f64,
    },
}

/// Intrinsic calibration of one camera.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Intrinsics {
    /// Image width in pixels.
    pub width: u32,
    /// Image height in pixels.
    pub height: u32,
    /// Focal length along x in pixels.
    pub fx: f64,
    /// Focal length along y in pixels.
    pub fy: f64,
    /// Principal point, column in pixels.
    pub cx: f64,
    /// Principal point, row in pixels.
    pub cy: f64,
    /// Lens distortion.
    pub distortion: Distortion,
}

/// A projected point with its first derivatives.
#[derive(Debug, Clone, Copy)]
pub struct Projection {
    /// The pixel.
    pub px: Vector2<f64>,
    /// Derivative by the point in camera coordinates, pixels per metre.
    pub px_by_point: Matrix2x3<f64>,
    /// Derivative by `[fx fy cx cy, distortion…]`.
    pub px_by_parameters: PixelByParameters,
}

/// [`Projection`] in plain numbers; every derivative is a pair of x and y.
#[derive(Debug, Clone, Copy)]
pub struct LinearPixel {
    /// The pixel.
    pub px: [f64; 2],
    /// Derivatives by the point in camera coordinates, pixels per metre.
    pub by_point: [[f64; 2]; 3],
    /// Derivatives by the parameters, in the order of [`Intrinsics::parameters`].
    pub by_parameters: [[f64; 2]; MAX_PARAMETERS],
}

impl Intrinsics {
    /// A camera without distortion whose principal point is the image centre.
    pub fn pinhole(width: u32, height: u32, focal_px: f64) -> Self {
        Self {
            width,
            height,
            fx: focal_px,
            fy: focal_px,
            cx: (f64::from(width) - 1.0) / 2.0,
            cy: (f64::from(height) - 1.0) / 2.0,
            distortion: Distortion::None,
        }
    }

    /// The camera of a CoppeliaSim perspective vision sensor: `angle_rad` opens along the larger image side,
    /// `f = max(w, h) / 2 / tan(angle / 2)`, principal point in the exact centre, no distortion.
    pub fn from_view_angle(width: u32, height: u32, angle_rad: f64) -> Self {
        let half_side = f64::from(width.max(height)) / 2.0;
        Self::pinhole(width, height, half_side / (angle_rad / 2.0).tan())
    }

    /// Checks that every number is usable.
    ///
    /// # Errors
    /// [`CameraError::BadParameter`] names the first that is not.
    pub fn validate(&self) -> Result<(), CameraError> {
        let positive =
            [("width", f64::from(self.width)), ("height", f64::from(self.height)), ("fx", self.fx), ("fy", self.fy)];
        for (name, value) in positive {
            if !(value.is_finite() && value > 0.0) {
                return Err(CameraError::BadParameter { name, value });
            }
        }
        let finite = [("cx", self.cx), ("cy", self.cy)]
            .into_iter()
            .chain(self.distortion.coefficients().iter().map(|&c| ("distortion", c)));
        for (name, value) in finite {
            if !value.is_finite() {
                return Err(CameraError::BadParameter { name, value });
            }
        }
        Ok(())
    }

    /// Number of parameters: 4 and the distortion's.
    pub fn parameter_count(&self) -> usize {
        4 + self.distortion.coefficients().len()
    }

    /// `[fx fy cx cy, distortion…]`.
    pub fn parameters(&self) -> Vec<f64> {
        let mut all = vec![self.fx, self.fy, self.cx, self.cy];
        all.extend_from_slice(self.distortion.coefficients());
        all
    }

    /// The same model with other parameters, in the order of [`Self::parameters`]; missing ones keep their value.
    #[must_use]
    pub fn with_parameters(&self, parameters: &[f64]) -> Self {
        let mut out = *self;
        let slots = [&mut out.fx, &mut out.fy, &mut out.cx, &mut out.cy];
        for (slot, value) in slots.into_iter().zip(parameters) {
            *slot = *value;
        }
        if let Some(coefficients) = parameters.get(4..) {
            out.distortion = out.distortion.with_coefficients(coefficients);
        }
        out
    }

    /// The pixel of a point in camera coordinates, in metres.
    ///
    /// # Errors
    /// [`CameraError::BehindCamera`]; only the fisheye model sees points on and behind its plane.
    pub fn project(&self, point: &Point3<f64>) -> Result<Vector2<f64>, CameraError> {
        let distorted = self.distortion.distort(&point.coords)?;
        Ok(Vector2::new(self.fx * distorted.x + self.cx, self.fy * distorted.y + self.cy))
    }

    /// [`Self::project`] with analytic derivatives.
    ///
    /// # Errors
    /// As [`Self::project`].
    pub fn project_with_jacobians(&self, point: &Point3<f64>) -> Result<Projection, CameraError> {
        let linear = self.linearise(&point.coords)?;
        Ok(Projection {
            px: linear.px.into(),
            px_by_point: linear.by_point.into(),
            px_by_parameters: linear.by_parameters.into(),
        })
    }

    /// [`Self::project_with_jacobians`] in plain numbers, for inner loops.
    #[inline]
    pub(crate) fn linearise(&self, point: &Vector3<f64>) -> Result<LinearPixel, CameraError> {
        let d = self.distortion.linearise(point)?;
        let focal = |[x, y]: [f64; 2]| [self.fx * x, self.fy * y];
        let [x, y] = d.value;
        let mut by_parameters = [[0.0; 2]; MAX_PARAMETERS];
        (by_parameters[0], by_parameters[1]) = ([x, 0.0], [0.0, y]);
        (by_parameters[2], by_parameters[3]) = ([1.0, 0.0], [0.0, 1.0]);
        for (column, by_coefficient) in by_parameters[4..].iter_mut().zip(d.by_coefficients) {
            *column = focal(by_coefficient);
        }
        Ok(LinearPixel {
            px: [self.fx * x + self.cx, self.fy * y + self.cy],
            by_point: d.by_point.map(focal),
            by_parameters,
        })
    }

    /// The direction in camera coordinates that a pixel sees; inverse of [`Self::project`] up to distance.
    ///
    /// # Errors
    /// [`CameraError::OutsideModel`] where the lens model has no such ray.
    pub fn unproject(&self, px: &Vector2<f64>) -> Result<Unit<Vector3<f64>>, CameraError> {
        let distorted = Vector2::new((px.x - self.cx) / self.fx, (px.y - self.cy) / self.fy);
        self.distortion.undistort(&distorted).ok_or(CameraError::OutsideModel { u_px: px.x, v_px: px.y })
    }

    /// Whether a pixel lies in the image (its outermost pixel centres count, half a pixel beyond does too).
    pub fn contains(&self, px: &Vector2<f64>) -> bool {
        px.x >= -0.5 && px.y >= -0.5 && px.x < f64::from(self.width) - 0.5 && px.y < f64::from(self.height) - 0.5
    }

    /// The 3×3 matrix K.
    pub fn matrix(&self) -> nalgebra::Matrix3<f64> {
        nalgebra::Matrix3::new(self.fx, 0.0, self.cx, 0.0, self.fy, self.cy, 0.0, 0.0, 1.0)
    }
}

#[cfg(test)]
mod tests;
