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
            "This CoppeliaSim moves the tip of known arms only; for others it takes 4.7 or newer. Joints can be moved"
        )),
        Support::AtRest => Some(text!(
            "This CoppeliaSim cannot be held while an image is read: let arm and board stand. Following takes 4.6 or newer"
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::text::Language;

    #[test]
    fn what_an_old_simulator_cannot_do_is_said_only_where_it_matters() {
        let said = |support, is_arm_known| of(support, is_arm_known).map(|text| text.say(Language::English));
        assert_eq!(said(Support::Whole, false), None);
        assert_eq!(said(Support::KnownArms, true), None);
        assert!(said(Support::KnownArms, false).is_some_and(|text| text.contains("takes 4.7 or newer")));
        assert!(said(Support::AtRest, true).is_some_and(|text| text.contains("Following takes 4.6 or newer")));
    }
}
