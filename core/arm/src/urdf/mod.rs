//! Arms from URDF files, the description of robots that ROS and many others use.
//!
//! ```
//! use handeye_arm::urdf::Urdf;
//!
//! let text = r#"<robot name="lift">
//!   <link name="floor"/> <link name="carriage"/>
//!   <joint name="lift" type="prismatic">
//!     <parent link="floor"/> <child link="carriage"/>
//!     <origin xyz="0 0 0.2"/> <axis xyz="0 0 1"/> <limit lower="0" upper="0.5" velocity="0.1" effort="0"/>
//!   </joint>
//! </robot>"#;
//! let arm = Urdf::parse(text, "lift.urdf")?.arm(None, None)?;
//! assert_eq!(arm.forward(&[0.25]).unwrap().translation().z, 0.45);
//! # Ok::<(), handeye_arm::urdf::UrdfError>(())
//! ```
//!
//! # What is read
//! Links by name; for joints `type`, `parent`, `child`, `origin` (`xyz` and `rpy`, or `quat_xyzw` from version 1.1 on),
//! `axis`, `limit` (`lower`, `upper`, `velocity`) and `mimic`. The frame of a link is that of the joint which carries it.
//! Soft limits (`safety_controller`), inertia, meshes and all else are ignored.
//!
//! The structure of the whole file is checked, numbers only where they belong to the requested chain: a gripper with an
//! unusual joint does no harm.
//!
//! # Reference
//! <https://wiki.ros.org/urdf/XML> and the schema of urdfdom.

mod chain;
mod error;
mod read;

use std::path::Path;

pub use error::{UrdfError, UrdfProblem};

/// A URDF file as read: names, and the texts of its numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct Urdf {
    file: String,
    /// From version 1.1 on a rotation may be a quaternion, from 1.2 on a joint without limits may state none.
    version: (u32, u32),
    links: Vec<String>,
    joints: Vec<RawJoint>,
}

/// A joint of the file. Numbers are still text: those off the chain are never parsed.
#[derive(Debug, Clone, PartialEq)]
struct RawJoint {
    name: String,
    line: u32,
    kind: String,
    parent: String,
    child: String,
    origin: Option<RawOrigin>,
    /// `xyz` of the axis.
    axis: Option<String>,
    limit: Option<RawLimit>,
    /// The joint that it follows.
    mimic: Option<String>,
}

#[derive(Debug, Clone, PartialEq)]
struct RawOrigin {
    xyz: Option<String>,
    rpy: Option<String>,
    quat_xyzw: Option<String>,
}

#[derive(Debug, Clone, PartialEq)]
struct RawLimit {
    lower: Option<String>,
    upper: Option<String>,
    velocity: Option<String>,
}

impl Urdf {
    /// Reads a file.
    ///
    /// # Errors
    /// [`UrdfProblem::Unreadable`], and those of [`Self::parse`].
    pub fn read(path: &Path) -> Result<Self, UrdfError> {
        let file = path.display().to_string();
        match std::fs::read_to_string(path) {
            Ok(text) => Self::parse(&text, &file),
            Err(error) => {
                Err(UrdfError { file, line: None, problem: Box::new(UrdfProblem::Unreadable(error.to_string())) })
            }
        }
    }

    /// Reads the text of a file; `file` is its name in errors.
    ///
    /// # Errors
    /// Any fault of the structure: not XML, xacro source, a name twice, a link that is missing, a loop.
    pub fn parse(text: &str, file: &str) -> Result<Self, UrdfError> {
        read::read(text, file)
    }

    fn error(&self, joint: Option<&RawJoint>, problem: UrdfProblem) -> UrdfError {
        UrdfError { file: self.file.clone(), line: joint.map(|joint| joint.line), problem: Box::new(problem) }
    }
}

#[cfg(test)]
mod tests;
