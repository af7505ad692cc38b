//! Tables of poses that a tip shall reach, and of joint values that a robot reports.

use std::io::Read;
use std::path::Path;

use nalgebra::{Isometry3, Quaternion, Translation3};

use super::DatasetError;
use super::error::DatasetProblem;
use super::joints::COLUMNS;
use super::poses::unit_quaternion;
use super::text::{Table, TextFile};
use handeye_geometry::frames::{Base, Pose, Tip};

/// Desired pose of a tip.
#[derive(Debug, Clone, PartialEq)]
pub struct WantedPose {
    /// Line in the table.
    pub line: usize,
    /// Desired pose in the base frame.
    pub base_from_tip: Pose<Base, Tip>,
    /// Joint values near which the arm should be, radians; `None` where the table does not state them.
    pub near_rad: Option<Vec<f64>>,
}

const POSE: [&str; 7] = ["x", "y", "z", "qx", "qy", "qz", "qw"];

/// A table as it was read.
pub struct CorrectTable(TextFile);

impl CorrectTable {
    /// Reads a file.
    ///
    /// # Errors
    /// [`DatasetError`] where it is not such a table, or not text.
    pub fn open(path: &Path) -> Result<Self, DatasetError> {
        let unnamed = || DatasetError::new(path, None, DatasetProblem::Unreadable("it is not a file".into()));
        let name = path.file_name().ok_or_else(unnamed)?;
        TextFile::read(path.parent().unwrap_or(Path::new("")), Path::new(name)).map(Self)
    }

    /// Reads what another program writes, to its end; `name` is what messages call it.
    ///
    /// # Errors
    /// [`DatasetError`] where it cannot be read, or is not text.
    pub fn of_reader(name: &Path, reader: impl Read) -> Result<Self, DatasetError> {
        TextFile::of_reader(name, reader).map(Self)
    }

    /// The poses of a table `x,y,z,qx,qy,qz,qw`, metres, of the tip in the base; `q1` and so on may follow, radians.
    ///
    /// # Errors
    /// [`DatasetError`] names file and row.
    pub fn wanted(&self, joints: usize) -> Result<Vec<WantedPose>, DatasetError> {
        let of_joints = &COLUMNS[..joints.min(COLUMNS.len())];
        let headers = [POSE.to_vec(), [&POSE[..], of_joints].concat()];
        let table = Table::parse(&self.0, &headers, "one row per pose that the tip shall reach is needed")?;
        let wanted = table.rows.iter().map(|row| {
            let [x, y, z, qx, qy, qz, qw] = table.numbers::<7>(row, 0)?;
            let rotation =
                unit_quaternion(Quaternion::new(qw, qx, qy, qz)).map_err(|problem| table.fail(row, problem))?;
            let near = (POSE.len()..table.column_count()).map(|column| table.number(row, column));
            let near = near.collect::<Result<Vec<_>, DatasetError>>()?;
            Ok(WantedPose {
                line: row.line,
                base_from_tip: Pose::from_isometry(Isometry3::from_parts(Translation3::new(x, y, z), rotation)),
                near_rad: Some(near).filter(|near| !near.is_empty()),
            })
        });
        wanted.collect()
    }

    /// The joint values of a table `q1,q2,…`, radians, with their line in it.
    ///
    /// # Errors
    /// [`DatasetError`] names file and row.
    pub fn joint_values(&self, joints: usize) -> Result<Vec<(usize, Vec<f64>)>, DatasetError> {
        let header = COLUMNS[..joints.min(COLUMNS.len())].to_vec();
        let table = Table::parse(&self.0, &[header], "one row of joint values per reported pose is needed")?;
        let values = table.rows.iter().map(|row| {
            let values = (0..table.column_count()).map(|column| table.number(row, column));
            Ok((row.line, values.collect::<Result<Vec<_>, DatasetError>>()?))
        });
        values.collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(text: &str) -> CorrectTable {
        CorrectTable::of_reader(Path::new("-"), text.as_bytes()).expect("text")
    }

    #[test]
    fn poses_are_read_with_and_without_joint_values_to_be_near() {
        let file = tempfile::NamedTempFile::new().expect("a file");
        std::fs::write(file.path(), "x,y,z,qx,qy,qz,qw\n0.4,0.1,0.2,0,0,0,1\n").expect("written");
        let read = CorrectTable::open(file.path()).expect("text").wanted(2).expect("a table");
        assert_eq!((read.len(), read[0].line, read[0].near_rad.clone()), (1, 2, None));
        let read = table("x,y,z,qx,qy,qz,qw,q1,q2\n0.4,0.1,0.2,0,0,0,1,0.5,-0.5\n").wanted(2).expect("a table");
        assert_eq!(read[0].near_rad, Some(vec![0.5, -0.5]));
        let read = table("q1,q2\n0.5,-0.5\n\n1,2\n").joint_values(2).expect("a table");
        assert_eq!(read, [(2, vec![0.5, -0.5]), (4, vec![1.0, 2.0])]);
    }

    #[test]
    fn what_is_wrong_is_said_with_its_row() {
        for (text, row) in [
            ("x,y,z,qw,qx,qy,qz\n0,0,0,1,0,0,0\n", Some(1)),
            ("x,y,z,qx,qy,qz,qw\n0,0,0,0,0,0,1\n0,0,0,0,0,0,2\n", Some(3)),
            ("x,y,z,qx,qy,qz,qw\n0,0,nan,0,0,0,1\n", Some(2)),
            ("x,y,z,qx,qy,qz,qw,q1\n0,0,0,0,0,0,1,0\n", Some(1)),
            ("", None),
        ] {
            let error = table(text).wanted(2).expect_err(text);
            assert_eq!(error.row, row, "{error}");
            assert_eq!(error.file, Path::new("-"), "{error}");
        }
    }
}
