//! The same plan for a robot that is not driven by this program: hand-guided, by its pendant, or in a cell that cannot move
//! it. Views are proposed as they look in the image, and a person takes them.
//!
//! # How
//! [`HandGuide`] proposes a view ([`Wanted`]); before there is an answer those of [`first_views`], from then on the one that
//! lowers the expected error most ([`Guide`]). [`Wanted::judge`] compares the present view with it: what to change
//! ([`Deviation`]), and whether it is good enough, which is also the case where it differs but has nearly as much
//! information.
//!
//! # Degenerate cases
//! Whether the robot can get there is known only where its joints are recorded: then only poses that it reaches are proposed.
//! Otherwise a person skips what cannot be reached. The robot has to report its pose; a session without robot poses has no hand-eye
//! calibration.

mod deviation;
pub(crate) mod first_views;

pub use deviation::Deviation;

use super::design::Design;
use super::{Ending, Guide, GuidedOptions, Known, LEAST_NOISE, Next, Why, at_least, used_views};
use handeye_estimate::handeye::joint::{Posture, ViewModel};
use handeye_estimate::reach_error::Reach;
use handeye_estimate::uncertainty::quality::TipBox;
use handeye_geometry::camera::Intrinsics;
use handeye_geometry::frames::{Base, Camera, Pose, Target, Tip};
use handeye_geometry::planar_pose;
use handeye_geometry::progress::CancelToken;
use handeye_geometry::targets::TargetSpec;
use handeye_geometry::targets::observation::Corner;

/// Part of the gain of the wanted view from which another view is good enough.
const WORTH: f64 = 0.8;

/// A first view that is turned by less against the present one gives little information: twice the error of a hand.
const LEAST_FIRST_TURN_RAD: f64 = 16.0 * std::f64::consts::PI / 180.0;

/// Proposes the views of one calibration.
#[derive(Debug, Clone, PartialEq)]
pub struct HandGuide {
    guide: Guide,
    first_views: usize,
    /// Whether what was proposed last is one of the first views, which the guide does not know about.
    is_first: bool,
}

/// The next step.
#[derive(Debug, Clone)]
pub enum HandNext {
    /// A view to take.
    Take(Box<Wanted>),
    /// Nothing.
    End(Ending),
}

/// A view that is wanted.
#[derive(Debug, Clone)]
pub struct Wanted {
    /// How the board looks there.
    pub camera_from_target: Pose<Camera, Target>,
    /// Why it is proposed; `None` for a first view and for a check.
    pub why: Option<Why>,
    /// Views that are expected to lead to the goal, this one first; `None` where that is not known.
    pub views_left: Option<usize>,
    intrinsics: Intrinsics,
    target: TargetSpec,
    worth: Option<Worth>,
}

/// What a view would add, by what is known so far.
#[derive(Debug, Clone)]
struct Worth {
    model: ViewModel,
    design: Design,
    /// The reach of the arm, where its joints are known.
    reach: Option<Reach>,
    /// Error with the wanted view over that without it.
    ratio: f64,
}

/// Comparison of the present view with the wanted one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Judged {
    /// Where the board is, by the lens of the wanted view; `None` for corners that no pose explains.
    pub present: Option<Pose<Camera, Target>>,
    /// What differs; `None` where the board is not in front of the camera.
    pub deviation: Option<Deviation>,
    /// Whether a capture here is as good, with the whole board in the image.
    pub is_good: bool,
}

impl HandGuide {
    /// A guide without captures yet.
    pub fn new(options: GuidedOptions) -> Self {
        Self { guide: Guide::new(options), first_views: 0, is_first: false }
    }

    /// Every view that was proposed from an answer, and its outcome.
    pub fn guide(&self) -> &Guide {
        &self.guide
    }

    /// See [`Guide::work_in`].
    pub fn work_in(&mut self, tool_box: Option<TipBox>) {
        self.guide.work_in(tool_box);
    }

    /// A view of the last proposal was captured.
    pub fn captured(&mut self) {
        if !self.is_first {
            self.guide.captured();
        }
    }

    /// A person skips the last proposal.
    pub fn skipped(&mut self) {
        if !self.is_first {
            self.guide.skipped();
        }
    }

    /// What to do next; `first` is how the board was seen at the first view, with the lens that is known or assumed.
    /// [`Known::robot`] is not used. Long work polls `cancel`; cancelled it returns an end, which is meaningless.
    pub fn next(
        &mut self,
        known: &Known<'_>,
        first: &Pose<Camera, Target>,
        intrinsics: &Intrinsics,
        cancel: &CancelToken,
    ) -> HandNext {
        let known = Known { robot: None, ..*known };
        let target = &known.observations.target;
        self.is_first = false;
        match self.guide.next(&known, cancel) {
            Next::End(ending) => HandNext::End(ending),
            Next::Go { plan, why: why @ Why::Gain { .. } } => {
                let Some(proposal) = plan.proposals.first() else {
                    return HandNext::End(Ending::NothingInReach { candidates: plan.candidates });
                };
                let worth = self.worth(&known, proposal.error_ratio, cancel);
                let intrinsics = worth.as_ref().map_or(*intrinsics, |worth| *worth.model.intrinsics());
                HandNext::Take(Box::new(Wanted {
                    camera_from_target: proposal.camera_from_target,
                    why: Some(why),
                    views_left: self.guide.views_left(&known, &plan),
                    intrinsics,
                    target: *target,
                    worth,
                }))
            }
            Next::Go { why: Why::FirstTurns { .. } | Why::FirstTilts { .. }, .. } => {
                // A turn of the tip is of no use to a person who looks at the image, and need not be avoided anywhere.
                self.guide.steps.pop();
                self.is_first = true;
                while self.first_views < super::MOST_FAN {
                    self.first_views += 1;
                    let view = first_views::view(intrinsics, target, first, self.first_views - 1)
                        .filter(|view| view.rotation().angle_to(&first.rotation()) > LEAST_FIRST_TURN_RAD);
                    if let Some(camera_from_target) = view {
                        let (intrinsics, target) = (*intrinsics, *target);
                        let (why, views_left, worth) = (None, None, None);
                        return HandNext::Take(Box::new(Wanted {
                            camera_from_target,
                            why,
                            views_left,
                            intrinsics,
                            target,
                            worth,
                        }));
                    }
                }
                HandNext::End(Ending::NoStart)
            }
        }
    }

    /// A view that was not designed, to check the answer at, see [`Guide::check_pose`]; `None` where there is no answer.
    pub fn check(&self, known: &Known<'_>, index: usize, skips: usize, cancel: &CancelToken) -> Option<Wanted> {
        let known = Known { robot: None, ..*known };
        let proposal = self.guide.check_pose(&known, index, skips, cancel)?;
        Some(Wanted {
            camera_from_target: proposal.camera_from_target,
            why: None,
            views_left: None,
            intrinsics: *self.guide.model(&known)?.intrinsics(),
            target: known.observations.target,
            worth: None,
        })
    }

    fn worth(&self, known: &Known<'_>, ratio: f64, cancel: &CancelToken) -> Option<Worth> {
        let model = self.guide.model(known)?;
        let noise = at_least(model.noise(), &LEAST_NOISE);
        let model = model.with_noise(noise);
        let used = used_views(known.observations, known.fit());
        let design = self.guide.ground(known, &model, &used, cancel)?.design;
        let reach = known.calibration?.reach().filter(|_| model.has_arm()).cloned();
        Some(Worth { model, design, reach, ratio })
    }
}

impl Wanted {
    /// The lens with which it is to be drawn.
    pub fn intrinsics(&self) -> &Intrinsics {
        &self.intrinsics
    }

    /// Compares it with the present view, by the corners found in that and the reported pose of the robot. Takes a tenth of a
    /// millisecond in a release build where the joints are not known (`guided_capture -- speed`), and one inverse kinematics more
    /// where they are: it may be called for every image.
    pub fn judge(&self, corners: &[Corner], base_from_tip: &Pose<Base, Tip>) -> Judged {
        // With the lens that the wanted view is drawn with: even if that is wrong, a view that looks right is the same
        // view.
        let present = planar_pose::camera_from_target(corners, &self.target, &self.intrinsics).ok();
        let deviation = present
            .and_then(|present| Deviation::between(&self.intrinsics, &self.target, &present, &self.camera_from_target));
        let is_near = deviation.is_some_and(|deviation| deviation.is_near());
        // A view wanted at the edge of the image may be close and cut off.
        let is_whole = corners.len() == self.target.len();
        Judged { present, deviation, is_good: is_whole && (is_near || self.says_as_much(base_from_tip)) }
    }

    /// Whether a view from there lowers the error by nearly as much.
    fn says_as_much(&self, base_from_tip: &Pose<Base, Tip>) -> bool {
        let Some(Worth { model, design, reach, ratio }) = &self.worth else { return false };
        let all: Vec<usize> = (0..self.target.len()).collect();
        let tip_from_joints = match reach.as_ref().map(|reach| reach.tip_from_joints(base_from_tip)) {
            // The information of a view depends on the posture of the arm, which is not known there.
            Some(None) => return false,
            Some(Some(tip_from_joints)) => tip_from_joints,
            None => Vec::new(),
        };
        let posture = Posture { base_from_tip: *base_from_tip, tip_from_joints };
        let Some(view) = model.expected(&posture, &all) else { return false };
        let there = design.error_with_m(&view) / design.error_m();
        // Gains add up as logarithms.
        *ratio < 1.0 && there.ln() <= WORTH * ratio.ln()
    }
}

/// Compares the view alone: the rest follows from it.
impl PartialEq for Wanted {
    fn eq(&self, other: &Self) -> bool {
        self.camera_from_target == other.camera_from_target && self.why == other.why
    }
}

#[cfg(test)]
mod tests;
