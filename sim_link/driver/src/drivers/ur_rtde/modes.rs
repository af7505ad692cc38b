//! The guide's words for the modes of a robot.

/// The robot's mode, and whether the arm is where its joints say: with brakes released or not, its encoders are read from
/// `POWER_ON` on.
pub(super) fn robot_mode(mode: i32) -> &'static str {
    match mode {
        -1 => "NO_CONTROLLER",
        0 => "DISCONNECTED",
        1 => "CONFIRM_SAFETY",
        2 => "BOOTING",
        3 => "POWER_OFF",
        4 => "POWER_ON",
        5 => "IDLE",
        6 => "BACKDRIVE",
        7 => "RUNNING",
        8 => "UPDATING_FIRMWARE",
        _ => "an unknown mode",
    }
}

/// From this mode on the joints are read.
pub(super) const POWER_ON: i32 = 4;

/// The safety mode.
pub(super) fn safety_mode(mode: i32) -> &'static str {
    match mode {
        1 => "NORMAL",
        2 => "REDUCED",
        3 => "PROTECTIVE_STOP",
        4 => "RECOVERY",
        5 => "SAFEGUARD_STOP",
        6 => "SYSTEM_EMERGENCY_STOP",
        7 => "ROBOT_EMERGENCY_STOP",
        8 => "VIOLATION",
        9 => "FAULT",
        10 => "VALIDATE_JOINT_ID",
        11 => "UNDEFINED_SAFETY_MODE",
        _ => "an unknown safety mode",
    }
}
