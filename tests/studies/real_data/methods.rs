//! The methods, each from a choice of views to both links.

use handeye_estimate::handeye::closed_form::{self, ClosedFormSolution};
use handeye_estimate::handeye::joint::outliers::estimate_screened;
use handeye_estimate::handeye::joint::{
    Free, JointProblem, JointSolution, JointStart, Noise, PoseDependentError, estimate, with_shown_field,
};
use handeye_estimate::handeye::{PosePair, pose_graph};
use handeye_geometry::camera::Intrinsics;
use handeye_geometry::frames::{Anchor, Camera, Mount, Pose, Target};
use handeye_geometry::progress::CancelToken;
use handeye_geometry::targets::bent::BoardShape;
use handeye_geometry::targets::observation::View;

use crate::sets::Set;

/// The result of a method.
pub struct Answer {
    pub mount_from_camera: Pose<Mount, Camera>,
    pub anchor_from_target: Pose<Anchor, Target>,
    pub intrinsics: Intrinsics,
    pub shape: BoardShape,
    /// To be removed from reported poses, if the method finds it and the row applies it.
    pub field: Option<PoseDependentError>,
}

impl Answer {
    /// From the reported robot pose of a view.
    pub fn anchor_from_mount(&self, set: &Set, view: usize) -> Pose<Anchor, Mount> {
        match &self.field {
            Some(field) => set.mode.anchor_from_mount(&field.applied(&set.views[view].base_from_tip)),
            None => set.pairs[view].anchor_from_mount,
        }
    }
}

/// Name of our estimator in tables: outlier views excluded, camera as given, target flat and of the stated size.
pub const OURS: &str = "joint";

/// With the robot's field if the data show one: with the links alone, and with the field applied to the reported pose.
pub const FIELD: &str = "joint, field in the model";
const APPLIED: &str = "joint, field applied";

/// Variants of it that free more.
const VARIANTS: [(&str, Free); 5] = [
    (FIELD, Free { field: true, ..FIXED }),
    ("joint, scale free", Free { scale: true, ..FIXED }),
    ("joint, camera free", Free { intrinsics: true, ..FIXED }),
    ("joint, camera and warp free", Free { intrinsics: true, warp: true, ..FIXED }),
    ("joint, all three free", Free { intrinsics: true, warp: true, scale: true, ..FIXED }),
];
const FIXED: Free = Free { intrinsics: false, warp: false, scale: false, arm: false, field: false, depth: false };

/// Fewest views from which camera and warp are freed.
pub const MANY: usize = 12;

/// What may be freed for a set: the scale always, the camera if there are enough views.
pub fn variants(set: &Set) -> impl Iterator<Item = (&'static str, Free)> {
    let many = set.views.len() >= MANY;
    VARIANTS.into_iter().filter(move |(_, free)| many || !(free.intrinsics || free.warp))
}

/// Names of all methods for a set, closed forms first, ours last.
pub fn names(set: &Set) -> Vec<&'static str> {
    let mut names: Vec<&'static str> = closed_form::all().iter().map(|m| m.name()).collect();
    if set.has_corners() {
        names.push("reprojection, exact robot");
        names.extend(variants(set).map(|(name, _)| name));
        names.push("joint, all views kept");
        names.push(APPLIED);
    }
    names.push(OURS);
    names
}

/// The corners and poses of a choice of views.
pub struct Choice {
    views: Vec<View>,
    pairs: Vec<PosePair>,
}

/// The joint estimate and the views that it kept.
pub struct Kept {
    pub views: Vec<View>,
    pub solution: JointSolution,
}

impl Kept {
    /// The problem it solves.
    pub fn problem<'a>(&'a self, set: &'a Set) -> JointProblem<'a> {
        JointProblem { free: self.solution.free, ..JointProblem::new(set.mode, &set.board, &self.views) }
    }
}

impl Choice {
    pub fn new(set: &Set, indices: &[usize]) -> Self {
        let pairs = indices.iter().map(|&i| set.pairs[i]).collect();
        let views =
            if set.has_corners() { indices.iter().map(|&i| set.views[i].clone()).collect() } else { Vec::new() };
        Self { views, pairs }
    }

    /// The joint estimate from the first closed form that has an answer, outlier views excluded; with the robot's field, if
    /// that is free and these views show one.
    pub fn joint(&self, set: &Set, free: Free) -> Option<Kept> {
        let problem = JointProblem {
            free: Free { field: false, ..free },
            ..JointProblem::new(set.mode, &set.board, &self.views)
        };
        let own: Vec<_> = self.pairs.iter().map(|pair| pair.camera_from_target).collect();
        let cancel = CancelToken::default();
        let screened = estimate_screened(&problem, &self.start(set)?, &own, &cancel).ok()?;
        let (views, mut solution) = (screened.kept_views(), screened.solution);
        if free.field
            && let Some(with) = with_shown_field(&problem, &views, &solution, &cancel).ok()?
        {
            solution = with;
        }
        let fitted = JointProblem { free: solution.free, views: &views, ..problem };
        let solution = estimate(&fitted, &solution.as_start(), &cancel).ok()?;
        Some(Kept { views, solution })
    }

    /// The same with all views kept.
    fn joint_of_all(&self, set: &Set, noise: Option<Noise>) -> Option<JointSolution> {
        let problem = JointProblem { noise, ..JointProblem::new(set.mode, &set.board, &self.views) };
        estimate(&problem, &self.start(set)?, &CancelToken::default()).ok()
    }

    fn closed_form(&self) -> Option<ClosedFormSolution> {
        ["park_martin", "daniilidis", "shah"]
            .into_iter()
            .find_map(|name| closed_form::by_name(name)?.solve(&self.pairs).ok())
    }

    fn start(&self, set: &Set) -> Option<JointStart> {
        let start = self.closed_form()?;
        Some(JointStart {
            mount_from_camera: start.mount_from_camera,
            anchor_from_target: start.anchor_from_target,
            intrinsics: set.intrinsics,
            shape: BoardShape::default(),
            noise: None,
        })
    }

    /// The answer of a method, if it has one.
    pub fn solve(&self, set: &Set, name: &str) -> Option<Answer> {
        let of = |s: ClosedFormSolution| Answer {
            mount_from_camera: s.mount_from_camera,
            anchor_from_target: s.anchor_from_target,
            intrinsics: set.intrinsics,
            shape: BoardShape::default(),
            field: None,
        };
        if let Some(method) = closed_form::by_name(name) {
            return method.solve(&self.pairs).ok().map(of);
        }
        if !set.has_corners() {
            let found = pose_graph::refine(&self.pairs, &self.closed_form()?).ok()?;
            return Some(of(ClosedFormSolution {
                mount_from_camera: found.mount_from_camera,
                anchor_from_target: found.anchor_from_target,
            }));
        }
        let exact = Noise { corner_px: 1.0, robot_m: 1e-9, robot_rad: 1e-9, ..Noise::EXACT };
        let solution = match name {
            OURS => self.joint(set, FIXED)?.solution,
            APPLIED => self.joint(set, Free { field: true, ..FIXED })?.solution,
            "joint, all views kept" => self.joint_of_all(set, None)?,
            "reprojection, exact robot" => self.joint_of_all(set, Some(exact))?,
            _ => self.joint(set, VARIANTS.iter().find(|(variant, _)| *variant == name)?.1)?.solution,
        };
        Some(Answer {
            mount_from_camera: solution.hand_eye.mount_from_camera(),
            anchor_from_target: solution.hand_eye.anchor_from_target(),
            intrinsics: solution.intrinsics,
            shape: solution.shape,
            field: solution.field.filter(|_| name == APPLIED),
        })
    }
}
