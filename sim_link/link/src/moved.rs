//! How an arm moved, as text.

use handeye_arm::JointKind;
use handeye_driver::Moved;
use handeye_wording::{Text, text};

/// How an arm moved, as text for people.
pub fn moved_text(moved: &Moved, kind: impl Fn(usize) -> Option<JointKind>) -> Text {
    match *moved {
        Moved::Joint { index, from, to } => {
            let kind = kind(index).unwrap_or(JointKind::Revolute);
            let reported = |value| format!("{:.1}", kind.quantity(value)).replace('-', "−");
            text!("joint {joint} from {from} to {to}", joint = index + 1, from = reported(from), to = reported(to))
        }
        Moved::Tip { distance_m, angle_rad } => text!(
            "the tip by {mm} mm and {deg}°",
            mm = format!("{:.1}", distance_m * 1e3),
            deg = format!("{:.1}", angle_rad.to_degrees())
        ),
    }
}
