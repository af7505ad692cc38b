//! Commands of an arm whose errors a calibration found.

use handeye_estimate::corrected_arm::{Command, CorrectedArm as Corrected};
use handeye_geometry::frames::{Base, Pose, Tip};
use handeye_result::{ArmEstimate, CalibrationResult};
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::error::Failure;
use crate::numbers::{OF_MATRIX, bytes_of, doubles, isometry, of_pose};

/// Rows of joint values and of 4 × 4 matrices, and an error for each in metres.
type CommandBytes<'py> = (Bound<'py, PyBytes>, Bound<'py, PyBytes>, Bound<'py, PyBytes>);

/// The text of a result file, checked, with every key that there is.
#[pyfunction]
pub fn read_result(path: std::path::PathBuf) -> Result<String, Failure> {
    let result = CalibrationResult::read(&path).map_err(Failure::input)?;
    result.to_json().map_err(Failure::input)
}

/// The arm of a result.
#[pyclass(frozen, module = "handeye._handeye")]
pub struct CorrectedArm {
    corrected: Corrected,
}

#[pymethods]
impl CorrectedArm {
    /// From the JSON of `arm` in a result.
    #[new]
    fn new(arm: &str) -> Result<Self, Failure> {
        let arm: ArmEstimate = serde_json::from_str(arm).map_err(Failure::input)?;
        Ok(Self { corrected: arm.corrected_arm().map_err(Failure::input)? })
    }

    /// Number of joints.
    #[getter]
    fn joint_count(&self) -> usize {
        self.corrected.arm.joint_count()
    }

    /// Commands for each wanted pose, near the joint values of its row; near those of the previous row where there are none.
    /// `names` are the names of the rows in messages.
    fn commands<'py>(
        &self,
        py: Python<'py>,
        wanted: &[u8],
        near: Option<&[u8]>,
        names: Vec<String>,
    ) -> Result<CommandBytes<'py>, Failure> {
        let near = near.map(doubles).unwrap_or_default();
        let wanted = wanted_poses(wanted, &names)?;
        let found = py.detach(|| self.commands_for(&wanted, &near, &names))?;
        Ok((
            bytes_of(py, found.iter().flat_map(|command| command.joints_rad.iter().copied())),
            bytes_of(py, found.iter().flat_map(|command| of_pose(&command.base_from_tip))),
            bytes_of(py, found.iter().map(|command| command.error_95_m)),
        ))
    }

    /// True tip pose for each row of joint values, and its 95 % error.
    fn actual<'py>(
        &self,
        py: Python<'py>,
        joints: &[u8],
        names: Vec<String>,
    ) -> Result<(Bound<'py, PyBytes>, Bound<'py, PyBytes>), Failure> {
        let (mut poses, mut errors) = (Vec::new(), Vec::new());
        for (joints_rad, name) in doubles(joints).chunks(self.joint_count()).zip(&names) {
            let at = |error| Failure::Input(format!("{name}: {error}"));
            poses.extend(of_pose(&self.corrected.actual(joints_rad).map_err(at)?));
            errors.push(self.corrected.error_95_m(joints_rad).map_err(at)?);
        }
        Ok((bytes_of(py, poses), bytes_of(py, errors)))
    }
}

impl CorrectedArm {
    fn commands_for(
        &self,
        wanted: &[Pose<Base, Tip>],
        near: &[f64],
        names: &[String],
    ) -> Result<Vec<Command>, Failure> {
        let mut start = self.corrected.middle_rad();
        let mut near = near.chunks(self.joint_count());
        let mut found = Vec::with_capacity(wanted.len());
        for (wanted, name) in wanted.iter().zip(names) {
            let from = near.next().unwrap_or(&start);
            let command = self.corrected.command(wanted, from);
            let command = command.map_err(|error| Failure::Input(format!("{name}: {error}")))?;
            start.clone_from(&command.joints_rad);
            found.push(command);
        }
        Ok(found)
    }
}

fn wanted_poses(bytes: &[u8], names: &[String]) -> Result<Vec<Pose<Base, Tip>>, Failure> {
    let numbers = doubles(bytes);
    let (matrices, _none) = numbers.as_chunks::<OF_MATRIX>();
    let pose = |(matrix, name): (&[f64; OF_MATRIX], &String)| {
        let pose = isometry(matrix).map_err(|why| Failure::Input(format!("{name}: {why}")))?;
        Ok(Pose::from_isometry(pose))
    };
    matrices.iter().zip(names).map(pose).collect()
}
