//! The camera without corners that are simply wrong.

use nalgebra::Isometry3;

use super::{Found, IntrinsicsError, Options, SeenView, solve};
use crate::handeye::joint::CornerWeights;
use crate::wrong_corners;
use handeye_geometry::planar_pose::refine::refine;
use handeye_geometry::progress::CancelToken;
use handeye_geometry::targets::TargetSpec;
use handeye_geometry::targets::bent::BoardPoints;
use handeye_geometry::targets::observation::{Corner, Corners};
use handeye_geometry::view_equations::{ViewInput, Whitener};

/// Rounds of fitting and judging; two are usual where a corner is wrong.
const ROUNDS: usize = 5;
/// Rounds in which the worst corners of a view are left out of its pose.
const POSE_ROUNDS: usize = 6;
/// Corners go together when they are off by more than this part of the worst: one wrong corner drags its neighbours, which
/// come back once it is gone.
const NEAR_WORST: f64 = 0.5;
/// Steps of a pose without them.
const POSE_STEPS: usize = 10;

/// A camera, and the corners left out of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Screened {
    /// The camera from the corners that are left.
    pub found: Found,
    /// Wrong corners of each view, by the index of their point, ascending.
    pub rejected: Vec<Vec<usize>>,
}

/// [`solve`] with the corners weighted by what their detector states, and without those that are simply wrong.
///
/// A corner is wrong when its residual, its view's own pose being free of it, is several times what nine in ten corners of
/// all views have (`docs/maths/robust.md`). A view that would lose more than half is left whole: it is wrong, not its
/// corners. Corners that were left out are judged again by the camera that is found without them, which may then have a
/// bent target. `keep_all` leaves none out.
///
/// # Errors
/// As [`solve`].
pub fn solve_screened(
    views: &[&Corners],
    target: &TargetSpec,
    size: (u32, u32),
    options: &Options,
    keep_all: bool,
    cancel: &CancelToken,
) -> Result<Screened, IntrinsicsError> {
    let weights = CornerWeights::stated(views.iter().flat_map(|view| view.iter()));
    let fit = |views: &[Corners], options: &Options| {
        let whiteners: Vec<Whitener> =
            views.iter().map(|view| weights.map_or(Whitener::Alike, |weights| weights.whitener(view))).collect();
        let seen: Vec<SeenView<'_>> =
            views.iter().zip(&whiteners).map(|(corners, whitener)| SeenView { corners, whitener }).collect();
        solve(&seen, target, size, options, cancel)
    };
    let all: Vec<Corners> = views.iter().copied().cloned().collect();
    let mut now = Screened { found: fit(&all, options)?, rejected: vec![Vec::new(); views.len()] };
    if keep_all {
        return Ok(now);
    }
    let board = BoardPoints::new(&target.points());
    for _ in 0..ROUNDS {
        let rejected = wrong(views, &board, &now.found);
        if rejected == now.rejected {
            break;
        }
        let left: Vec<Corners> =
            views.iter().zip(&rejected).map(|(view, rejected)| wrong_corners::without(view, rejected)).collect();
        let options = Options { start: Some(now.found.intrinsics), ..*options };
        now = Screened { found: fit(&left, &options)?, rejected };
    }
    Ok(now)
}

/// The wrong corners of every view by a camera, including those that were left out of it.
fn wrong(views: &[&Corners], board: &BoardPoints, found: &Found) -> Vec<Vec<usize>> {
    let off = |corner: &Corner, pose: &Isometry3<f64>| {
        let point = pose * board.point(corner.index, &found.shape);
        found.intrinsics.project(&point).map_or(f64::INFINITY, |px| (px - corner.px).norm())
    };
    let poses = || found.camera_from_target.iter().map(|pose| *pose.isometry());
    let lengths = views.iter().zip(poses()).flat_map(|(view, pose)| view.iter().map(move |c| off(c, &pose))).collect();
    let Some(limit) = wrong_corners::limit(lengths) else { return vec![Vec::new(); views.len()] };
    let of_view = |view: &[Corner], mut pose: Isometry3<f64>| {
        let mut trusted = view.to_vec();
        for _ in 0..POSE_ROUNDS {
            let worst = trusted.iter().map(|corner| off(corner, &pose)).fold(0.0, f64::max);
            if worst <= limit {
                break;
            }
            trusted.retain(|corner| off(corner, &pose) <= limit.max(NEAR_WORST * worst));
            if !wrong_corners::enough(trusted.len(), view.len()) {
                return Vec::new();
            }
            let (intrinsics, shape, whitener) = (&found.intrinsics, &found.shape, &Whitener::Alike);
            let seen = ViewInput { intrinsics, board, shape, corners: &trusted, whitener, depths: None };
            let Some(next) = refine(&seen, &pose, POSE_STEPS) else { break };
            pose = next.pose;
        }
        let mut wrong: Vec<usize> = view.iter().filter(|c| off(c, &pose) > limit).map(|c| c.index).collect();
        wrong.sort_unstable();
        if wrong_corners::enough(view.len() - wrong.len(), view.len()) { wrong } else { Vec::new() }
    };
    views.iter().zip(poses()).map(|(view, pose)| of_view(view, pose)).collect()
}
