//! Why the arm cannot be moved now.

use egui::Ui;

use crate::shell::reasons::unknown_arm;
use crate::style::parts;
use crate::style::theme::Tone;
use handeye_workbench::command::Outbox;
use handeye_workbench::connect;
use handeye_workbench::model::{Model, Moves, Simulation};
use handeye_workbench::tr;

/// Reasons in the language of the window.
pub struct Blocked {
    /// For every motion.
    pub arm: Option<&'static str>,
    /// For motions of the tip, which need the kinematics.
    pub tip: Option<&'static str>,
    can_start: bool,
}

impl Blocked {
    /// What prevents motions now.
    pub fn of(model: &Model) -> Self {
        let language = model.view.language;
        let resting = model.resting_simulation();
        let arm = if !model.control.is_connected() || !model.mover.is_connected() {
            Some(tr!(language, "Not connected: the arm cannot be moved until the connection is there"))
        } else if let Some(simulation) = resting {
            Some(match simulation {
                Simulation::Paused => tr!(language, "The simulation is paused: the arm moves only while it runs"),
                _ => tr!(language, "The simulation is stopped: the arm moves only while it runs"),
            })
        } else if model.robot.is_none() || model.cell.is_none() {
            Some(tr!(language, "Waiting until the robot has been read"))
        } else if model.sequence_runs {
            Some(tr!(language, "A sequence is under way: stop it to move the arm yourself"))
        } else if matches!(model.moves(), Moves::OnceArmed { .. }) && !model.is_armed() {
            Some(tr!(language, "The robot is only read until you let the workbench move it, in Jog"))
        } else {
            None
        };
        let is_known = model.cell.as_ref().is_none_or(|cell| cell.arm.is_some());
        let knows_kinematics = match model.moves() {
            // The controller has kinematics of its own.
            Moves::OnceArmed { joints, tip } => tip || (joints && is_known),
            Moves::Freely | Moves::Never => is_known,
        };
        let is_doubted = model.cell.as_ref().is_some_and(|cell| cell.arm_doubt.is_some());
        let tip = arm.or_else(|| match knows_kinematics {
            true => None,
            false if is_doubted => unknown_arm(model),
            false => Some(tr!(language, "This arm's kinematics is not known, so only its joints can be moved")),
        });
        Self { arm, tip, can_start: resting.is_some() }
    }

    /// The reason for everything, and a remedy.
    pub fn arm_ui(&self, ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
        // If the user has to allow it, the question is shown below.
        let Some(reason) = self.arm.filter(|_| model.is_armed() || !model.control.is_connected()) else { return };
        parts::notice_ui(ui, Tone::Warning, reason, |ui| {
            if self.can_start && ui.button(tr!(model.view.language, "Run the simulation")).clicked() {
                outbox.send(connect::Command::StartSimulation);
            }
        });
    }

    /// The reason that concerns only motions of the tip.
    pub fn tip_ui(&self, ui: &mut Ui) {
        if let Some(reason) = self.tip.filter(|_| self.arm.is_none()) {
            parts::hint_ui(ui, reason);
        }
    }
}
