//! `--object`: where a scene has the parts of the cell.

use clap::Args;
use handeye_coppeliasim::cell::{BadCellPath, CellPaths};

use super::heading;

/// The option `--object`.
#[derive(Debug, Clone, Default, Args)]
pub struct ObjectArgs {
    /// Object of the scene that is a part of the cell, such as tip=/Panda/Tip; may be given for each of arm, joints, tip,
    /// target, camera, depth and board (docs/reference/coppeliasim.md). As in the public UR5 scene if not given.
    #[arg(long = "object", value_name = "PART=PATH", value_parser = assignment, help_heading = heading::CELL)]
    objects: Vec<String>,
}

fn assignment(text: &str) -> Result<String, BadCellPath> {
    CellPaths::default().assign(text).map(|()| text.to_owned())
}

impl ObjectArgs {
    /// The given paths; the others from `otherwise`.
    pub fn paths(&self, otherwise: CellPaths) -> CellPaths {
        let mut paths = otherwise;
        for text in &self.objects {
            paths.assign(text).expect("it was tried when the option was read");
        }
        paths
    }
}
