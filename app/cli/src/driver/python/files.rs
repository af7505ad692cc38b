//! The files of the drivers, embedded in the program, and where they are written to be run.

use std::collections::BTreeMap;
use std::collections::hash_map::DefaultHasher;
use std::hash::{Hash as _, Hasher as _};
use std::path::{Path, PathBuf};

use directories::BaseDirs;
use handeye_files::atomic_file;

use super::environment::EnvironmentError;
use handeye_workbench::settings;

/// A driver that comes with the program.
#[derive(Debug)]
pub struct Shipped {
    /// Its subcommand of `handeye driver`.
    pub name: &'static str,
    pub file: &'static str,
    pub source: &'static str,
    /// Files that it imports beside [`SHARED`].
    imports: &'static [File],
}

/// Name and content of a Python file.
pub type File = (&'static str, &'static str);

impl Shipped {
    /// All that it runs with: its own file first.
    pub fn files(&self) -> impl Iterator<Item = File> {
        [(self.file, self.source), SHARED].into_iter().chain(self.imports.iter().copied())
    }
}

macro_rules! shipped {
    ($($constant:ident, $name:literal, $file:literal, $imports:expr;)*) => {
        $(
            /// One of [`ALL`].
            pub const $constant: Shipped = Shipped {
                name: $name,
                file: $file,
                source: include_str!(concat!("../../../../../assets/drivers/", $file)),
                imports: $imports,
            };
        )*
        /// All of them.
        pub const ALL: &[Shipped] = &[$($constant),*];
    };
}

shipped! {
    UR_RTDE, "ur-rtde", "ur_rtde.py", &[];
    XARM, "xarm", "xarm.py", &[];
    FRANKA, "franka", "franka.py", &[];
    ROSBRIDGE, "rosbridge", "rosbridge.py", &[];
    ROS2, "ros2", "ros2.py", &[(ROSBRIDGE.file, ROSBRIDGE.source)];
    FOLDER, "folder", "folder.py", &[];
    V4L, "v4l", "v4l.py", &[];
    REALSENSE, "realsense", "realsense.py", &[];
    ORBBEC, "orbbec", "orbbec.py", &[];
    MUJOCO, "mujoco", "mujoco_cell.py", &[SIMULATED_CELL];
    PYBULLET, "pybullet", "pybullet_cell.py", &[SIMULATED_CELL];
}

/// Their shared part: its file name and content.
pub const SHARED: File = ("handeye_driver.py", include_str!("../../../../../assets/drivers/handeye_driver.py"));

/// What the cells of other simulators share.
const SIMULATED_CELL: File = ("simulated_cell.py", include_str!("../../../../../assets/drivers/simulated_cell.py"));

/// The folder of the program's cache for drivers.
pub fn cache() -> Result<PathBuf, EnvironmentError> {
    let folders = BaseDirs::new().ok_or(EnvironmentError::NoCache)?;
    Ok(folders.cache_dir().join(settings::FOLDER).join("drivers"))
}

/// Writes the files of the drivers unless they exist. Each version of them has a folder of its own, so that one does not
/// change what another runs.
pub fn written() -> Result<PathBuf, EnvironmentError> {
    let files: BTreeMap<&str, &str> = ALL.iter().flat_map(Shipped::files).collect();
    let mut hasher = DefaultHasher::new();
    files.hash(&mut hasher);
    let folder = cache()?.join(format!("files-{:016x}", hasher.finish()));
    let failed = |path: &Path, error: &std::io::Error| EnvironmentError::NotWritten {
        path: path.to_path_buf(),
        why: error.to_string(),
    };
    std::fs::create_dir_all(&folder).map_err(|error| failed(&folder, &error))?;
    for (file, source) in files {
        let path = folder.join(file);
        if std::fs::read(&path).is_ok_and(|bytes| bytes == source.as_bytes()) {
            continue;
        }
        atomic_file::write(&path, source.as_bytes()).map_err(|error| failed(&path, &error))?;
    }
    Ok(folder)
}
