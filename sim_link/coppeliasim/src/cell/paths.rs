//! Where the parts of a cell are in its scene.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::constants;
use handeye_wording::Text;
use handeye_wording::text;

/// Where the parts of the cell are in the scene: object paths as `sim.getObject` takes them.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "BTreeMap<String, String>")]
pub struct CellPaths {
    /// The base of the arm; without it the kinematics of the arm is not known. All joints between it and the tip are
    /// driven, whatever they are called.
    pub arm: String,
    /// The joints of an arm whose tip does not hang on that base: all matches in the order of the tree, from the base up.
    pub joints: String,
    /// The dummy whose pose the controller reports.
    pub tip: String,
    /// The dummy that inverse kinematics follows; without it there are no motions to a pose.
    pub target: String,
    /// The vision sensor for colour.
    pub camera: String,
    /// The vision sensor for depth, at the same place; empty for the one for colour.
    pub depth: String,
    /// The shape that the board is printed on, which is not an obstacle; there need not be one.
    pub board: String,
}

impl Default for CellPaths {
    /// The public UR5 hand-eye scene, which the built-in cell mimics.
    fn default() -> Self {
        Self::below("UR5")
    }
}

/// Parts by their names; those that are not there are as in the public scene.
impl TryFrom<BTreeMap<String, String>> for CellPaths {
    type Error = BadCellPath;

    fn try_from(parts: BTreeMap<String, String>) -> Result<Self, BadCellPath> {
        let mut paths = Self::default();
        parts.iter().try_for_each(|(key, path)| paths.assign(&format!("{key}={path}")))?;
        Ok(paths)
    }
}

/// What a path is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CellPart {
    /// See [`CellPaths::arm`].
    Arm,
    /// See [`CellPaths::joints`].
    Joints,
    /// See [`CellPaths::tip`].
    Tip,
    /// See [`CellPaths::target`].
    Target,
    /// See [`CellPaths::camera`].
    Camera,
    /// See [`CellPaths::depth`].
    Depth,
    /// See [`CellPaths::board`].
    Board,
}

/// A text that is not an assignment of a path.
#[derive(Debug, Clone, PartialEq, Eq, Error, handeye_wording::Localized)]
pub enum BadCellPath {
    /// No part of that name.
    #[error("{0:?} is not a part of a cell: those are arm, joints, tip, target, camera, depth and board")]
    Part(String),
    /// Nothing to set.
    #[error("{0:?} is not PART=PATH, such as tip=/Panda/Tip")]
    NotSet(String),
    /// Not the path of an object.
    #[error("{0:?} is not the path of an object: it begins with / and has at most 500 characters, such as /Panda/Tip")]
    Path(String),
}

/// Characters of a path, at most.
const LONGEST: usize = 500;

impl CellPart {
    /// All of them.
    pub const ALL: [Self; 7] =
        [Self::Arm, Self::Joints, Self::Tip, Self::Target, Self::Camera, Self::Depth, Self::Board];

    /// Its name in files and options.
    pub(crate) fn key(self) -> &'static str {
        match self {
            Self::Arm => "arm",
            Self::Joints => "joints",
            Self::Tip => "tip",
            Self::Target => "target",
            Self::Camera => "camera",
            Self::Depth => "depth",
            Self::Board => "board",
        }
    }

    /// Description of the part.
    pub(crate) fn what(self) -> Text {
        match self {
            Self::Arm => text!("base of the arm"),
            Self::Joints => text!("joint of the arm"),
            Self::Tip => text!("tip"),
            Self::Target => text!("target dummy of motions"),
            Self::Camera => text!("colour sensor"),
            Self::Depth => text!("depth sensor"),
            Self::Board => text!("board"),
        }
    }

    /// The type of object that it is, see [`crate::constants`], and what several of those are called.
    pub(crate) fn kind(self) -> (i64, Text) {
        match self {
            Self::Arm | Self::Board => (constants::OBJECT_SHAPE, text!("shapes")),
            Self::Joints => (constants::OBJECT_JOINT, text!("joints")),
            Self::Tip | Self::Target => (constants::OBJECT_DUMMY, text!("dummies")),
            Self::Camera | Self::Depth => (constants::OBJECT_VISION_SENSOR, text!("vision sensors")),
        }
    }

    /// Whether a cell may be without it.
    pub fn may_be_absent(self) -> bool {
        !matches!(self, Self::Tip | Self::Camera)
    }
}

impl CellPaths {
    /// The paths of the built-in cell for an arm of this name.
    pub fn below(arm: &str) -> Self {
        Self {
            arm: format!("/{arm}"),
            joints: format!("/{arm}/joint"),
            tip: format!("/{arm}/Tip"),
            target: format!("/{arm}/Target"),
            camera: format!("/{arm}/3D_camera"),
            depth: format!("/{arm}/3D_camera/depth"),
            board: "/Plane".to_owned(),
        }
    }

    /// The path of a part.
    pub fn get(&self, part: CellPart) -> &str {
        match part {
            CellPart::Arm => &self.arm,
            CellPart::Joints => &self.joints,
            CellPart::Tip => &self.tip,
            CellPart::Target => &self.target,
            CellPart::Camera => &self.camera,
            CellPart::Depth => &self.depth,
            CellPart::Board => &self.board,
        }
    }

    /// Sets the path of a part; empty for one that the scene has not.
    ///
    /// # Errors
    /// [`BadCellPath::Path`] for what cannot be the path of an object.
    pub fn set(&mut self, part: CellPart, path: &str) -> Result<(), BadCellPath> {
        let is_path = path.starts_with('/') && path.len() > 1 && path.chars().count() <= LONGEST;
        if !(is_path || path.is_empty() && part.may_be_absent()) {
            return Err(BadCellPath::Path(path.to_owned()));
        }
        let field = match part {
            CellPart::Arm => &mut self.arm,
            CellPart::Joints => &mut self.joints,
            CellPart::Tip => &mut self.tip,
            CellPart::Target => &mut self.target,
            CellPart::Camera => &mut self.camera,
            CellPart::Depth => &mut self.depth,
            CellPart::Board => &mut self.board,
        };
        path.clone_into(field);
        Ok(())
    }

    /// Sets one path by `part=path`.
    ///
    /// # Errors
    /// [`BadCellPath`] describes a valid assignment; nothing is changed then.
    pub fn assign(&mut self, assignment: &str) -> Result<(), BadCellPath> {
        let (key, path) = assignment.split_once('=').ok_or_else(|| BadCellPath::NotSet(assignment.to_owned()))?;
        let part = CellPart::ALL.into_iter().find(|part| part.key() == key.trim());
        self.set(part.ok_or_else(|| BadCellPath::Part(key.trim().to_owned()))?, path.trim())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_part_is_set_by_its_name_and_nothing_else_is() {
        for part in CellPart::ALL {
            let mut paths = CellPaths::default();
            paths.assign(&format!("{} = /Panda/x[1]", part.key())).expect("a path");
            assert_eq!(paths.get(part), "/Panda/x[1]");
            let others = CellPart::ALL.into_iter().filter(|other| *other != part);
            assert!(others.into_iter().all(|other| paths.get(other) == CellPaths::default().get(other)));
        }
    }

    #[test]
    fn what_is_no_assignment_says_what_one_looks_like_and_changes_nothing() {
        let mut paths = CellPaths::default();
        let long = format!("tip=/{}", "x".repeat(LONGEST));
        for (text, part_of_why) in [
            ("/Panda/Tip", "PART=PATH"),
            ("flange=/Panda/Tip", "arm, joints, tip"),
            ("tip=Panda", "begins with /"),
            ("tip=/", "begins with /"),
            ("tip=", "begins with /"),
            (&long, "at most 500"),
        ] {
            let why = paths.assign(text).expect_err(text).to_string();
            assert!(why.contains(part_of_why), "{why}");
        }
        assert_eq!(paths, CellPaths::default());
        paths.assign("depth=").expect("the camera measures it");
        assert_eq!(paths.depth, "");
    }
}
