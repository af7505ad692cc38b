//! One closed form on pose pairs, as quickly as it goes.

use handeye_estimate::handeye::PosePair;
use handeye_estimate::handeye::closed_form;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::error::Failure;
use crate::numbers::{bytes_of, of_pose, poses};

/// `mount_from_camera` and `anchor_from_target`, 4 × 4 each, by the method of that name.
#[pyfunction]
#[pyo3(name = "closed_form")]
pub fn by_name<'py>(
    py: Python<'py>,
    method: &str,
    anchor_from_mount: &[u8],
    camera_from_target: &[u8],
    names: Vec<String>,
) -> Result<(Bound<'py, PyBytes>, Bound<'py, PyBytes>), Failure> {
    let robot = poses("the robot pose", anchor_from_mount, &names)?;
    let target = poses("the target pose", camera_from_target, &names)?;
    let pairs = robot.into_iter().zip(target);
    let pairs: Vec<PosePair> = pairs
        .map(|(anchor_from_mount, camera_from_target)| PosePair { anchor_from_mount, camera_from_target })
        .collect();
    let form = closed_form::by_name(method).ok_or_else(|| Failure::Input(format!("no closed form {method:?}")))?;
    let found = py.detach(|| form.solve(&pairs))?;
    Ok((bytes_of(py, of_pose(&found.mount_from_camera)), bytes_of(py, of_pose(&found.anchor_from_target))))
}
