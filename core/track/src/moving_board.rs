//! A calibrated camera on an arm that watches a moving board.

use image::GrayImage;
use nalgebra::{Isometry3, UnitQuaternion, Vector3};

use crate::{Image, MotionModel, Setup, Tracker, Update};
use handeye_estimate::handeye::HandEye;
use handeye_estimate::verify::Predictor;
use handeye_geometry::depth::DepthImage;
use handeye_geometry::frames::{Base, Camera, Pose, Target, Tip};
use handeye_geometry::testing::BOARD;
pub use handeye_simulate::moving_board::{Cover, FAR_M, Stage, centre, lens};

/// Seconds between images.
pub(crate) const PERIOD_S: f64 = 1.0 / 30.0;

/// The tip half a metre above the table, camera down, a little askew.
pub fn base_from_tip() -> Pose<Base, Tip> {
    let rotation = UnitQuaternion::from_euler_angles(std::f64::consts::PI - 0.06, 0.04, 0.3);
    Pose::from_isometry(Isometry3::from_parts(Vector3::new(0.45, 0.05, 0.55).into(), rotation))
}

pub fn tip_from_camera() -> Pose<Tip, Camera> {
    let rotation = UnitQuaternion::from_euler_angles(0.02, -0.03, 0.7);
    Pose::from_isometry(Isometry3::from_parts(Vector3::new(0.03, -0.05, 0.06).into(), rotation))
}

pub fn calibrated() -> Predictor {
    let (tip_from_camera, base_from_target) = (tip_from_camera(), Pose::identity());
    Predictor::known(HandEye::EyeInHand { tip_from_camera, base_from_target }, lens())
}

pub fn setup() -> Setup {
    Setup { target: BOARD, calibrated: calibrated(), motion: MotionModel::default() }
}

/// A board whose centre is at `centre` (relative to the middle of the camera's view) and which is tilted by `tilt`.
pub fn board_at(shift: Vector3<f64>, tilt: Vector3<f64>) -> Pose<Base, Target> {
    let rotation = UnitQuaternion::from_scaled_axis(Vector3::new(0.25, -0.2, 0.1) + tilt);
    let at = Vector3::new(0.0, 0.0, 0.45) + shift;
    let camera_from_target =
        Isometry3::from_parts(at.into(), rotation) * nalgebra::Translation3::from(-centre().coords);
    base_from_tip() * tip_from_camera() * Pose::from_isometry(camera_from_target)
}

/// A tracker, the stage it watches and the time.
pub struct Watch {
    pub stage: Stage,
    pub tracker: Tracker,
    pub time_s: f64,
    pub seed: u64,
    pub base_from_tip: Pose<Base, Tip>,
}

impl Watch {
    pub(crate) fn new() -> Self {
        Self::with(setup())
    }

    pub(crate) fn with(setup: Setup) -> Self {
        let tracker = Tracker::new(setup).expect("a good set-up");
        Self { stage: Stage::new(), tracker, time_s: 0.0, seed: 1, base_from_tip: base_from_tip() }
    }

    pub(crate) fn camera_from_target(&self, base_from_target: &Pose<Base, Target>) -> Isometry3<f64> {
        let base_from_camera = self.tracker.setup().calibrated.base_from_camera(&self.base_from_tip);
        *(base_from_camera.inverse() * *base_from_target).isometry()
    }

    /// The next image, with the board at this pose or without a board.
    pub(crate) fn see(&mut self, board: Option<&Pose<Base, Target>>) -> Update {
        let board = board.map(|b| self.camera_from_target(b));
        let grey = self.stage.image(board.as_ref(), self.seed);
        self.show(&grey, None)
    }

    pub(crate) fn show(&mut self, grey: &GrayImage, depth: Option<&DepthImage>) -> Update {
        self.time_s += PERIOD_S;
        self.seed += 1;
        let (time_s, base_from_tip) = (self.time_s, self.base_from_tip);
        let image = Image { time_s, grey, depth, far_plane_m: FAR_M, base_from_tip };
        self.tracker.see(&image).expect("a good image")
    }
}

/// Distance of the centres \[m\] and angle between the axes \[rad\].
pub fn error(estimate: &Pose<Base, Target>, truth: &Pose<Base, Target>) -> (f64, f64) {
    let at = |pose: &Pose<Base, Target>| pose.isometry() * centre();
    ((at(estimate) - at(truth)).norm(), estimate.rotation().angle_to(&truth.rotation()))
}

pub fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64).sqrt()
}
