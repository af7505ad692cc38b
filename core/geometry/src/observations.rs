//! What a session observed, as input to an estimator: what carries the camera, what is known of the lens, and one entry per
//! image.

use nalgebra::{DMatrix, DVector, Isometry3, Vector2};
use serde::{Deserialize, Serialize};

use crate::camera::{Distortion, Intrinsics};
use crate::frames::{Anchor, Base, Camera, Mount, Pose, Target, Tip};
use crate::targets::TargetSpec;
use crate::targets::depth_plane::DepthPlane;
use crate::targets::observation::{Corners, View};

/// Where the camera is mounted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Mode {
    /// The camera is on the tip, the target is fixed.
    EyeInHand,
    /// The camera is fixed, the target is on the tip.
    EyeToHand,
}

impl Mode {
    /// The robot pose of a view in the frames of the common problem.
    pub fn anchor_from_mount(self, base_from_tip: &Pose<Base, Tip>) -> Pose<Anchor, Mount> {
        match self {
            // Anchor is the base and mount the tip.
            Self::EyeInHand => base_from_tip.relabel(),
            // Anchor is the tip and mount the base.
            Self::EyeToHand => base_from_tip.inverse().relabel(),
        }
    }
}

/// What was observed, from a dataset folder, a session or a live capture.
#[derive(Debug, Clone)]
pub struct Observations {
    /// Where the camera is mounted; `None` when there is no robot and only the camera is calibrated.
    pub mode: Option<Mode>,
    /// The target that is seen in all views.
    pub target: TargetSpec,
    /// Width and height of the images in pixels.
    pub image_size: (u32, u32),
    /// What is known about the camera.
    pub camera: CameraKnowledge,
    /// One entry per image, in the order of the pose table.
    pub views: Vec<ObservedView>,
}

/// One image.
#[derive(Debug, Clone)]
pub struct ObservedView {
    /// Its name in reports.
    pub name: String,
    /// The reported robot pose; `None` when there is no robot.
    pub base_from_tip: Option<Pose<Base, Tip>>,
    /// The corners; `None` when the target was not found.
    pub corners: Option<Corners>,
    /// The joints of the arm at the reported pose, as in [`View::tip_from_joints`]; empty where they are not known.
    pub tip_from_joints: Vec<Isometry3<f64>>,
    /// The plane of the target by the depths of the image; `None` where none were measured.
    pub depth: Option<DepthPlane>,
    /// A target pose measured elsewhere, used when there are no corners.
    pub camera_from_target: Option<Pose<Camera, Target>>,
    /// Whether the view takes part; one that does not has no influence on results.
    pub in_fit: bool,
}

impl ObservedView {
    /// A view that takes part, of a robot whose joint angles are not known.
    pub fn new(name: impl Into<String>, base_from_tip: Option<Pose<Base, Tip>>, corners: Option<Corners>) -> Self {
        Self {
            name: name.into(),
            base_from_tip,
            corners,
            tip_from_joints: Vec::new(),
            depth: None,
            camera_from_target: None,
            in_fit: true,
        }
    }
}

impl From<&View> for ObservedView {
    /// A view that takes part.
    fn from(view: &View) -> Self {
        Self {
            tip_from_joints: view.tip_from_joints.clone(),
            depth: view.depth,
            corners: Some(view.corners.clone()),
            ..Self::new(view.name.clone(), Some(view.base_from_tip), None)
        }
    }
}

/// What is known about the camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum CameraKnowledge {
    /// These intrinsics, taken as exact.
    Fixed(Intrinsics),
    /// These intrinsics, with their stated accuracy.
    Near(KnownLens),
    /// Intrinsics are estimated.
    Estimate {
        /// The lens model; its coefficients do not matter.
        model: Distortion,
        /// Where to start; `None` finds a start from the views.
        start: Option<Intrinsics>,
    },
}

impl CameraKnowledge {
    /// What is known when nothing is stated: intrinsics are estimated with [`DEFAULT_MODEL`].
    pub const NOTHING: Self = Self::Estimate { model: DEFAULT_MODEL, start: None };
}

/// Range of the accuracy that may be stated for a lens, pixels: a thousandth is exact for every purpose, and with a thousand
/// nothing is known.
pub const LENS_ACCURACY_PX: std::ops::RangeInclusive<f64> = 1e-3..=1e3;

/// A lens that is known to this many pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KnownLens {
    /// The lens.
    pub intrinsics: Intrinsics,
    /// Displacement of image points by the error of each of its parameters, one standard deviation, RMS over the image, pixels;
    /// within [`LENS_ACCURACY_PX`]. All of them together displace points by that times the root of their number.
    pub accuracy_px: f64,
}

impl KnownLens {
    /// Inverse of the covariance of its parameters, in the order of [`Intrinsics::parameters`]: a step `d` of them displaces the
    /// points of the image by the length `√(dᵀ M d)`, RMS, and has the information `M / accuracy_px²`.
    pub fn information(&self) -> DMatrix<f64> {
        const ALONG: u32 = 12;
        /// Relative increase of the diagonal elements, so that the matrix is regular.
        const APART: f64 = 1e-6;
        let lens = &self.intrinsics;
        let count = lens.parameter_count();
        let mut sum = DMatrix::zeros(count, count);
        let mut seen = 0.0;
        let along = |size: u32, k: u32| (f64::from(k) + 0.5) / f64::from(ALONG) * f64::from(size) - 0.5;
        for (u, v) in (0..ALONG).flat_map(|u| (0..ALONG).map(move |v| (u, v))) {
            let px = Vector2::new(along(lens.width, u), along(lens.height, v));
            // Points without a ray in the model are not displaced.
            let Some(pixel) = lens.unproject(&px).ok().and_then(|ray| lens.linearise(&ray).ok()) else { continue };
            let by = |axis: usize| DVector::from_fn(count, |k, _| pixel.by_parameters[k][axis]);
            for by in [by(0), by(1)] {
                sum.ger(1.0, &by, &by, 1.0);
            }
            seen += 1.0;
        }
        // Some coefficients of a lens without distortion have the same effect as others together, and no view separates them
        // either.
        for k in 0..count {
            sum[(k, k)] *= 1.0 + APART;
        }
        sum / (f64::max(seen, 1.0) * self.accuracy_px.powi(2))
    }
}

/// Lens model that is estimated when none is given: what OpenCV estimates by default.
pub const DEFAULT_MODEL: Distortion = Distortion::BrownConrady([0.0; 5]);

/// Noise levels, one standard deviation per axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Noise {
    /// Noise of a corner, pixels.
    pub corner_px: f64,
    /// Noise that all corners of a view share in addition, pixels: errors of lens, target and image that look like a
    /// pose. A pose from `n` corners has the covariance `(corner_px² + view_px²) (Jᵀ J)⁻¹`. Zero where the data require
    /// none.
    pub view_px: f64,
    /// Noise of the reported tip position, metres.
    pub robot_m: f64,
    /// Noise of the reported tip orientation, radians.
    pub robot_rad: f64,
    /// Pose-dependent error of the reported tip position, an affine function of the position, metres: at a distance of the RMS
    /// spread of the places from their mean. Zero where they are not in the model.
    pub field_m: f64,
    /// The same for the reported tip orientation, radians.
    pub field_rad: f64,
    /// Errors of the angles of an arm's links (zeros of its joints, directions of their axes), radians. Zero where they are not
    /// in the model, like the next two.
    pub link_rad: f64,
    /// Errors of the lengths of its links (places of the axes), metres.
    pub link_m: f64,
    /// Deflection of its joints under gravity, radians for the arm stretched out.
    pub compliance_rad: f64,
}

impl Noise {
    /// No noise at all.
    pub const EXACT: Self = Self {
        corner_px: 0.0,
        view_px: 0.0,
        robot_m: 0.0,
        robot_rad: 0.0,
        field_m: 0.0,
        field_rad: 0.0,
        link_rad: 0.0,
        link_m: 0.0,
        compliance_rad: 0.0,
    };
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_known_lens_displaces_points_by_its_accuracy() {
        let intrinsics = Intrinsics { distortion: DEFAULT_MODEL, ..Intrinsics::pinhole(640, 480, 600.0) };
        let information = KnownLens { intrinsics, accuracy_px: 0.5 }.information();
        assert_eq!(information.shape(), (9, 9));
        // A centre half a pixel off is one standard deviation; so is a focal length that moves points by half a pixel, RMS.
        let of = |k: usize, step: f64| information[(k, k)].sqrt() * step;
        assert!((of(2, 0.5) - 1.0).abs() < 1e-5 && (of(3, 0.5) - 1.0).abs() < 1e-5);
        let rms = 640.0 / 12_f64.sqrt() / 600.0;
        assert!((of(0, 0.5 / rms) - 1.0).abs() < 0.01, "{}", of(0, 0.5 / rms));
    }

    #[test]
    fn what_is_known_of_any_lens_determines_all_of_it() {
        for name in ["none", "brown_conrady", "rational", "fisheye"] {
            let distortion = Distortion::from_name(name).expect("a model");
            let intrinsics = Intrinsics { distortion, ..Intrinsics::pinhole(640, 480, 600.0) };
            let information = KnownLens { intrinsics, accuracy_px: 0.5 }.information();
            let scale = information.diagonal().map(|value| value.sqrt().recip());
            let scaled = DMatrix::from_fn(scale.len(), scale.len(), |i, j| information[(i, j)] * scale[i] * scale[j]);
            let least = scaled.symmetric_eigenvalues().min();
            assert!(least > 1e-7, "{name}: {least}");
        }
    }
}
