//! Why a result was not exported.

use std::path::PathBuf;

use handeye_result::ResultProblem;

/// Why a result was not exported.
#[derive(Debug, thiserror::Error, handeye_wording::Localized)]
#[non_exhaustive]
pub enum ExportError {
    /// No format of that name.
    #[error("unknown export format {name:?}: choose from {known}")]
    UnknownFormat {
        /// The requested name.
        name: String,
        /// The names there are.
        known: String,
    },
    /// A result with intrinsics alone, for a format with a transform.
    #[error(
        "{format} is about a hand-eye transform, and this result has none: export json, ros_camera_info or another \
         format of the camera alone, or calibrate with robot poses"
    )]
    NeedsHandEye {
        /// The export format, as the command line names it.
        format: &'static str,
    },
    /// A result without the place of the target, for a format that has it.
    #[error(
        "{format} is about the place of the target too, and this result has none: export ros_tf or another format of \
         the hand-eye alone, or calibrate again"
    )]
    NeedsTarget {
        /// The export format, as the command line names it.
        format: &'static str,
    },
    /// A result of pose pairs, for a format with a camera.
    #[error(
        "{format} is about a camera's intrinsics, and this result has none: export json, easy_handeye2 or another \
         format of the hand-eye alone, or calibrate from images"
    )]
    NeedsIntrinsics {
        /// The export format, as the command line names it.
        format: &'static str,
    },
    /// A lens model that the format cannot hold. Nothing is truncated: the pixels would no longer be those of the lens.
    #[error(
        "{format} cannot hold this {model} lens: it has {holds}. Export opencv_yaml or ros_camera_info, which hold \
         every model, or calibrate with {instead} under [camera] in dataset.toml"
    )]
    NeedsModel {
        /// The export format, as the command line names it.
        format: &'static str,
        /// The lens model of the result.
        model: &'static str,
        /// What the format has instead.
        holds: &'static str,
        /// What to put into `dataset.toml`.
        instead: &'static str,
    },
    /// A result without the errors of an arm, for a format about the arm.
    #[error(
        "{format} is about the robot's arm, and this result knows no errors of it: calibrate with the arm ([robot.arm] in dataset.toml, \
         or a cell that says which it is) and joint values in every row, or export urdf or another format of the hand-eye"
    )]
    NeedsArm {
        /// The export format, as the command line names it.
        format: &'static str,
    },
    /// An arm that held-out views contradict.
    #[error(
        "{format} is about the corrected arm, and views left out of this calibration are predicted worse by it than by the arm as its \
         controller counts: capture more views and calibrate again, or export urdf or another format of the hand-eye"
    )]
    ArmContradicted {
        /// The export format, as the command line names it.
        format: &'static str,
    },
    /// An arm that the format cannot hold.
    #[error(
        "{format} cannot hold this arm: {problem}. Export arm_urdf or dh_table, which hold every arm of revolute joints"
    )]
    OtherArm {
        /// The export format, as the command line names it.
        format: &'static str,
        /// The reason.
        problem: &'static str,
    },
    /// No view has a robot pose, for a format about the camera's pose in every image.
    #[error(
        "{format} has the camera's pose of every image, and no robot poses are given: export from the session or \
         dataset folder itself, with its dataset.toml and pose table"
    )]
    NeedsViews {
        /// The export format, as the command line names it.
        format: &'static str,
    },
    /// A camera that does not move, for a format about the camera's pose in every image.
    #[error(
        "{format} has a moving camera in a world that stands still; the camera of an eye-to-hand calibration stands \
         still, and all images would have one pose. Export ros_tf or another format of a single transform"
    )]
    NeedsMovingCamera {
        /// The export format, as the command line names it.
        format: &'static str,
    },
    /// A view that the format cannot hold.
    #[error("{format} cannot hold the view {name:?}: {problem}")]
    BadView {
        /// The export format, as the command line names it.
        format: &'static str,
        /// The view.
        name: String,
        /// What is wrong with the name, and what to do.
        problem: &'static str,
    },
    /// A name that some format cannot hold.
    #[error("{what} {name:?} cannot be used as a name: letters, digits and _ - . / are allowed")]
    BadName {
        /// The name.
        what: &'static str,
        /// The requested name.
        name: String,
    },
    /// Two frames with one name.
    #[error("{first} and {second} are both {name:?}: give every frame its own name")]
    SameFrame {
        /// One frame.
        first: &'static str,
        /// The other.
        second: &'static str,
        /// Their name.
        name: String,
    },
    /// The stated pose of the optical frame is invalid.
    #[error(
        "the optical frame in the camera link, {translation_m:?} m and {rotation_xyzw:?} xyzw, is not a pose: it needs \
         finite numbers and a unit quaternion"
    )]
    BadCameraLink {
        /// Origin of the optical frame in the camera link, metres.
        translation_m: [f64; 3],
        /// Its rotation, x, y, z, w.
        rotation_xyzw: [f64; 4],
    },
    /// A result that must not be.
    #[error("the result cannot be exported: {0}")]
    BadResult(ResultProblem),
    /// The file system refuses.
    #[error("{file}: cannot be written: {problem}", file = file.display())]
    Io {
        /// The file or folder.
        file: PathBuf,
        /// The error of the operating system.
        problem: String,
    },
    /// The file differs from the result: a defect of this program.
    #[error("{file}: reads back differently: {difference}; please report this", file = file.display())]
    ReadBack {
        /// The file that was written.
        file: PathBuf,
        /// The difference.
        difference: String,
    },
}

impl ExportError {
    /// Whether the input is at fault and not this machine or program: exit code 2.
    pub fn is_bad_input(&self) -> bool {
        !matches!(self, Self::Io { .. } | Self::ReadBack { .. })
    }
}
