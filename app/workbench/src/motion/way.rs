//! How far a move is.

use handeye_arm::JointValues;
use handeye_plan::travel;

use crate::model::Model;
use crate::text::Text;
use handeye_link::MotionGoal;
use handeye_wording::text;

/// Travel of a joint [rad, m of a prismatic one] within which an arm counts as at the same place: less than the free space
/// about a planned path at a reach of 2 m.
pub(crate) const STANDS: f64 = 5e-3;
/// The same for the tip \[m\], as for a settled arm elsewhere; for its rotation \[rad\] the joint value is used.
const STANDS_M: f64 = 5e-4;

/// From where the arm is to a goal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Way {
    /// How far the tip moves \[m\] and turns \[rad\]; `None` if unknown.
    pub tip: Option<(f64, f64)>,
    /// The joint that moves farthest, counted from 0, and how far [rad, or m of a prismatic one].
    pub joint: Option<(usize, f64)>,
}

impl Way {
    /// `None` while the arm's position is not known.
    pub fn to(goal: &MotionGoal, model: &Model) -> Option<Self> {
        let robot = model.robot.as_ref()?;
        let here = &robot.joints_rad;
        Some(match goal {
            MotionGoal::Tip(pose) => Self { tip: Some(robot.base_from_tip.distance_to(pose)), joint: None },
            MotionGoal::Joints(there) if there.len() == here.len() => {
                let arm = model.cell.as_ref().and_then(|cell| cell.arm.as_ref());
                let farthest = (0..there.len()).map(|i| (i, (there[i] - here[i]).abs()));
                Self {
                    tip: arm.map(|arm| arm.tip(here).distance_to(&arm.tip(there))),
                    joint: farthest.max_by(|a, b| a.1.total_cmp(&b.1)),
                }
            }
            MotionGoal::Joints(_) => Self { tip: None, joint: None },
        })
    }

    /// Whether the arm is there.
    pub fn is_none(&self) -> bool {
        match (self.joint, self.tip) {
            (Some((_, way)), _) => way <= STANDS,
            (None, Some((metres, radians))) => metres <= STANDS_M && radians <= STANDS,
            (None, None) => false,
        }
    }

    /// For display.
    pub fn text(&self, model: &Model) -> Text {
        let mm = |metres: f64| format!("{:.0}", metres * 1e3);
        let deg = |radians: f64| format!("{:.1}", radians.to_degrees());
        let way = |joint: usize, way: f64| format!("{:.1}", model.joint_kind(joint).quantity(way));
        match (self.tip, self.joint) {
            (Some((metres, radians)), Some((joint, far))) => text!(
                "the tip moves {mm} mm and turns {deg}°; the joint that moves most is J{joint}, by {way}",
                mm = mm(metres),
                deg = deg(radians),
                joint = joint + 1,
                way = way(joint, far)
            ),
            (Some((metres, radians)), None) => {
                text!("the tip moves {mm} mm and turns {deg}°", mm = mm(metres), deg = deg(radians))
            }
            (None, Some((joint, far))) => {
                text!("the joint that moves most is J{joint}, by {way}", joint = joint + 1, way = way(joint, far))
            }
            (None, None) => text!("how far that is, is not known"),
        }
    }
}

/// Whether the arm was moved between two moments; if either is unknown, it was.
pub fn has_moved(from: Option<&JointValues>, to: Option<&JointValues>) -> bool {
    match (from, to) {
        (Some(from), Some(to)) => from.len() != to.len() || travel(from, to) > STANDS,
        _ => true,
    }
}
