//! The arm of the cell, as a scene file gives it.

use std::path::{Path, PathBuf};

use handeye_arm::urdf::{Urdf, UrdfError};
use handeye_arm::{Arm, ArmKind};
use serde::{Deserialize, Serialize};

/// The arm of a scene: `"ur5e"`, or `{ urdf = "panda.urdf", base = "panda_link0", tip = "panda_link8" }`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(
    untagged,
    expecting = "no such arm: it is the name of a built-in one (`ur3`, `ur5`, `ur10`, `ur3e`, `ur5e`, `ur10e`, `ur16e`, \
                 `ur5_coppeliasim`), or a table with `urdf` and, where the file leaves them open, `base` and `tip`"
)]
pub enum ArmSpec {
    /// One that is built in.
    Kind(ArmKind),
    /// One out of a URDF file.
    Urdf(UrdfSpec),
}

/// An arm out of a URDF file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct UrdfSpec {
    /// The file. In a scene file it is relative to the folder of that; here to the working directory.
    pub urdf: PathBuf,
    /// The link that is fixed in the arm frame; if absent, the only link without a parent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub base: Option<String>,
    /// The link that is the connection; the only one below the base without a child if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tip: Option<String>,
    /// Text of the URDF file, for one that is built in.
    #[serde(skip)]
    text: Option<&'static str>,
}

impl UrdfSpec {
    /// The text of a URDF that is built in, the path of any other file from the root on.
    pub fn source(&self) -> String {
        let path = || std::path::absolute(&self.urdf).unwrap_or_else(|_| self.urdf.clone());
        self.text.map_or_else(|| path().display().to_string(), str::to_owned)
    }
}

impl Default for ArmSpec {
    fn default() -> Self {
        Self::Kind(ArmKind::Ur5Coppeliasim)
    }
}

impl ArmSpec {
    /// The arm in the arm frame, with the connection as its tip and the ranges and speeds that it comes with.
    ///
    /// # Errors
    /// [`UrdfError`] names file, line and element.
    pub(crate) fn arm(&self) -> Result<Arm, UrdfError> {
        match self {
            Self::Kind(kind) => Ok(kind.arm()),
            Self::Urdf(UrdfSpec { urdf, base, tip, text }) => {
                let read = match text {
                    Some(text) => Urdf::parse(text, &urdf.display().to_string())?,
                    None => Urdf::read(urdf)?,
                };
                read.arm(base.as_deref(), tip.as_deref())
            }
        }
    }

    /// The name of one that is built in.
    pub(crate) fn kind(&self) -> Option<ArmKind> {
        match self {
            Self::Kind(kind) => Some(*kind),
            Self::Urdf(_) => None,
        }
    }

    /// The same, written in a file in `folder`.
    pub(super) fn written_in(&mut self, folder: &Path) {
        if let Self::Urdf(spec) = self {
            spec.urdf = folder.join(&spec.urdf);
        }
    }

    /// The same with a URDF that is built in.
    pub(super) fn with_urdf(&mut self, built_in: Option<&'static str>) {
        if let Self::Urdf(spec) = self {
            spec.text = built_in;
        }
    }
}
