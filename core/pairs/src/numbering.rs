//! Which point of a target is numbered first, where it looks the same after a turn: every view may have been numbered
//! differently.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use super::PosePair;
use super::motion::rotation_angle;
use super::subset;
use handeye_geometry::frames::Pose;
use handeye_geometry::targets::TargetSpec;

/// The ways to number a target that looks the same after a turn, other than that of the detection.
#[derive(Debug, Clone, Default)]
pub struct Turns {
    /// The quarter turns of each about the middle of the target, and the motion of its frame.
    others: Vec<(usize, Isometry3<f64>)>,
}

impl Turns {
    /// The ways to number a target.
    pub fn of(target: &TargetSpec) -> Self {
        let centre = target.centre().coords;
        let about = |quarters: usize| {
            let angle = quarters as f64 * std::f64::consts::FRAC_PI_2;
            let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), angle);
            (quarters, Translation3::from(centre) * turn * Translation3::from(-centre))
        };
        Self { others: target.quarter_turns().iter().map(|quarters| about(*quarters)).collect() }
    }

    /// Whether there is one way only.
    pub fn is_empty(&self) -> bool {
        self.others.is_empty()
    }

    /// The quarter turns of every way, that of the detection first.
    pub fn quarters(&self) -> impl Iterator<Item = usize> + Clone {
        std::iter::once(0).chain(self.others.iter().map(|(quarters, _)| *quarters))
    }

    /// The motion of the target's frame by this many quarter turns; `None` where that is as detected.
    pub fn motion(&self, quarters: usize) -> Option<&Isometry3<f64>> {
        self.others.iter().find(|(known, _)| *known == quarters % 4).map(|(_, motion)| motion)
    }

    /// A pose of the target in another frame, with the target renumbered.
    pub fn turned<From: handeye_geometry::frames::Frame, To: handeye_geometry::frames::Frame>(
        &self,
        pose: &Pose<From, To>,
        quarters: usize,
    ) -> Pose<From, To> {
        self.motion(quarters).map_or(*pose, |motion| Pose::from_isometry(pose.isometry() * motion))
    }

    /// Poses of the target under every other numbering.
    pub fn others(&self, seen: &Isometry3<f64>) -> impl Iterator<Item = Isometry3<f64>> {
        self.others.iter().map(move |(_, motion)| seen * motion)
    }

    /// The pair with its target renumbered.
    pub fn pair(&self, pair: &PosePair, quarters: usize) -> PosePair {
        PosePair { camera_from_target: self.turned(&pair.camera_from_target, quarters), ..*pair }
    }
}

/// Angles of robot and target that differ by more than this, radians, count no more than those that differ by it: one view may be
/// wrong.
const CAP_RAD: f64 = 0.2;
/// Views of which each is tried as the one that the others agree with, those that every view is compared with, and rounds in which
/// all are renumbered.
const MOST_TRIED: usize = 6;
const MOST_COMPARED: usize = 30;
const ROUNDS: usize = 2;

/// Difference between the turns of robot and target between two views: from one to the other both turn by the same angle (Shiu &
/// Ahmad 1989, the rotational part of AX = XB), radians.
pub fn unlike_rad(a: &PosePair, b: &PosePair) -> f64 {
    let robot = rotation_angle(&(a.anchor_from_mount.rotation().inverse() * b.anchor_from_mount.rotation()));
    let target = rotation_angle(&(a.camera_from_target.rotation() * b.camera_from_target.rotation().inverse()));
    (robot - target).abs().min(CAP_RAD)
}

/// The pairs with their targets numbered so that the turns of robot and target agree.
pub fn alike(pairs: &[PosePair], turns: &Turns) -> Vec<PosePair> {
    if turns.is_empty() || pairs.len() < 2 {
        return pairs.to_vec();
    }
    let ways: Vec<Vec<PosePair>> =
        pairs.iter().map(|pair| turns.quarters().map(|quarters| turns.pair(pair, quarters)).collect()).collect();
    // Of equal ones the first, which is the one detected.
    let best = |of: &[PosePair], others: &dyn Fn(&PosePair) -> f64| {
        let unlike = of.iter().map(others).enumerate();
        unlike.min_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(way, _)| way)
    };
    let compared = subset::spread(pairs.len(), MOST_COMPARED);
    let mut found: Option<(f64, Vec<usize>)> = None;
    for first in subset::spread(pairs.len(), MOST_TRIED) {
        let mut way: Vec<usize> = ways.iter().map(|of| best(of, &|pair| unlike_rad(pair, &ways[first][0]))).collect();
        let total = |way: &[usize], view: usize, pair: &PosePair| -> f64 {
            let others = compared.iter().filter(|other| **other != view);
            others.map(|other| unlike_rad(pair, &ways[*other][way[*other]])).sum()
        };
        for _ in 0..ROUNDS {
            for view in 0..pairs.len() {
                way[view] = best(&ways[view], &|pair| total(&way, view, pair));
            }
        }
        let unlike = (0..pairs.len()).map(|view| total(&way, view, &ways[view][way[view]])).sum();
        if found.as_ref().is_none_or(|(least, _)| unlike < *least) {
            found = Some((unlike, way));
        }
    }
    found.map_or_else(|| pairs.to_vec(), |(_, way)| ways.iter().zip(way).map(|(of, way)| of[way]).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Mode;
    use crate::closed_form::{ClosedForm as _, ParkMartin};
    use handeye_geometry::targets::Grid;
    use handeye_simulate::session::{REALISTIC, camera, trial};

    #[test]
    fn views_of_a_square_of_dots_are_counted_alike_however_they_were_detected() {
        let turns = Turns::of(&TargetSpec::Circles(Grid { columns: 9, rows: 9, square_m: 0.01 }));
        for seed in 0..6 {
            let t = trial(Mode::EyeInHand, 12, &REALISTIC, camera(), 90 + seed);
            let pair = |(i, view): (usize, &handeye_geometry::targets::observation::View)| {
                let anchor_from_mount = t.mode.anchor_from_mount(&view.base_from_tip);
                let seen = t.mount_from_camera.inverse() * anchor_from_mount.inverse() * t.anchor_from_target;
                turns.pair(&PosePair { anchor_from_mount, camera_from_target: seen }, i * i + seed as usize)
            };
            let pairs: Vec<PosePair> = t.views.iter().enumerate().map(pair).collect();
            let found = ParkMartin.solve(&alike(&pairs, &turns)).expect("solves");
            let off_m = found.mount_from_camera.distance_to(&t.mount_from_camera).0;
            assert!(off_m < 1e-6, "{seed}: {off_m}");
        }
    }

    #[test]
    fn a_target_that_is_counted_from_another_corner_has_its_points_where_it_is_turned() {
        let grid = |columns| Grid { columns, rows: 8, square_m: 0.01 };
        let of = [TargetSpec::Circles(grid(8)), TargetSpec::Chessboard(grid(8)), TargetSpec::Circles(grid(5))];
        for (target, ways) in of.into_iter().zip([4, 4, 2]) {
            let turns = Turns::of(&target);
            assert_eq!(turns.quarters().count(), ways);
            for (quarters, index) in
                turns.quarters().flat_map(|quarters| (0..target.len()).map(move |index| (quarters, index)))
            {
                let own = target.point(index);
                let renumbered = target.point(target.renumbered(index, quarters));
                let there = turns.motion(quarters).map_or(renumbered, |motion| motion * renumbered);
                assert!((there - own).norm() < 1e-12, "{target} {quarters} {index}");
            }
        }
    }
}
