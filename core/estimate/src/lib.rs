//! Hand-eye calibration and camera intrinsics from corners and robot poses, with the uncertainty that the data support.
//!
//! Corners of a target and the poses that a robot reported go in; where the camera is on the robot, and how far off a
//! point measured with it is expected to be, come out:
//!
//! ```
//! use handeye_estimate::diagnose::calibrate;
//! use handeye_estimate::handeye::{HandEye, Mode};
//! use handeye_estimate::{CameraKnowledge, Method, ObservedView, Observations};
//! use handeye_geometry::progress::CancelToken;
//! use handeye_geometry::targets::{Grid, TargetSpec};
//! # use handeye_geometry::camera::Intrinsics;
//! # use handeye_geometry::frames::{Base, Pose, Tip};
//! # use nalgebra::{Isometry3, Vector2, Vector3};
//! # use handeye_geometry::targets::observation::{Corner, Corners};
//! #
//! # const TARGET: TargetSpec = TargetSpec::Chessboard(Grid { columns: 9, rows: 6, square_m: 0.025 });
//! # fn tip_from_camera() -> Isometry3<f64> { Isometry3::new(Vector3::new(0.05, 0.0, 0.08), Vector3::z() * 1.5) }
//! # /// Twelve views of a board on a table, with corners that are a few hundredths of a pixel off.
//! # fn recording() -> Vec<(String, Pose<Base, Tip>, Corners)> {
//! #     let base_from_target = Isometry3::new(Vector3::new(0.5, 0.1, 0.0), Vector3::x() * 3.1);
//! #     let camera = Intrinsics::pinhole(640, 480, 600.0);
//! #     let view = |i: usize| {
//! #         let angle = i as f64 * 2.4;
//! #         let turn = Vector3::new(0.5 * angle.cos(), 0.5 * angle.sin(), 0.4 * (2.0 * angle).sin());
//! #         let aim = Isometry3::new(Vector3::new(0.0, 0.0, 0.45 + 0.01 * i as f64), turn);
//! #         let camera_from_target = aim * Isometry3::translation(-0.1, -0.0625, 0.0);
//! #         let base_from_tip = base_from_target * camera_from_target.inverse() * tip_from_camera().inverse();
//! #         let corner = |(k, point)| {
//! #             let px = camera.project(&(camera_from_target * point)).expect("in front of the camera");
//! #             let noise = |n: usize| ((n * 7919 + i * 104_729) % 13) as f64 / 130.0 - 0.046;
//! #             Corner::new(k, px + Vector2::new(noise(k), noise(k + 5)))
//! #         };
//! #         let corners = TARGET.points().into_iter().enumerate().map(corner).collect();
//! #         (format!("image {i}"), Pose::from_isometry(base_from_tip), corners)
//! #     };
//! #     (0..12).map(view).collect()
//! # }
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! // Of each image: its name, the pose of the TCP in the base, and the corners in it by their number, row by row.
//! let mut views = Vec::new();
//! for (name, base_from_tip, corners) in recording() {
//!     views.push(ObservedView::new(name, Some(base_from_tip), Some(corners)));
//! }
//! let observations = Observations {
//!     mode: Some(Mode::EyeInHand),
//!     target: TargetSpec::Chessboard(Grid { columns: 9, rows: 6, square_m: 0.025 }),
//!     image_size: (640, 480),
//!     camera: CameraKnowledge::NOTHING,
//!     views,
//! };
//! let calibration = calibrate(&observations, Method::Joint, &CancelToken::default())?;
//!
//! let Some(HandEye::EyeInHand { tip_from_camera, .. }) = calibration.hand_eye else { return Err("no robot".into()) };
//! println!("{tip_from_camera:?}");
//! let error_m = calibration.tip_error_95_m().ok_or("only the joint estimate states its error")?;
//! println!("95 % of points measured with it are off by less than {:.3} mm", error_m * 1e3);
//! # let (off_m, _) = tip_from_camera.distance_to(&Pose::from_isometry(self::tip_from_camera()));
//! # assert!(off_m < 5e-4 && error_m < 2e-3, "off by {off_m} m, stated {error_m} m");
//! # Ok(())
//! # }
//! ```
//!
//! From observations to a [`Fit`]: intrinsics, closed forms, the joint estimate, and its uncertainty by its own model. A fit states
//! no error: [`diagnose::examine`] tests for contradictions and yields the [`diagnose::Calibration`] that does, and
//! [`diagnose::calibrate`] does both.
//!
//! | module | does |
//! | --- | --- |
//! | [`intrinsics`] | the lens from views of a target, without a robot |
//! | [`handeye`] | closed forms, and the joint estimate of camera, target, lens, robot noise and other visible effects |
//! | [`uncertainty`] | covariance, overdispersion, expected error of a point |
//! | [`diagnose`] | hypotheses about conventions and pairing, findings, the doctor, the calibration that states its error |
//! | [`verify`] | predictions for views outside the fit, depth cameras |
//! | [`corrected_arm`] | the true tip pose of an arm with errors, and the corrected command |
//! | [`reach_error`] | how near a tool arrives at a point that the camera saw |
//! | [`robot_accuracy`] | the same where only the accuracy of the arm is known |
//! | [`resolution`], [`shared_lens`], [`placement`] | resolution of poses, sessions with one lens, an arm by its joint values |
//!
//! Conventions are in `docs/reference/conventions.md`, the mathematics in `docs/maths`. Results are the same in every run and on
//! any number of cores: no clock, no hidden seed. Never depends on images, files, OpenCV, windows or sockets.

#![warn(missing_docs)]

mod arm_fit;
mod bend;
mod corners;
pub mod corrected_arm;
mod detected_view;
pub mod diagnose;
mod few_joints;
mod given_lens;
pub mod handeye;
pub mod intrinsics;
mod lens;
mod pairs;
pub mod placement;
pub mod reach_error;
mod refine;
mod residuals;
pub mod resolution;
pub mod robot_accuracy;
pub mod shared_lens;
pub(crate) mod size;
pub mod stated_uncertainty;
#[cfg(test)]
mod test_sessions;
mod two_poses;
pub mod uncertainty;
pub mod verify;
mod wrong_corners;

use nalgebra::{DMatrix, Matrix5, Matrix6, Point3, Vector2};

pub use crate::arm_fit::{ArmFit, OtherEstimates};
use crate::handeye::closed_form::{self, ClosedFormSolution};
use crate::handeye::joint::prediction::ErrorCurve;
use crate::handeye::joint::{
    CornerWeights, DepthWeight, Free, Noise, PoseDependentError, PrintErrors, ShownDistortion, SmallSample,
};
use crate::handeye::one_axis::PartialHandEye;
use crate::handeye::screening::Distance;
use crate::handeye::{HandEye, HandEyeError, Mode, PosePair, motion, one_axis, subset};
use crate::intrinsics::IntrinsicsError;
use crate::shared_lens::found::SharedLens;
use crate::stated_uncertainty::Alternative;
use crate::uncertainty::overdispersion::Overdispersion;
use crate::uncertainty::quality;
use handeye_geometry::camera::Intrinsics;
use handeye_geometry::frames::{Camera, Pose, Target};
pub use handeye_geometry::observations::{CameraKnowledge, DEFAULT_MODEL, KnownLens, Observations, ObservedView};
use handeye_geometry::planar_pose::PoseError;
use handeye_geometry::progress::{Stage, Work};
use handeye_geometry::targets::bent::BoardShape;
pub use handeye_geometry::view_equations::DepthBias;

/// Views of a good session: the noise levels rest on the numbers of this many views, and with ten they are known to a
/// fifth.
pub const GOOD_VIEWS: usize = 10;

/// Which answer is requested.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Method {
    /// The joint estimate; from pose pairs alone the pose graph.
    #[default]
    Joint,
    /// A closed form, by its name in [`closed_form::all`].
    ClosedForm(&'static str),
}

impl Method {
    /// Names on the command line: `joint` and those of the closed forms.
    pub fn names() -> Vec<&'static str> {
        std::iter::once("joint").chain(closed_form::all().iter().map(|m| m.name())).collect()
    }

    /// Its name on the command line and in results.
    pub fn name(self) -> &'static str {
        match self {
            Self::Joint => "joint",
            Self::ClosedForm(name) => name,
        }
    }

    /// The method with that name.
    pub fn by_name(name: &str) -> Option<Self> {
        if name == "joint" {
            return Some(Self::Joint);
        }
        closed_form::by_name(name).map(|m| Self::ClosedForm(m.name()))
    }
}

/// Settings of a calibration.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Options {
    /// Keep views and corners that do not fit the others; without it they are left out as outliers and named.
    pub keep_outliers: bool,
    /// Estimate the true size of the target, or with poses of the target alone the unit of their translations; the robot's
    /// translations determine it.
    pub free_scale: bool,
}

/// Result of an attempt to use the depths of the views.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DepthsInFit {
    /// Number of views with depths.
    pub views: usize,
    /// Noise of the depths of a view, which all of them have in common, metres.
    pub noise_m: f64,
    /// Their weight against corners.
    pub weight: DepthWeight,
    /// Probability of the other model of whether the depth camera is turned against the lens.
    pub other_probability: f64,
    /// Errors of the depth camera with that left open.
    pub bias: DepthBias,
    /// Their covariance, in the order of [`DepthBias`].
    pub covariance: Matrix5<f64>,
    /// Error on held-out views without them, pixels.
    pub heldout_before_px: f64,
    /// Error on held-out views with them, pixels.
    pub heldout_after_px: f64,
    /// Whether the answer uses them.
    pub accepted: bool,
}

impl DepthsInFit {
    /// Their weight, where the answer uses them.
    pub(crate) fn weight(&self) -> Option<DepthWeight> {
        self.accepted.then_some(self.weight)
    }
}

/// The depths of the views as used by the joint estimate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointDepths {
    /// Result of the attempt.
    pub in_fit: DepthsInFit,
    /// Errors of the depth camera in the answer; zero where it does not use the depths.
    pub bias: DepthBias,
}

/// The shape of the target where it is not the one drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShapeEstimate {
    /// Scale and bend of the target.
    pub shape: BoardShape,
    /// Standard deviations of the two warps, metres; `None` when the target is taken as flat.
    pub warp_sigma_m: Option<[f64; 2]>,
    /// Standard deviation of the scale; `None` when the stated size is taken as exact.
    pub scale_sigma: Option<f64>,
}

/// The size of the target by the robot's motion, with everything that the answer includes free as well.
#[derive(Debug, Clone, PartialEq)]
pub struct TargetSize {
    /// True over stated size.
    pub scale: f64,
    /// Its standard deviation.
    pub sigma: f64,
    /// Degrees of freedom that the standard deviation rests on.
    pub degrees_of_freedom: f64,
    /// The hand-eye transform with a target of that size, with the prior of sizes.
    pub with: Alternative,
}

/// Why there is no calibration.
#[derive(Debug, Clone, PartialEq, thiserror::Error, handeye_wording::Localized)]
#[non_exhaustive]
pub enum CalibrateError {
    /// The target was not found in enough images.
    #[error(
        "the target ({target}) was found in {found} of {images} images, at least {need} are needed: check its kind, its \
         number of columns and rows, and that it is wholly in view"
    )]
    TargetNotFound {
        /// Number of images in which it was found.
        found: usize,
        /// Number of all images.
        images: usize,
        /// Least number.
        need: usize,
        /// The target that was searched for.
        target: String,
    },
    /// Views were left out of the fit by the caller, and the rest is too few.
    #[error(
        "views with the target in sight: {left} in the fit and {excluded} excluded, at least {need} are needed; take \
         views back in or capture more"
    )]
    TooFewLeft {
        /// Views with the target that take part.
        left: usize,
        /// Views that were left out.
        excluded: usize,
        /// Least number.
        need: usize,
    },
    /// The camera could not be calibrated.
    #[error(transparent)]
    Intrinsics(#[from] IntrinsicsError),
    /// The accuracy of a lens that is given is not in [`LENS_ACCURACY_PX`](handeye_geometry::observations::LENS_ACCURACY_PX).
    #[error("the lens given is said to be good to {accuracy_px} px: say a number of pixels between 0.001 and 1000")]
    LensAccuracy {
        /// The stated accuracy.
        accuracy_px: f64,
    },
    /// The target has no pose in a view.
    #[error(transparent)]
    Pose(#[from] PoseError),
    /// The hand-eye solve failed.
    #[error(transparent)]
    HandEye(#[from] HandEyeError),
    /// The robot turned about one axis only: five of the six numbers of the hand-eye transform, and which one is open.
    #[error("{found}", found = .0.text())]
    OneAxis(Box<PartialHandEye>),
    /// A view of a hand-eye set has no robot pose.
    #[error("view {name:?} has no robot pose")]
    NoRobotPose {
        /// Which view.
        name: String,
    },
    /// Neither corners nor target poses.
    #[error("view {name:?} has neither corners nor a target pose")]
    NothingObserved {
        /// Which view.
        name: String,
    },
}

/// Where the lens begins among the unknowns of [`JointFit::covariance`]: both links come first.
const LENS_AT: usize = 12;

/// A lens whose error exceeds its stated accuracy.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RefutedLens {
    /// Its stated accuracy, pixels.
    pub accuracy_px: f64,
    /// Displacement of points of the image by the lens that fits, RMS, pixels.
    pub off_px: f64,
}

/// Result of a fit. It states no error: [`Calibration`](crate::diagnose::Calibration) does, once the fit is examined.
#[derive(Debug, Clone, Default)]
#[non_exhaustive]
pub struct Fit {
    /// Both rigid links; `None` without a robot.
    pub hand_eye: Option<HandEye>,
    /// How well the links are known; `None` for a closed form.
    pub link_covariances: Option<LinkCovariances>,
    /// The camera; `None` when only pose pairs were given.
    pub camera: Option<CalibratedCamera>,
    /// Fit of an estimated camera to the corners without the robot; `None` when it was given, and where a joint estimate
    /// gives a better one.
    pub camera_fit: Option<CameraFit>,
    /// Quality of the poses by an estimate from poses of the target alone; `None` for one from corners, and for a closed
    /// form.
    pub pose_fit: Option<PoseFit>,
    /// An estimated lens as the corners alone show it, by a flat target: it does not depend on the robot, which may be what is
    /// wrong. `None` where it was given, and where the corners show a bent target.
    pub(crate) lens_by_corners: Option<Intrinsics>,
    /// RMS of 2-D corner residuals, pixels.
    pub rms_px: Option<f64>,
    /// Results of the joint estimate only; `None` for a closed form, and without a robot.
    pub joint: Option<JointFit>,
    /// Every closed form and its result.
    pub methods: Vec<MethodResult>,
    /// One entry per view, in the order of the observations.
    pub views: Vec<ViewResult>,
    /// The sessions that share the lens; `None` for a single session.
    pub shared_lens: Option<SharedLens>,
}

impl Fit {
    /// The intrinsics; `None` when only pose pairs were given.
    pub fn intrinsics(&self) -> Option<Intrinsics> {
        self.camera.as_ref().map(|camera| camera.intrinsics)
    }

    /// Standard deviation of `ln(fx / fy)` of an estimated lens. The errors of fx and fy are correlated, so it is
    /// smaller than theirs.
    pub(crate) fn aspect_sigma(&self) -> Option<f64> {
        let camera = self.camera.filter(|camera| !camera.fixed)?;
        let Some(joint) = self.joint.as_ref().filter(|joint| joint.free.intrinsics) else {
            return self.camera_fit?.aspect_sigma;
        };
        let of_lens = joint.covariance.fixed_view::<2, 2>(LENS_AT, LENS_AT);
        let along = Vector2::new(camera.intrinsics.fx.recip(), -camera.intrinsics.fy.recip());
        Some(along.dot(&(of_lens * along)).max(0.0).sqrt())
    }

    /// The errors of the robot's arm, where they are known and views left out do not contradict them.
    pub fn arm(&self) -> Option<&ArmFit> {
        self.joint.as_ref()?.arm.as_ref().filter(|arm| !arm.contradicted)
    }

    /// Covariance of the hand-eye transform, right perturbation `[t; r]`, m and rad; `None` for a closed form.
    pub fn hand_eye_covariance(&self) -> Option<&Matrix6<f64>> {
        self.link_covariances.as_ref().map(|links| &links.hand_eye)
    }

    /// Error of a measured point where the camera saw the target by the noise alone, 95 %, metres: the basis of a stated error.
    pub(crate) fn modelled_error_95_m(&self) -> Option<f64> {
        self.modelled_error_95_at(&self.joint.as_ref()?.reference_point)
    }

    /// The same at any `point`, camera coordinates in metres.
    pub(crate) fn modelled_error_95_at(&self, point: &Point3<f64>) -> Option<f64> {
        Some(quality::tip_error_95_at(self.hand_eye_covariance()?, self.joint.as_ref()?.small_sample, point))
    }
}

/// Covariances of the rigid links, right perturbations `[t; r]`, m and rad.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LinkCovariances {
    /// Covariance of the camera on its mount.
    pub hand_eye: Matrix6<f64>,
    /// Covariance of the target on its anchor.
    pub target: Matrix6<f64>,
}

/// The camera of a calibration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CalibratedCamera {
    /// Its lens.
    pub intrinsics: Intrinsics,
    /// Whether the intrinsics were given and kept.
    pub fixed: bool,
    /// Standard deviations of fx, fy, cx, cy in pixels, when they were estimated.
    pub sigma_px: Option<[f64; 4]>,
}

/// How well the corners alone determine an estimated camera.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct CameraFit {
    /// Standard deviations of fx, fy, cx, cy in pixels, see [`Stated`](intrinsics::Stated); `None` where there are no more
    /// residuals than unknowns.
    pub sigma_px: Option<[f64; 4]>,
    /// Standard deviation of `ln(fx / fy)`; `None` in the same case.
    pub aspect_sigma: Option<f64>,
    /// Noise of a corner per axis, pixels; `None` in the same case.
    pub noise_px: Option<f64>,
    /// Factor by which standard deviations are larger than with independent corner errors, because the views scatter
    /// more; smaller than 1 where they happen to scatter less.
    pub times: f64,
    /// Degrees of freedom that the standard deviation rests on.
    pub degrees_of_freedom: f64,
    /// The target where the corners show that it is bent.
    pub shape: Option<ShapeEstimate>,
}

/// Quality of the poses by an estimate from poses of the target alone.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct PoseFit {
    /// Standard deviation between robot and target poses per axis, translation, metres.
    pub sigma_m: f64,
    /// The same for rotation, radians.
    pub sigma_rad: f64,
    /// The true length of their translations over the stated one, as the scale of the target; `None` when it is taken as
    /// exact.
    pub shape: Option<ShapeEstimate>,
}

impl CameraFit {
    fn of(found: &intrinsics::Found) -> Self {
        let stated = found.stated;
        let shape = found.shape;
        Self {
            sigma_px: Some(stated.pinhole_sigma_px).filter(|sigma| sigma.iter().all(|s| s.is_finite())),
            aspect_sigma: Some(stated.aspect_sigma).filter(|sigma| sigma.is_finite()),
            noise_px: Some(found.sigma).filter(|sigma| sigma.is_finite()),
            times: stated.ratio.sqrt(),
            degrees_of_freedom: stated.degrees_of_freedom,
            shape: stated.warp_sigma_m.map(|sigma| ShapeEstimate {
                shape,
                warp_sigma_m: Some(sigma),
                scale_sigma: None,
            }),
        }
    }
}

/// Results of the joint estimate beyond the links and the camera.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct JointFit {
    /// What was estimated in addition to the links.
    pub free: Free,
    /// Covariance of all that predictions share, as in
    /// [`JointSolution::covariance`](crate::handeye::joint::JointSolution::covariance).
    pub covariance: DMatrix<f64>,
    /// Noise levels.
    pub noise: Noise,
    /// Weights of corners relative to each other: [`Noise::corner_px`] is that of a corner with a typical stated covariance.
    /// `None` where all are equal.
    pub weights: Option<CornerWeights>,
    /// How the error of the hand-eye transform is distributed in units of its covariance.
    pub small_sample: SmallSample,
    /// Whether the covariances are true to the data, and by how much they were widened.
    pub widening: Overdispersion,
    /// Where the expected error is stated: where the camera saw the target, camera coordinates, metres.
    pub reference_point: Point3<f64>,
    /// That error by number of views, by the noise alone.
    pub error_curve: ErrorCurve,
    /// RMS of 2-D corner residuals on views held out of the fit, each predicted from its reported robot pose, pixels;
    /// `None` with too few views to leave some out.
    pub heldout_rms_px: Option<f64>,
    /// The same by the two links alone, without the robot's field; the same number where there is none.
    pub heldout_links_rms_px: Option<f64>,
    /// Pose-dependent errors of the robot, where the data show them.
    pub field: Option<PoseDependentError>,
    /// Print errors of the target's points, where the data show them; residuals include them.
    pub print: Option<PrintErrors>,
    /// Residual distortion of the lens, where the data show it; residuals include it.
    pub residual_distortion: Option<ShownDistortion>,
    /// What [`heldout_rms_px`](Self::heldout_rms_px) should be if the model and its noise levels are true, pixels.
    pub expected_heldout_rms_px: f64,
    /// By how much the robot's noise moves a corner, RMS of the 2-D distance in pixels; the part that a fit cannot
    /// follow stays in the answer.
    pub robot_effect_px: f64,
    /// Prior knowledge of the lens that was used, where it is neither exact nor none.
    pub known_lens: Option<KnownLens>,
    /// The stated accuracy of the lens, where the views contradict it: the lens is estimated from them alone.
    pub refuted_lens: Option<RefutedLens>,
    /// The expected error (95 %) at the point where it is stated if a lens that was taken as exact were only known to half a pixel,
    /// metres; `None` where the lens is estimated.
    pub error_at_half_a_pixel_95_m: Option<f64>,
    /// The shape of the target when it was estimated.
    pub shape: Option<ShapeEstimate>,
    /// Its size by the robot's motion; `None` where that does not determine it.
    pub size: Option<TargetSize>,
    /// The errors of the robot's arm and the transforms that belong to them; `None` where its joints are not known.
    pub arm: Option<ArmFit>,
    /// Result of an attempt to use the depths of the views; `None` when there was none.
    pub depths: Option<JointDepths>,
}

impl JointFit {
    /// The size of the target where the robot's field leaves it open whether it is the stated one.
    pub fn open_size(&self) -> Option<&TargetSize> {
        self.field.as_ref()?;
        self.size.as_ref().filter(|size| !self.free.scale && !size.is_determined())
    }
}

/// Result of one closed form.
#[derive(Debug, Clone, PartialEq)]
pub struct MethodResult {
    /// Its name on the command line.
    pub name: &'static str,
    /// Its answer, or why it has none.
    pub outcome: Result<ClosedFormSolution, HandEyeError>,
}

/// Result for one view.
#[derive(Debug, Clone, PartialEq)]
pub struct ViewResult {
    /// Its name in the observations.
    pub name: String,
    /// How it was used.
    pub status: ViewStatus,
    /// RMS of its 2-D corner residuals, pixels.
    pub rms_px: Option<f64>,
    /// How far the answer moves without it, metres at the reference point.
    pub influence_m: Option<f64>,
    /// Length of the correction that the joint estimate gave its reported tip position, metres.
    pub correction_m: Option<f64>,
    /// Angle of the correction of its reported tip orientation, radians.
    pub correction_rad: Option<f64>,
    /// Residuals of its corners, in the order observed. With a joint estimate they are by the corrected robot pose,
    /// with a closed form by the bare chain, without a robot by the target's own pose. Empty where no residual is
    /// known: no target, excluded, poses alone, or a chain that puts a corner behind the camera.
    pub residuals: Vec<CornerResidual>,
    /// The target's pose as fitted, by the same chain as the residuals.
    pub camera_from_target: Option<Pose<Camera, Target>>,
    /// How far the view is from what the others expect of it; `None` for a closed form.
    pub distance: Option<Distance>,
    /// Corners of it that were left out as outliers, by their index.
    pub rejected_corners: Vec<usize>,
    /// By how many quarter turns its target was numbered from another corner than detected, to agree with the others.
    pub quarter_turns: usize,
}

impl ViewResult {
    /// A view without any results yet.
    fn new(view: &ObservedView, status: ViewStatus) -> Self {
        Self {
            name: view.name.clone(),
            status: if view.in_fit { status } else { ViewStatus::Excluded },
            rms_px: None,
            influence_m: None,
            correction_m: None,
            correction_rad: None,
            residuals: Vec::new(),
            camera_from_target: None,
            distance: None,
            rejected_corners: Vec::new(),
            quarter_turns: 0,
        }
    }
}

/// One corner and how well the model explains it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CornerResidual {
    /// Which point of the target.
    pub index: usize,
    /// Where it was measured, pixels.
    pub px: Vector2<f64>,
    /// Measured minus predicted, pixels.
    pub residual_px: Vector2<f64>,
}

/// How a view was used.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ViewStatus {
    /// It took part.
    Used,
    /// The caller left it out.
    Excluded,
    /// It does not fit the others and was left out as an outlier; it takes part again with [`Options::keep_outliers`].
    Outlier,
    /// The target was not found in it.
    NoTarget,
}

/// Fits hand-eye and camera to observations. Whether the data agree with the model is not examined:
/// [`diagnose::calibrate`] does that as well.
///
/// `work` is a `&CancelToken`, or a [`Work`] to follow the progress too.
///
/// # Needs
/// Three views with the target in sight; for a hand-eye, robot rotations about two axes.
///
/// # Many views
/// Work that grows faster than the number of views is done on a choice of them, the same every time. Of more than
/// [`subset::MOST_VIEWS`] views only that many go into the closed forms, and the fits that leave views out keep the noise
/// levels of the whole. The intrinsics and the joint estimate take all views.
///
/// # Errors
/// [`CalibrateError`] states what is missing and what to do; [`HandEyeError::Cancelled`] inside it when `work` was.
pub fn fit<'a>(observations: &Observations, method: Method, work: impl Into<Work<'a>>) -> Result<Fit, CalibrateError> {
    fit_with(observations, method, Options::default(), work)
}

/// As [`fit`], with options.
///
/// # Errors
/// As [`fit`].
pub fn fit_with<'a>(
    observations: &Observations,
    method: Method,
    options: Options,
    work: impl Into<Work<'a>>,
) -> Result<Fit, CalibrateError> {
    let work = work.into();
    let used = || observations.views.iter().filter(|v| v.in_fit);
    let only_poses = used().all(|v| v.corners.is_none()) && used().any(|v| v.camera_from_target.is_some());
    if only_poses {
        pairs::calibrate(observations, method, options, &work)
    } else {
        corners::calibrate(observations, method, options, &work)
    }
}

/// An error about a robot that never turned is more useful than one about a singular matrix. Works on the same choice
/// of views as [`closed_forms`].
///
/// # Errors
/// Those of [`motion::analyse`], or the partial result that turns about one axis still determine.
fn check_motion(mode: Mode, pairs: &[PosePair]) -> Result<(), CalibrateError> {
    let poses: Vec<_> = pairs.iter().map(|pair| pair.anchor_from_mount).collect();
    let Err(error) = motion::analyse(&poses) else { return Ok(()) };
    let partial = match error {
        HandEyeError::ParallelAxes { axis, .. } => one_axis::solve(mode, pairs, axis.into()),
        _ => None,
    };
    Err(partial.map_or_else(|| error.into(), |partial| CalibrateError::OneAxis(Box::new(partial))))
}

/// Runs every closed form, on [`subset::MOST_VIEWS`] views at most.
fn closed_forms(pairs: &[PosePair], work: &Work<'_>) -> Result<Vec<MethodResult>, HandEyeError> {
    let chosen: Vec<PosePair> = subset::spread(pairs.len(), subset::MOST_VIEWS).into_iter().map(|i| pairs[i]).collect();
    let methods = closed_form::all();
    let mut results = Vec::with_capacity(methods.len());
    for (done, method) in methods.iter().enumerate() {
        if work.is_cancelled() {
            return Err(HandEyeError::Cancelled);
        }
        work.report(Stage::ClosedForms, done, methods.len());
        results.push(MethodResult { name: method.name(), outcome: method.solve(&chosen) });
    }
    Ok(results)
}

/// The answer of one closed form, or its error.
fn chosen(methods: &[MethodResult], name: &str) -> Result<ClosedFormSolution, HandEyeError> {
    methods.iter().find(|m| m.name == name).map_or_else(
        || Err(HandEyeError::NoSolution { method: "closed form", views: 0, reason: "no method of that name" }),
        |m| m.outcome.clone(),
    )
}

#[cfg(test)]
mod tests;

#[cfg(test)]
#[path = "depths_tests.rs"]
mod depths_tests;
