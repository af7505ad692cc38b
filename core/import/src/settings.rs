//! Choices of the user with `--set`.

use super::conventions::{AngleUnit, Direction, LengthUnit, RotationForm};
use super::error::ImportError;
use handeye_estimate::handeye::Mode;
use handeye_wording::Text;
use handeye_wording::text;

/// The keys of `--set` and their values, for `--help`.
pub const KEYS: &str = "  mode=eye_in_hand|eye_to_hand
          where the camera is mounted
  length_unit=m|mm|cm
          of the robot's positions
  angle_unit=rad|deg
          of its angles
  rotation=NAME
          quaternion_xyzw, quaternion_wxyz, rotation_vector, matrix, rpy,
          kuka_abc, fanuc_wpr, euler_xyz (fixed axes) or euler_XYZ (moving
          axes) with any axes, or euler_zyx_321: a product from left to right,
          and which number turns about which
  pose=base_from_tip|tip_from_base
          which way the robot's poses map
  pairing=RULE
          which image belongs to which pose, one of the rules that are listed
  images=NAME
          which images, where there are several kinds
  poses=NAME
          which series of poses is the robot's
  target_poses=NAME
          which is the target's, where there are no images
  target_pose=camera_from_target|target_from_camera
          which way the target's poses map
  target_length_unit=m|mm|cm
          of the target's poses
  target_rotation=NAME
          of the target's poses
  camera=FILE|none
          which camera is taken as known
  image_size=WIDTHxHEIGHT
          of the images that recorded corners are from, in pixels, where no
          file says it
  joint_unit=rad|deg
          takes over the joint values that are recorded with the poses
  clock_offset=SECONDS
          what is added to stamps of images to have them by the robot's clock,
          roughly, where the clocks of a bag are apart by more than 2 s
  arm=NAME|FILE.urdf[,base=LINK][,tip=LINK]
          makes poses of joint values by this chain: ur3, ur5, ur10, ur3e,
          ur5e, ur10e, ur16e, ur5_coppeliasim or one in a URDF file";

/// Choices that were made; `None` where all are tried.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Settings {
    /// Where the camera is mounted.
    pub mode: Option<Mode>,
    /// Length unit of the robot's poses.
    pub length: Option<LengthUnit>,
    /// Angle unit of the robot's poses.
    pub angle: Option<AngleUnit>,
    /// Rotation convention of the robot's poses.
    pub rotation: Option<RotationForm>,
    /// Direction of the robot's poses.
    pub direction: Option<Direction>,
    /// The pairing, by its rule.
    pub pairing: Option<String>,
    /// The stream of images, by its name.
    pub images: Option<String>,
    /// The series of the robot, by its name.
    pub poses: Option<String>,
    /// The series of the target, by its name.
    pub target_poses: Option<String>,
    /// Direction of the target's poses.
    pub target_direction: Option<Direction>,
    /// Length unit of the target's poses.
    pub target_length: Option<LengthUnit>,
    /// Rotation convention of the target's poses.
    pub target_rotation: Option<RotationForm>,
    /// The camera, by its file; `none` for no camera.
    pub camera: Option<String>,
    /// Width and height in pixels of the images that recorded corners are from.
    pub image_size: Option<(u32, u32)>,
    /// Unit of the joint values, which are only used when it is given.
    pub joint_unit: Option<AngleUnit>,
    /// About what is added to stamps of images to have them by the robot's clock, seconds.
    pub clock_offset_s: Option<f64>,
    /// The arm that converts joint values to poses, in the notation of [`with_arm`](super::with_arm).
    pub arm: Option<String>,
}

impl Settings {
    /// Takes `KEY=VALUE`.
    ///
    /// # Errors
    /// [`ImportError::BadChoice`] for an unknown key or an invalid value.
    pub fn set(&mut self, assignment: &str) -> Result<(), ImportError> {
        let (key, value) = assignment.split_once('=').unwrap_or((assignment, ""));
        let bad = |choices: Text| ImportError::BadChoice { key: key.to_owned(), value: value.to_owned(), choices };
        let length =
            || LengthUnit::ALL.into_iter().find(|unit| unit.name() == value).ok_or_else(|| bad(text!("m, mm or cm")));
        let angle =
            || AngleUnit::ALL.into_iter().find(|unit| unit.name() == value).ok_or_else(|| bad(text!("rad or deg")));
        let rotation = || {
            RotationForm::by_name(value).ok_or_else(|| {
                bad(text!(
                    "quaternion_xyzw, quaternion_wxyz, rotation_vector, matrix, rpy, kuka_abc, fanuc_wpr, euler_xyz, euler_XYZ \
                     or euler_zyx_321"
                ))
            })
        };
        let text = || if value.is_empty() { Err(bad(text!("a name"))) } else { Ok(value.to_owned()) };
        match key {
            "mode" => {
                self.mode = Some(match value {
                    "eye_in_hand" => Mode::EyeInHand,
                    "eye_to_hand" => Mode::EyeToHand,
                    _ => return Err(bad(text!("eye_in_hand or eye_to_hand"))),
                });
            }
            "length_unit" => self.length = Some(length()?),
            "target_length_unit" => self.target_length = Some(length()?),
            "angle_unit" => self.angle = Some(angle()?),
            "joint_unit" => self.joint_unit = Some(angle()?),
            "rotation" => self.rotation = Some(rotation()?),
            "target_rotation" => self.target_rotation = Some(rotation()?),
            "pose" => {
                self.direction = Some(match value {
                    "base_from_tip" => Direction::Forward,
                    "tip_from_base" => Direction::Inverse,
                    _ => return Err(bad(text!("base_from_tip or tip_from_base"))),
                });
            }
            "target_pose" => {
                self.target_direction = Some(match value {
                    "camera_from_target" => Direction::Forward,
                    "target_from_camera" => Direction::Inverse,
                    _ => return Err(bad(text!("camera_from_target or target_from_camera"))),
                });
            }
            "pairing" => self.pairing = Some(text()?),
            "images" => self.images = Some(text()?),
            "poses" => self.poses = Some(text()?),
            "target_poses" => self.target_poses = Some(text()?),
            "camera" => self.camera = Some(text()?),
            "image_size" => {
                let side = |text: &str| text.trim().parse().ok().filter(|px: &u32| (1..100_000).contains(px));
                let size = value.split_once(['x', 'X', '×']).and_then(|(width, height)| side(width).zip(side(height)));
                self.image_size = Some(size.ok_or_else(|| bad(text!("width and height in pixels, such as 640x480")))?);
            }
            "clock_offset" => {
                let seconds = value.parse().ok().filter(|seconds: &f64| seconds.is_finite());
                self.clock_offset_s = Some(seconds.ok_or_else(|| bad(text!("seconds, such as -12.5")))?);
            }
            "arm" => self.arm = Some(text()?),
            _ => {
                return Err(ImportError::BadChoice {
                    key: "a key of --set".into(),
                    value: key.to_owned(),
                    choices: text!(
                        "mode, length_unit, angle_unit, rotation, pose, pairing, images, poses, target_poses, target_pose, \
                         target_length_unit, target_rotation, camera, image_size, joint_unit, clock_offset or arm"
                    ),
                });
            }
        }
        Ok(())
    }
}
