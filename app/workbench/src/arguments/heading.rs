//! Headings under which the help lists options. An option has the same one in every command.
#![expect(missing_docs, reason = "each says what it is")]

pub const ACCESS: &str = "Access";
pub const BOARD: &str = "Motion of the board";
pub const CELL: &str = "Robot and camera";
pub const ESTIMATE: &str = "Estimate";
pub const FOLLOWING: &str = "Following";
pub const GUIDED: &str = "Guided capture, with --poses guided";
pub const LIMITS: &str = "Limits";
pub const MEANING: &str = "What the files mean";
pub const NAMES: &str = "Names in the files";
pub const OUTPUT: &str = "Output";
pub const POSES: &str = "Poses and captures";
pub const TAGS: &str = "Boards of tags, and single tags";
pub const TARGET: &str = "Target";
pub const TRACKING: &str = "Tracking";
