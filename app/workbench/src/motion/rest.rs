//! What the states say of an arm that was stopped.

use handeye_driver::{Place, RestWatch};
use handeye_link::moved_text;

use crate::app::App;
use crate::model::{Moves, RobotState, Severity, Simulation};
use crate::text::Text;
use handeye_wording::text;

/// So long \[s\] an arm has to come to rest: as a driver has for its own answer.
const PATIENCE_S: f64 = 2.0;

/// An arm that was told to stop, until its states say that it stands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stopping {
    since_s: f64,
    watch: RestWatch,
}

impl App {
    /// The arm was told to stop. Whether it did is for its states to say.
    pub(crate) fn watch_stop(&mut self) {
        self.model.stop_pending = true;
        self.model.stopping = Some(Stopping { since_s: self.model.now_s, watch: RestWatch::default() });
        if let Some(robot) = self.model.robot.clone() {
            self.stop_seen(&robot);
        }
    }

    /// A state has come.
    pub(crate) fn stop_seen(&mut self, robot: &RobotState) {
        let Some(stopping) = &mut self.model.stopping else { return };
        let is_news = stopping.watch.newest().is_none_or(|newest| newest.stamp_s != robot.sim_time_s);
        // In a simulation without time nothing moves.
        if robot.simulation != Simulation::Running || is_news && stopping.watch.take(place(robot)) {
            self.stop_is_over(Severity::Info, text!("Arm stopped: every joint stays where it is"));
        }
    }

    /// Time has passed.
    pub(crate) fn stop_waits(&mut self) {
        let Some(stopping) = self.model.stopping else { return };
        if self.model.now_s - stopping.since_s < PATIENCE_S {
            return;
        }
        let (severity, said) = match (stopping.watch.stands(), stopping.watch.moved()) {
            (Some(true), _) => (Severity::Info, text!("Arm stopped: every joint stays where it is")),
            (Some(false), Some(moved)) => (
                Severity::Error,
                text!(
                    "The arm was told to stop and still moves: {moved} since. Use its own emergency stop",
                    moved = moved_text(&moved, |joint| Some(self.model.joint_kind(joint)))
                ),
            ),
            // A simulation that somebody holds.
            _ if self.model.moves() == Moves::Freely && self.model.robot.is_some() => {
                (Severity::Info, text!("Arm stopped: every joint stays where it is"))
            }
            _ => (
                Severity::Error,
                text!(
                    "The arm was told to stop, and it is not known whether it has: no state has come since. Look at the arm"
                ),
            ),
        };
        self.stop_is_over(severity, said);
    }

    fn stop_is_over(&mut self, severity: Severity, said: Text) {
        self.model.stopping = None;
        self.model.stop_pending = false;
        self.say(severity, said);
    }
}

fn place(robot: &RobotState) -> Place {
    let joints = Some(robot.joints_rad).filter(|joints| !joints.is_empty());
    Place { stamp_s: robot.sim_time_s, joints, base_from_tip: robot.base_from_tip }
}
