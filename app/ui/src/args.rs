//! `handeye gui`, as on the command line.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use clap::Args;
use clap::builder::{OsStringValueParser, TypedValueParser as _};
use handeye_cell::scene::SceneChoice;

use handeye_workbench::arguments::{ArmErrorsChoice, ObjectArgs, heading};

/// Options of the workbench.
#[derive(Debug, Args, Default)]
pub struct GuiArgs {
    /// Address of a CoppeliaSim or cell; without it the built-in cell is started.
    #[arg(long, value_name = "ADDR", help_heading = heading::CELL)]
    pub connect: Option<String>,
    /// Scene of the built-in cell: reference, realistic, nominal, coppeliasim, tracking, panda, xarm6, or a scene file; as in the
    /// settings if not given.
    #[arg(long, value_name = "FILE|NAME", conflicts_with_all = ["connect", "driver", "camera_driver"], help_heading = heading::CELL)]
    pub scene: Option<SceneChoice>,
    /// How far the links of the built-in cell's arm differ from those that its controller uses; from the scene if not given.
    #[arg(long, value_name = "LEVEL", value_enum, conflicts_with_all = ["connect", "driver", "camera_driver"], help_heading = heading::CELL)]
    pub arm_errors: Option<ArmErrorsChoice>,
    /// Driver of the robot, or of robot and camera: a command, or tcp://HOST:PORT.
    #[arg(long, value_name = "DRIVER", conflicts_with = "connect", help_heading = heading::CELL)]
    pub driver: Option<String>,
    /// Driver of the camera, where it is another program; alone where you type the robot's poses.
    #[arg(long, value_name = "DRIVER", conflicts_with = "connect", help_heading = heading::CELL)]
    pub camera_driver: Option<String>,
    /// Where its scene has the parts of the cell; as in the settings if not given.
    #[command(flatten)]
    pub objects: ObjectArgs,
    /// Existing file of boxes that the arm keeps out of; changes are written to it; `keep_out.toml` next to the
    /// settings if not given.
    #[arg(long, value_name = "FILE", help_heading = heading::CELL)]
    pub keep_out: Option<PathBuf>,
    /// Session folder to open, or to create; or its journal.jsonl, as a file manager hands it over.
    #[arg(long, value_name = "DIR", value_parser = OsStringValueParser::new().map(session_folder), help_heading = heading::OUTPUT)]
    pub session: Option<PathBuf>,
}

/// The folder that is meant: a file manager opens files.
fn session_folder(given: OsString) -> PathBuf {
    let path = PathBuf::from(given);
    let is_journal = path.file_name() == Some("journal.jsonl".as_ref()) && path.is_file();
    match path.parent().filter(|_| is_journal) {
        Some(here) if here == Path::new("") => ".".into(),
        Some(folder) => folder.to_owned(),
        None => path,
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Debug, Parser)]
    struct Line {
        #[command(flatten)]
        gui: GuiArgs,
    }

    #[test]
    fn the_journal_of_a_session_stands_for_its_folder() {
        let folder = tempfile::tempdir().expect("a folder");
        let journal = folder.path().join("journal.jsonl");
        let session = |path: &Path| {
            let line = ["handeye".as_ref(), "--session".as_ref(), path.as_os_str()];
            Line::try_parse_from(line).expect("a path").gui.session.expect("given")
        };
        assert_eq!(session(&journal), journal, "a session of that name may be begun");
        std::fs::write(&journal, "").expect("written");
        assert_eq!(session(&journal), folder.path());
        assert_eq!(session(folder.path()), folder.path());
    }

    #[test]
    fn what_describes_the_built_in_cell_is_refused_with_another() {
        for own in [["--scene", "panda"], ["--arm-errors", "nominal"]] {
            let parsed = |other: &[&str]| Line::try_parse_from(["handeye"].iter().chain(&own).chain(other));
            assert!(parsed(&[]).is_ok(), "{own:?}");
            for other in [["--connect", "127.0.0.1"], ["--driver", "mine"], ["--camera-driver", "mine"]] {
                assert!(parsed(&other).is_err(), "{own:?} {other:?}");
            }
        }
    }
}
