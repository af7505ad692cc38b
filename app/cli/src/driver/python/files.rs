//! The files of the drivers, embedded in the program, and where they are written to be run.

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
}

macro_rules! shipped {
    ($($constant:ident, $name:literal, $file:literal;)*) => {
        $(
            /// One of [`ALL`].
            pub const $constant: Shipped = Shipped {
                name: $name,
                file: $file,
                source: include_str!(concat!("../../../../../assets/drivers/", $file)),
            };
        )*
        /// All of them.
        pub const ALL: &[Shipped] = &[$($constant),*];
    };
}

shipped! {
    UR_RTDE, "ur-rtde", "ur_rtde.py";
    ROSBRIDGE, "rosbridge", "rosbridge.py";
    FOLDER, "folder", "folder.py";
    V4L, "v4l", "v4l.py";
}

/// Their shared part: its file name and content.
pub const SHARED: (&str, &str) = ("handeye_driver.py", include_str!("../../../../../assets/drivers/handeye_driver.py"));

/// The folder of the program's cache for drivers.
pub fn cache() -> Result<PathBuf, EnvironmentError> {
    let folders = BaseDirs::new().ok_or(EnvironmentError::NoCache)?;
    Ok(folders.cache_dir().join(settings::FOLDER).join("drivers"))
}

/// Writes the files of the drivers unless they exist. Each version of them has a folder of its own, so that one does not
/// change what another runs.
pub fn written() -> Result<PathBuf, EnvironmentError> {
    let mut hasher = DefaultHasher::new();
    for driver in ALL {
        driver.source.hash(&mut hasher);
    }
    SHARED.1.hash(&mut hasher);
    let folder = cache()?.join(format!("files-{:016x}", hasher.finish()));
    let failed = |path: &Path, error: &std::io::Error| EnvironmentError::NotWritten {
        path: path.to_path_buf(),
        why: error.to_string(),
    };
    std::fs::create_dir_all(&folder).map_err(|error| failed(&folder, &error))?;
    for (file, source) in ALL.iter().map(|driver| (driver.file, driver.source)).chain([SHARED]) {
        let path = folder.join(file);
        if std::fs::read(&path).is_ok_and(|bytes| bytes == source.as_bytes()) {
            continue;
        }
        atomic_file::write(&path, source.as_bytes()).map_err(|error| failed(&path, &error))?;
    }
    Ok(folder)
}
