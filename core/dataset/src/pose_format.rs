//! Pose tables that are not part of a whole dataset folder, or not yet: as they are while images are being taken.

use std::path::{Path, PathBuf};

use handeye_geometry::frames::{Base, Pose, Tip};

use super::config::{Config, RobotConfig, robot_alone};
use super::error::DatasetError;
use super::poses::{headers, read_poses};
use super::text::TextFile;
use super::{DESCRIPTION, base_from_tip};

/// In which conventions poses are written: what `[robot]` of a `dataset.toml` says.
#[derive(Debug, Clone)]
pub struct PoseFormat(RobotConfig);

/// A row of a pose table.
#[derive(Debug, Clone, PartialEq)]
pub struct PoseOfImage {
    /// The image as the table names it.
    pub name: String,
    /// Line in the table, from 1.
    pub line: usize,
    /// Where the tip was.
    pub base_from_tip: Pose<Base, Tip>,
    /// Joint angles in radians, where the table has them.
    pub joints_rad: Option<Vec<f64>>,
}

impl PoseFormat {
    /// As the `dataset.toml` of a folder says; `None` when there is none, or it has no `[robot]`.
    ///
    /// # Errors
    /// [`DatasetError`] with the line of what is wrong in it.
    pub fn of_folder(folder: &Path) -> Result<Option<Self>, DatasetError> {
        if !folder.join(DESCRIPTION).exists() {
            return Ok(None);
        }
        let file = TextFile::read(folder, Path::new(DESCRIPTION))?;
        Ok(Config::parse(&file.path, &file.text)?.robot.map(Self))
    }

    /// As the keys of `[robot]` say, without the line `[robot]` itself; `file` is what errors call the text.
    ///
    /// # Errors
    /// [`DatasetError`] with the line of what is wrong in it.
    pub fn parse(file: &Path, text: &str) -> Result<Self, DatasetError> {
        robot_alone(file, text).map(Self)
    }

    /// The table, relative to the folder of its description.
    pub fn table(&self) -> &str {
        &self.0.poses
    }

    /// How many joint angles follow the rotation.
    pub fn joint_count(&self) -> usize {
        self.0.joints.as_ref().map_or(0, |joints| joints.count)
    }

    /// The columns of a table, of which the first is `image`.
    pub fn columns(&self) -> Vec<&'static str> {
        let mut columns = headers(self.0.rotation).swap_remove(0);
        columns.extend_from_slice(&super::joints::COLUMNS[..self.joint_count()]);
        columns
    }

    /// The rows of a table, whose text was read from `path`.
    ///
    /// # Errors
    /// [`DatasetError`] with the row: of a number that is none, a quaternion that is no rotation, an image twice.
    pub fn rows(&self, path: &Path, text: &str) -> Result<Vec<PoseOfImage>, DatasetError> {
        let name = path.file_name().map(PathBuf::from).unwrap_or_default();
        let text = text.strip_prefix('\u{feff}').unwrap_or(text).to_owned();
        let file = TextFile { path: path.to_path_buf(), name, text, sha256: [0; 32] };
        let rows = read_poses(&file, &self.0, self.0.joints.as_ref())?;
        let of_image = |row: super::PoseRow| PoseOfImage {
            base_from_tip: base_from_tip(row.isometry, self.0.pose),
            name: row.name,
            line: row.line,
            joints_rad: row.joints_rad,
        };
        Ok(rows.into_iter().map(of_image).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn format(keys: &str) -> Result<PoseFormat, DatasetError> {
        PoseFormat::parse(Path::new("options"), keys)
    }

    #[test]
    fn rows_are_read_in_the_conventions_that_are_given() {
        let format = format(
            "poses = \"p.csv\"\nlength_unit = \"mm\"\nrotation = \"rotation_vector\"\nangle_unit = \"deg\"\npose = \"tip_from_base\"",
        )
        .expect("a format");
        assert_eq!(format.columns(), ["image", "x", "y", "z", "rx", "ry", "rz"]);
        assert_eq!(format.table(), "p.csv");
        let rows = format.rows(Path::new("p.csv"), "image,x,y,z,rx,ry,rz\na.png,100,0,0,0,0,90\n").expect("a table");
        assert_eq!(rows[0].name, "a.png");
        let expected = nalgebra::Vector3::new(0.0, 0.1, 0.0);
        assert!((rows[0].base_from_tip.translation() - expected).norm() < 1e-12, "{:?}", rows[0]);
    }

    #[test]
    fn a_convention_that_is_not_given_is_asked_for() {
        let error = format("poses = \"p.csv\"\nlength_unit = \"mm\"\nrotation = \"rpy\"\npose = \"base_from_tip\"");
        assert!(error.expect_err("no angle unit").to_string().contains("angle_unit"));
        let error = format("poses = \"p.csv\"\nrotation = \"matrix\"\npose = \"base_from_tip\"");
        assert!(error.expect_err("no unit").to_string().contains("length_unit"));
        assert!(PoseFormat::of_folder(Path::new("/nowhere")).expect("nothing").is_none());
    }
}
