//! What an old simulator cannot do, in words.

use handeye_sim_link::client::cell::Support;

use crate::text;
use crate::text::Text;

/// What to expect of a server; `None` where everything works.
pub fn of(support: Support, is_arm_known: bool) -> Option<Text> {
    match support {
        Support::Whole => None,
        Support::KnownArms if is_arm_known => None,
        Support::KnownArms => Some(text!(
            "This CoppeliaSim moves the tip of a UR5 only; for other arms it takes 4.7 or newer. Joints can be moved"
        )),
        Support::AtRest => Some(text!(
            "This CoppeliaSim cannot be held while an image is read: let arm and board stand. Following takes 4.6 or newer"
        )),
    }
}
