//! Which drivers a cell consists of.

use std::fmt;

use serde::{Deserialize, Serialize};

/// Commands or addresses of drivers. Without one for the robot a person types its poses.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Drivers {
    /// The robot's, which may have the images, too.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub robot: Option<String>,
    /// The camera's, where it is another program.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub camera: Option<String>,
}

impl fmt::Display for Drivers {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let named: Vec<&str> = self.robot.iter().chain(&self.camera).map(String::as_str).collect();
        f.write_str(&named.join(" + "))
    }
}
