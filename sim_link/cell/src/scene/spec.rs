//! The contents of a scene file, with the defaults of the reference scene.

use handeye_geometry::camera::Distortion;
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use serde::{Deserialize, Serialize};

use super::arm::ArmSpec;
use handeye_arm::JointValues;
use handeye_motion::BoardMotionSpec;
use handeye_render::Sampling;

/// cos 45° = sin 45°, for quaternions of quarter and half turns.
const HALF_SQRT: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// A pose: where the origin is and how the axes are turned.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PoseSpec {
    /// Origin, metres.
    pub position_m: [f64; 3],
    /// Unit quaternion x, y, z, w; a length within a thousandth of one counts as rounding and is normalised.
    pub rotation_xyzw: [f64; 4],
}

impl Default for PoseSpec {
    fn default() -> Self {
        Self { position_m: [0.0; 3], rotation_xyzw: [0.0, 0.0, 0.0, 1.0] }
    }
}

impl PoseSpec {
    /// The pose as a transform.
    pub fn isometry(&self) -> Isometry3<f64> {
        let [x, y, z, w] = self.rotation_xyzw;
        Isometry3::from_parts(
            Translation3::from(self.position_m),
            UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z)),
        )
    }
}

/// How simulated time runs.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SimulationSpec {
    /// Length of one pass in simulated seconds.
    pub time_step_s: f64,
    /// Whether a pass takes as long as it simulates; otherwise passes follow each other as fast as they can.
    pub real_time: bool,
    /// Simulated seconds per real second, where time is real.
    pub speed_factor: f64,
}

impl Default for SimulationSpec {
    fn default() -> Self {
        Self { time_step_s: 0.05, real_time: true, speed_factor: 1.0 }
    }
}

/// What moves the joints of the arm.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum JointModeSpec {
    /// They are where they are put, as in the reference scene.
    #[default]
    Kinematic,
    /// Their controllers take them to their target positions, with a lag.
    Dynamic,
}

/// The arm. Joint values are degrees, those of a prismatic joint metres.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RobotSpec {
    /// Which arm it is.
    pub model: ArmSpec,
    /// Its name in the tree of objects: `/UR5` if absent, whatever arm it is.
    pub name: String,
    /// Pose of the arm frame (`/UR5`, of CoppeliaSim's model 14.65 mm above its mounting plane) in the world.
    pub arm: PoseSpec,
    /// Pose of the tip (`/UR5/Tip`) in the connection at the end of the arm.
    pub tip: PoseSpec,
    /// Joint values at the start, one for each joint.
    pub start_joints_deg: JointValues,
    /// What moves the joints.
    pub joint_mode: JointModeSpec,
    /// How far from its target a dynamic joint comes to rest, at most; another value at each target, as under load.
    pub rest_error_deg: f64,
    /// Smallest joint values; those that the arm comes with if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub min_joints_deg: Option<JointValues>,
    /// Largest joint values; those that the arm comes with if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_joints_deg: Option<JointValues>,
    /// How far from the same place the arm really stops each time: 1σ per axis, millimetres.
    pub repeatability_mm: f64,
    /// The same for rotation: 1σ per axis, degrees.
    pub repeatability_deg: f64,
    /// Constant difference between true and reported joint values: what a kinematic calibration would find. None if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub joint_offset_deg: Option<JointValues>,
    /// Errors of the links relative to those that the controller uses. Drawn once from the seed.
    pub arm_errors: ArmErrorsSpec,
}

/// Errors of an arm's links: standard deviations of what is drawn for each joint but the first.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ArmErrorsSpec {
    /// Direction of an axis, about either axis across it, and a joint's zero, degrees.
    pub angle_deg: f64,
    /// Position of an axis, along either axis across it, millimetres.
    pub length_mm: f64,
    /// Deflection of a joint under the largest torque that gravity can have on it, degrees.
    pub compliance_deg: f64,
}

impl ArmErrorsSpec {
    /// A usual arm whose controller uses the drawing's links. The factory calibrations of 17 arms of Universal Robots have
    /// medians of 0.03 to 0.17° and 0.03 to 0.4 mm a number.
    pub const NOMINAL: Self = Self { angle_deg: 0.07, length_mm: 0.25, compliance_deg: 0.02 };
    /// Links that are exactly those of the controller.
    pub const NONE: Self = Self { angle_deg: 0.0, length_mm: 0.0, compliance_deg: 0.0 };
}

impl Default for RobotSpec {
    fn default() -> Self {
        Self {
            model: ArmSpec::default(),
            name: "UR5".to_owned(),
            arm: PoseSpec { position_m: [0.0, 0.0, 0.025], ..PoseSpec::default() },
            tip: PoseSpec { position_m: [0.0, 0.0, 0.017], ..PoseSpec::default() },
            start_joints_deg: JointValues::from([0.0, 45.0, -60.0, 0.0, 90.0, 0.0]),
            joint_mode: JointModeSpec::Kinematic,
            rest_error_deg: 0.0,
            min_joints_deg: None,
            max_joints_deg: None,
            repeatability_mm: 0.0,
            repeatability_deg: 0.0,
            joint_offset_deg: None,
            arm_errors: ArmErrorsSpec::NONE,
        }
    }
}

/// The RGB-D camera on the tip. Colour and depth have the same pose and the same lens.
///
/// Its focal length is given either by `view_angle_deg` or by all of `fx`, `fy`, `cx`, `cy`; by neither, it is the
/// view angle of 57° of the reference scene.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CameraSpec {
    /// Image width in pixels.
    pub width: u32,
    /// Image height in pixels.
    pub height: u32,
    /// Full opening angle along the larger image side, degrees; principal point in the centre.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub view_angle_deg: Option<f64>,
    /// Focal length along x in pixels.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fx: Option<f64>,
    /// Focal length along y in pixels.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fy: Option<f64>,
    /// Principal point, column in pixels; (0, 0) is the centre of the top-left pixel.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cx: Option<f64>,
    /// Principal point, row in pixels.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cy: Option<f64>,
    /// Lens distortion: `model` and `coefficients` in OpenCV's order.
    pub distortion: Distortion,
    /// Depth of the nearest point that is seen, metres along the optical axis.
    pub near_m: f64,
    /// Depth that is reported where nothing is seen, metres.
    pub far_m: f64,
    /// Pose of the vision sensor (z forward, y up, x left) in the tip.
    pub sensor: PoseSpec,
    /// Random displacement of the camera on the tip: 1σ per axis, millimetres. Drawn once from the seed.
    pub random_offset_mm: f64,
    /// Random rotation of the camera on the tip: 1σ per axis, degrees. Drawn once from the seed.
    pub random_offset_deg: f64,
}

/// View angle of the reference scene's camera, a stock Kinect, in degrees.
pub(super) const REFERENCE_VIEW_ANGLE_DEG: f64 = 57.0;

impl Default for CameraSpec {
    fn default() -> Self {
        Self {
            width: 640,
            height: 480,
            view_angle_deg: None,
            fx: None,
            fy: None,
            cx: None,
            cy: None,
            distortion: Distortion::None,
            near_m: 0.01,
            far_m: 3.5,
            sensor: PoseSpec { position_m: [0.05, 0.0, 0.0], rotation_xyzw: [0.0, 0.0, -HALF_SQRT, HALF_SQRT] },
            random_offset_mm: 0.0,
            random_offset_deg: 0.0,
        }
    }
}

/// The printed chessboard.
///
/// It lies in the plane z = 0 of `plane`, printed on the side that z points to, its centre at the origin and its
/// columns along x. The first inner corner is the one at the smallest x and the largest y; the square between it and
/// the next corners is dark.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BoardSpec {
    /// Inner corners along x.
    pub columns: usize,
    /// Inner corners along y.
    pub rows: usize,
    /// Side of a square, metres.
    pub square_m: f64,
    /// Size of the white sheet, metres along x and y.
    pub paper_m: [f64; 2],
    /// Pose of the sheet (`/Plane`) in the world.
    pub plane: PoseSpec,
    /// Random displacement of the sheet: 1σ per axis, millimetres. Drawn once from the seed.
    pub random_offset_mm: f64,
    /// Random rotation of the sheet: 1σ per axis, degrees. Drawn once from the seed.
    pub random_offset_deg: f64,
    /// How the board moves from the start of the simulation on.
    pub motion: BoardMotionSpec,
    /// A single slip of the board; none by default.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub slip: Option<SlipSpec>,
    /// Displacements of its corners from the grid; none by default.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub print: Option<PrintSpec>,
}

/// A print that is not exact. Drawn once from the seed; the same in all views.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PrintSpec {
    /// Number of pixels of the sheet's picture along x and y: each line of the grid is between two of them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bitmap_px: Option<[u32; 2]>,
    /// Displacement of each corner by itself: 1σ per axis, millimetres.
    pub white_mm: f64,
    /// Displacement that changes smoothly over the print: 1σ per axis, millimetres. It has no part that a pose or a
    /// size of the board could take up.
    pub smooth_mm: f64,
}

/// A board that is knocked or sags: it moves once, unobserved.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SlipSpec {
    /// Number of the stop of the arm at which it has moved, counted from 1; the place at the start does not count.
    pub at_stop: u64,
    /// Displacement along x, y and z of the sheet, millimetres.
    pub by_mm: [f64; 3],
}

impl Default for BoardSpec {
    fn default() -> Self {
        Self {
            columns: 10,
            rows: 7,
            square_m: 0.015,
            paper_m: [0.20, 0.15],
            plane: PoseSpec { position_m: [-0.125, -0.4, 0.802], rotation_xyzw: [0.0, HALF_SQRT, HALF_SQRT, 0.0] },
            random_offset_mm: 0.0,
            random_offset_deg: 0.0,
            motion: BoardMotionSpec::default(),
            slip: None,
            print: None,
        }
    }
}

/// Imperfections of the colour image.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ImageSpec {
    /// `"area"`: a pixel is the mean over its area. `"centre"`: it is what its centre sees, so that edges are hard steps,
    /// as in CoppeliaSim.
    pub sampling: Sampling,
    /// Noise per pixel and channel: 1σ in grey levels of 255.
    pub noise_grey: f64,
    /// Blur of lens and pixel: σ of a Gaussian in pixels.
    pub blur_px: f64,
    /// Factor on the brightness before it is cut off at white. There is no gamma: grey levels are linear in light.
    pub exposure: f64,
}

impl Default for ImageSpec {
    fn default() -> Self {
        Self { sampling: Sampling::Area, noise_grey: 0.0, blur_px: 0.0, exposure: 1.0 }
    }
}

/// Imperfections of the depth image: noise with σ = `noise_mm` + `noise_mm_per_m2` · depth².
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DepthSpec {
    /// Constant part of the noise, millimetres.
    pub noise_mm: f64,
    /// Part that grows with the square of the distance, millimetres per square metre, as of a triangulating sensor.
    pub noise_mm_per_m2: f64,
    /// Depth that is added on slanted surfaces, in parts of what depth changes by from one pixel to the next: OpenGL's
    /// polygon offset. CoppeliaSim has 0.475.
    pub offset_px: f64,
    /// Depth reported where nothing is seen, metres; `far_m` of the camera if absent. CoppeliaSim reports 3.5000184 for a
    /// far plane of 3.5 m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub nothing_m: Option<f64>,
}

/// Light and background.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LightSpec {
    /// Direction towards the light, in the world; any length.
    pub direction: [f64; 3],
    /// Share of a surface's colour that is seen from any side.
    pub ambient: f64,
    /// Share that is added in proportion to the cosine to the light.
    pub diffuse: f64,
    /// Colour where nothing is, red, green, blue.
    pub background: [u8; 3],
}

impl Default for LightSpec {
    fn default() -> Self {
        Self { direction: [-0.3, 0.8, 0.6], ambient: 0.55, diffuse: 0.45, background: [182, 196, 214] }
    }
}

/// What the pose of a solid is relative to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RelativeTo {
    #[default]
    World,
    /// The sheet of the board; the solid goes where its random offset takes it.
    Plane,
}

/// A box.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SolidSpec {
    /// Name, for messages.
    pub name: String,
    /// Lengths of the edges along its x, y and z, metres.
    pub size_m: [f64; 3],
    /// Its centre, metres.
    pub position_m: [f64; 3],
    /// Its axes: unit quaternion x, y, z, w.
    #[serde(default = "no_rotation")]
    pub rotation_xyzw: [f64; 4],
    /// What position and rotation are relative to.
    #[serde(default)]
    pub relative_to: RelativeTo,
    /// Colour: red, green, blue.
    #[serde(default = "grey")]
    pub colour: [u8; 3],
}

fn no_rotation() -> [f64; 4] {
    PoseSpec::default().rotation_xyzw
}

fn grey() -> [u8; 3] {
    [160, 160, 160]
}

pub(super) fn reference_solids() -> Vec<SolidSpec> {
    let solid = |name: &str, size_m, position_m, colour| SolidSpec {
        name: name.to_owned(),
        size_m,
        position_m,
        rotation_xyzw: no_rotation(),
        relative_to: RelativeTo::World,
        colour,
    };
    vec![
        solid("floor", [5.0, 5.0, 0.1], [0.0, 0.0, -0.05], [176, 178, 180]),
        solid("mounting plate", [0.24, 0.24, 0.01], [0.0, 0.0, 0.005], [90, 92, 96]),
    ]
}
