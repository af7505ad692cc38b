//! `handeye auto --poses guided`: every pose is chosen by what the captures so far leave open.

use std::collections::BTreeMap;

use handeye_dataset::taught_poses::Goal;
use handeye_estimate::diagnose::findings::FindingOptions;
use handeye_estimate::diagnose::{Calibration, calibrate_with};
use handeye_estimate::{Method, Observations, Options};
use handeye_geometry::progress::CancelToken;
use handeye_geometry::targets::observation::Sight;
use handeye_plan::guided::choose::{Proposal, Robot};
use handeye_plan::guided::{Ending, Guide, Known, Next};
use handeye_session::{CaptureId, SessionObservations};

use super::super::Failure;
use super::super::towards_board::TowardsBoard;
use super::sequence::PoseSequence;
use handeye_workbench::model::CapturePurpose;
use handeye_workbench::text::Language;

/// A guided session in progress.
pub struct GuidedSequence<'a, 's> {
    /// The sequence that visits poses and captures there.
    pub sequence: &'a mut PoseSequence<'s>,
    /// What chooses the poses.
    pub guide: &'a mut Guide,
    /// Captures that check the answer afterwards.
    pub checks: usize,
    /// Where to go if the board is not in view from the arm's position, one after the other.
    pub towards_board: Vec<TowardsBoard>,
    /// What was found in the captures.
    sights: BTreeMap<CaptureId, Sight>,
    image_size: (u32, u32),
    /// Captures and tries so far.
    number: u64,
    /// Simulated time of the first and of the last capture, seconds.
    time_s: Option<[f64; 2]>,
}

impl<'a, 's> GuidedSequence<'a, 's> {
    /// Nothing is captured yet.
    pub fn new(
        sequence: &'a mut PoseSequence<'s>,
        guide: &'a mut Guide,
        checks: usize,
        towards_board: Vec<TowardsBoard>,
    ) -> Self {
        Self {
            sequence,
            guide,
            checks,
            towards_board,
            sights: BTreeMap::new(),
            image_size: (0, 0),
            number: 0,
            time_s: None,
        }
    }

    /// From the board in view to the end of the session, and the captures that check it.
    pub fn run(&mut self) -> Result<Ending, Failure> {
        self.sequence.begin()?;
        if !self.visit(None, CapturePurpose::Calibrate)? && !self.look_for_board()? {
            return Err(Failure::failed(anyhow::anyhow!(
                "the board is not captured from where the arm stands: bring the whole board into the image and begin again"
            )));
        }
        let (ending, observations, calibration) = loop {
            let (observations, calibration) = self.solve()?;
            let robot = self.robot()?;
            let known = self.known(&observations, calibration.as_ref(), &robot);
            let next = self.guide.next(&known, self.sequence.cancel);
            self.check_cancelled()?;
            let plan = match next {
                Next::End(ending) => break (ending, observations, calibration),
                Next::Go { plan, why } => {
                    tracing::info!("{}", why.text().in_language(Language::English));
                    if let Some(hold) = self.guide.hold() {
                        tracing::info!("{}", hold.text().in_language(Language::English));
                    }
                    plan
                }
            };
            let goal = joints(plan.proposals.first())?;
            if self.visit(Some(&goal), CapturePurpose::Calibrate)? {
                self.guide.captured();
            } else {
                self.guide.failed();
            }
        };
        tracing::info!("{}", ending.text().in_language(Language::English));
        if calibration.is_some() {
            self.check(&observations, calibration.as_ref())?;
        }
        Ok(ending)
    }

    /// Goes to where the board should be in view, on paths that are known to be free; returns whether it was captured
    /// there.
    fn look_for_board(&mut self) -> Result<bool, Failure> {
        let goals = std::mem::take(&mut self.towards_board);
        for TowardsBoard { name, goal } in goals {
            tracing::info!("the board is not in view here: the arm goes to {name}");
            if self.visit(Some(&goal), CapturePurpose::Calibrate)? {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Captures that were not planned for the fit and never enter it.
    fn check(&mut self, observations: &Observations, calibration: Option<&Calibration>) -> Result<(), Failure> {
        for index in 0..self.checks {
            let robot = self.robot()?;
            let known = self.known(observations, calibration, &robot);
            let Some(proposal) = self.guide.check_pose(&known, index, 0, self.sequence.cancel) else {
                tracing::warn!("there is no further view in reach to check the answer at");
                break;
            };
            self.visit(Some(&joints(Some(&proposal))?), CapturePurpose::Verify)?;
        }
        Ok(())
    }

    fn known<'k>(
        &self,
        observations: &'k Observations,
        calibration: Option<&'k Calibration>,
        robot: &'k Robot,
    ) -> Known<'k> {
        Known {
            observations,
            calibration,
            robot: Some(robot),
            elapsed_s: self.time_s.map_or(0.0, |[first, last]| last - first),
        }
    }

    /// Whether it gave a capture, there or at the arm's position.
    fn visit(&mut self, goal: Option<&Goal>, purpose: CapturePurpose) -> Result<bool, Failure> {
        self.number += 1;
        let name = match purpose {
            CapturePurpose::Calibrate => format!("guided {}", self.number),
            CapturePurpose::Verify => format!("check {}", self.number),
        };
        let Some((id, measured)) = self.sequence.visit(self.number, &name, goal, purpose)? else { return Ok(false) };
        self.image_size = measured.rgb.dimensions();
        self.sights.insert(id, Sight { corners: measured.corners.clone(), depth: measured.depth_plane });
        let first_s = self.time_s.map_or(measured.sim_time_s, |[first, _]| first);
        self.time_s = Some([first_s, measured.sim_time_s]);
        tracing::info!("captured ({name})");
        Ok(true)
    }

    /// The result of the captures, with its findings.
    fn solve(&self) -> Result<(Observations, Option<Calibration>), Failure> {
        let document = self.sequence.session.document();
        let seen = document.observations(self.image_size, |id| self.sights.get(&id).cloned());
        let SessionObservations { observations, arm, robot_accuracy, .. } = seen;
        let cancel: &CancelToken = self.sequence.cancel;
        let wanted = FindingOptions::default().with_arm(arm.as_ref()).with_robot_accuracy(robot_accuracy);
        let calibration = calibrate_with(&observations, Method::Joint, Options::default(), &wanted, cancel).ok();
        self.check_cancelled()?;
        Ok((observations, calibration))
    }

    fn check_cancelled(&self) -> Result<(), Failure> {
        if self.sequence.cancel.is_cancelled() {
            return Err(Failure::failed(anyhow::anyhow!("interrupted")));
        }
        Ok(())
    }

    fn robot(&mut self) -> Result<Robot, Failure> {
        self.sequence.cell.robot()?
    }
}

/// Where the arm goes: only to joint values with a checked path.
fn joints(proposal: Option<&Proposal>) -> Result<Goal, Failure> {
    let joints = proposal.and_then(|proposal| proposal.joints);
    let joints =
        joints.ok_or_else(|| Failure::failed(anyhow::anyhow!("no joint values were chosen for the next pose")))?;
    Ok(Goal::Joints(joints.to_vec()))
}
