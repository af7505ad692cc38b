//! Streams of poses by two clocks.

use handeye_estimate::handeye::HandEyeError;
use handeye_geometry::frames::{Anchor, Base, Camera, Frame, Mount, Pose, Target, Tip};
use handeye_pairs::clock_offset::{self, ClockOffsetError};
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::background::run;
use crate::error::Failure;
use crate::numbers::{bytes_of, doubles, of_pose, poses};

type Stream<Dst, Src> = Vec<(f64, Pose<Dst, Src>)>;

fn stream<Dst: Frame, Src: Frame>(what: &str, stamps_s: &[u8], matrices: &[u8]) -> Result<Stream<Dst, Src>, Failure> {
    let stamps = doubles(stamps_s);
    let names: Vec<String> = (0..stamps.len()).map(|index| index.to_string()).collect();
    Ok(stamps.into_iter().zip(poses(what, matrices, &names)?).collect())
}

/// Offset to add to timestamps of the camera to convert them to the robot's clock, and its standard deviation, seconds.
#[pyfunction]
#[pyo3(name = "clock_offset")]
pub fn of_streams(
    py: Python<'_>,
    robot_stamps_s: &[u8],
    anchor_from_mount: &[u8],
    camera_stamps_s: &[u8],
    camera_from_target: &[u8],
    within_s: f64,
) -> Result<(f64, f64), Failure> {
    let robot = stream::<Anchor, Mount>("base_from_tip", robot_stamps_s, anchor_from_mount)?;
    let camera = stream::<Camera, Target>("camera_from_target", camera_stamps_s, camera_from_target)?;
    run(py, None, |work| match clock_offset::clock_offset(&robot, &camera, within_s, work.cancel) {
        Ok(found) => Ok((found.offset_s, found.sigma_s)),
        Err(ClockOffsetError::HandEye(error @ HandEyeError::Cancelled)) => Err(error.into()),
        Err(error @ (ClockOffsetError::TooFew { .. } | ClockOffsetError::NotRising { .. })) => {
            Err(Failure::input(error))
        }
        Err(error) => Err(Failure::NoAnswer(error.to_string())),
    })
}

/// The robot's poses at other times, and whether each is within its stream; the identity where it does not.
#[pyfunction]
pub fn poses_at<'py>(
    py: Python<'py>,
    times_s: &[u8],
    stamps_s: &[u8],
    base_from_tip: &[u8],
) -> Result<(Bound<'py, PyBytes>, Vec<bool>), Failure> {
    let robot = stream::<Base, Tip>("base_from_tip", stamps_s, base_from_tip)?;
    let found: Vec<Option<Pose<Base, Tip>>> =
        doubles(times_s).into_iter().map(|time_s| clock_offset::pose_at(&robot, time_s)).collect();
    let within = found.iter().map(Option::is_some).collect();
    let matrices = found.into_iter().flat_map(|pose| of_pose(&pose.unwrap_or_else(Pose::identity)));
    Ok((bytes_of(py, matrices), within))
}
