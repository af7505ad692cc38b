//! Motions of the tip by the inverse kinematics of the server, for an arm whose kinematics is not known here.
//!
//! They are taken step by step (`_init`, then `_step` and `sim.step` for each pass, then `_cleanup`): between two steps
//! the stop button is checked, and a client that crashes leaves an arm at rest. A server whose motion state cannot be
//! read gets the single call, which answers once, at the end. Cancelling that ends this client's record on the server
//! and with it the motion.

use std::time::Instant;

use handeye_geometry::frames::{Base, Pose, Tip};
use handeye_geometry::progress::CancelToken;

use super::motion::{BRAKE_GRACE, LONGEST_BRAKING, LONGEST_MOTION};
use super::{Arm, CellPart};
use crate::error::LinkError;
use crate::options::CallOptions;
use crate::sim::{MotionLimits, MotionState, MotionStatus, PoseMotion};

impl Arm {
    /// Moves the tip towards `goal`; where it ends is for the caller to see.
    pub(super) fn move_by_server(
        &mut self,
        goal: &Pose<Base, Tip>,
        limits: &MotionLimits,
        task: &'static str,
        cancel: &CancelToken,
    ) -> Result<(), LinkError> {
        let Some(target) = self.objects.target else {
            let path = self.objects.target_path.clone();
            return Err(LinkError::NoSuchObject { path, part: CellPart::Target, there: Vec::new() });
        };
        let motion = PoseMotion { tip: self.objects.tip, target, target_pose: *goal, limits: limits.clone() };
        match self.sim.move_to_pose_init(&motion) {
            Ok(state) => self.step_by_server(state, task, cancel),
            // The encoder of some servers writes maps with numbers as keys, such as that of objects to objects of the
            // inverse kinematics, with a wrong length.
            Err(error @ LinkError::Malformed { .. }) => {
                tracing::info!(%error, "the motion is made in a single call");
                // It sends nothing until its end, so it is checked before whether another client holds the simulation.
                self.sim.step(&CallOptions::cancelled_by(cancel))?;
                let outcome = self.sim.move_to_pose(&motion, &CallOptions::long(LONGEST_MOTION, cancel));
                match outcome {
                    Err(LinkError::Cancelled { .. } | LinkError::Timeout { .. } | LinkError::OwnCellSilent { .. }) => {
                        self.stop().and(outcome)
                    }
                    outcome => outcome,
                }
            }
            Err(error) => Err(error),
        }
    }

    fn step_by_server(
        &mut self,
        mut state: MotionState,
        task: &'static str,
        cancel: &CancelToken,
    ) -> Result<(), LinkError> {
        let started = Instant::now();
        // A pass that is under way may end: then the motion is still there to be braked.
        let patient = CallOptions { grace: BRAKE_GRACE, ..CallOptions::cancelled_by(cancel) };
        let mut braking_since: Option<Instant> = None;
        let outcome = loop {
            if cancel.is_cancelled() && braking_since.is_none() {
                match self.brake() {
                    Ok(true) => braking_since = Some(Instant::now()),
                    Ok(false) => break Err(LinkError::Cancelled { call: task.to_owned() }),
                    Err(error) => break Err(error),
                }
            }
            if let Some(since) = braking_since.filter(|since| since.elapsed() > LONGEST_BRAKING) {
                let (awaited, after) = ("the arm to brake".to_owned(), since.elapsed());
                break Err(LinkError::WaitedTooLong { task, awaited, after });
            }
            if started.elapsed() > LONGEST_MOTION {
                let (awaited, after) = ("the arm to arrive".to_owned(), started.elapsed());
                break Err(LinkError::WaitedTooLong { task, awaited, after });
            }
            let call = if braking_since.is_some() { CallOptions::default() } else { patient.clone() };
            let stepped = self.sim.move_to_pose_step(&mut state);
            // The commanded point takes effect in the pass that follows, also the last one.
            match stepped.and_then(|status| self.sim.step(&call).map(|()| status)) {
                Ok(MotionStatus::Running) => {}
                Ok(MotionStatus::Done) => break Ok(()),
                Ok(MotionStatus::Stopped) => {
                    self.sim.move_to_pose_cleanup(state)?;
                    return Err(match braking_since {
                        Some(_) => LinkError::Cancelled { call: task.to_owned() },
                        None => LinkError::MotionStopped { task },
                    });
                }
                Err(error) => break Err(error),
            }
        };
        match &outcome {
            Ok(()) => self.sim.move_to_pose_cleanup(state),
            // A server that has gone, hangs or is held drives nothing now, and asking it to tidy up only takes time.
            Err(
                LinkError::Held { .. }
                | LinkError::Disconnected { .. }
                | LinkError::Timeout { .. }
                | LinkError::Unreachable { .. }
                | LinkError::OwnCellSilent { .. }
                | LinkError::OwnCellEnded { .. },
            ) => outcome,
            // The arm has to be at rest before the caller gets the result. If it cannot be stopped, that is the error
            // to report.
            Err(_) => self.stop().and(self.sim.move_to_pose_cleanup(state)).and(outcome),
        }
    }
}
