//! A person who takes the requested views, with a hand that trembles.

use nalgebra::{Isometry3, UnitQuaternion, Vector2, Vector3};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use super::guided_cell::GuidedCell;
use crate::guided::by_hand::{HandGuide, HandNext, Wanted};
use crate::guided::{Ending, GuidedOptions};
use handeye_estimate::diagnose::Calibration;
use handeye_geometry::camera::Intrinsics;
use handeye_geometry::frames::{Camera, Pose, Target};
use handeye_geometry::progress::CancelToken;
use handeye_geometry::targets::observation::Corner;
use handeye_geometry::testing::BOARD;
use handeye_simulate::links::Links;
use handeye_simulate::session::seen;

/// Time between two looks at the image, seconds.
const LOOK_S: f64 = 0.1;
/// How far a hand moves in that time [m, rad].
const STEP: (f64, f64) = (0.01, 0.044);
/// Its tremor in that time [m, rad].
const TREMOR: (f64, f64) = (0.001, 0.005);
/// Error of its aim before it gets advice: half of the errors are smaller [m, rad].
const AIM: (f64, f64) = (0.03, 0.12);
/// Good looks in a row before there is a capture: as long as a window waits for an arm at rest.
const GOOD_LOOKS: usize = 5;
/// Time after which a person gives up a view, seconds.
const PATIENCE_S: f64 = 60.0;

/// Result of a session by hand.
#[derive(Debug, Clone)]
pub struct HandRun {
    /// Why it ended; `None` where the wanted number of views was reached before.
    pub ending: Option<Ending>,
    /// The answer from all of them.
    pub calibration: Option<Calibration>,
    /// Duration of each view, seconds.
    pub took_s: Vec<f64>,
    /// Captures in which the board was not whole.
    pub refused: usize,
    /// Views that were given up.
    pub skipped: usize,
}

/// Takes this many views, the first at the present pose of the arm of the cell.
///
/// # Panics
/// When the board is not in view there.
pub fn session(cell: &mut GuidedCell, options: GuidedOptions, views: usize, seed: u64) -> HandRun {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let (links, camera) = (cell.links, *cell.camera());
    let mut guide = HandGuide::new(options);
    let at = cell.base_from_tip();
    assert!(cell.capture_at(&at), "the board is in view at the beginning");
    let first = links.camera_from_target(&at);
    let mut present = first;
    let mut run = HandRun { ending: None, calibration: None, took_s: Vec::new(), refused: 0, skipped: 0 };
    while cell.observations.views.len() < views {
        let known = cell.known(run.calibration.as_ref(), 0.0);
        let wanted = match guide.next(&known, &first, &camera, &CancelToken::default()) {
            HandNext::Take(wanted) => wanted,
            HandNext::End(ending) => {
                run.ending = Some(ending);
                break;
            }
        };
        let (reached, took_s) = bring_about(&wanted, &present, (&links, &camera), &mut rng);
        present = reached;
        if took_s >= PATIENCE_S {
            run.skipped += 1;
            guide.skipped();
        } else if cell.capture_at(&links.base_from_tip(&present)) {
            run.took_s.push(took_s);
            guide.captured();
            run.calibration = cell.calibrate();
        } else {
            run.refused += 1;
        }
    }
    run
}

/// The corners found in a view; `None` where the board is not whole.
pub fn corners(camera: &Intrinsics, camera_from_target: &Pose<Camera, Target>) -> Option<Vec<Corner>> {
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    seen(&mut rng, camera, camera_from_target.isometry(), &BOARD.points(), 0.0, |_| Vector2::zeros())
}

/// The pose that the hand reaches, and the time that it takes.
fn bring_about(
    wanted: &Wanted,
    from: &Pose<Camera, Target>,
    (links, camera): (&Links, &Intrinsics),
    rng: &mut ChaCha8Rng,
) -> (Pose<Camera, Target>, f64) {
    let mut about = |scale: f64| (rng.random::<f64>() * 2.0 - 1.0) * scale;
    let mut vector = |scale: f64| Vector3::new(about(scale), about(scale), about(scale));
    // A hand misses the goal, by less the longer it gets advice.
    let mut aim = (vector(2.0 * AIM.0), vector(2.0 * AIM.1));
    let mut present = *from.isometry();
    let (mut good, mut time_s) = (0, 0.0);
    while time_s < PATIENCE_S {
        time_s += LOOK_S;
        let goal = wanted.camera_from_target.isometry();
        let to = goal.translation.vector + aim.0 - present.translation.vector;
        let turn = (UnitQuaternion::from_scaled_axis(aim.1) * goal.rotation * present.rotation.inverse()).scaled_axis();
        let limited = |way: Vector3<f64>, most: f64| way * (most / way.norm().max(most));
        present = Isometry3::from_parts(
            (present.translation.vector + limited(to, STEP.0) + vector(TREMOR.0)).into(),
            UnitQuaternion::from_scaled_axis(limited(turn, STEP.1) + vector(TREMOR.1)) * present.rotation,
        );
        let there = Pose::from_isometry(present);
        let corners = corners(camera, &there);
        if corners.is_some_and(|corners| wanted.judge(&corners, &links.base_from_tip(&there)).is_good) {
            good += 1;
            if good >= GOOD_LOOKS {
                return (there, time_s);
            }
        } else {
            good = 0;
            if to.norm() < 2.0 * STEP.0 {
                aim = (aim.0 * 0.8, aim.1 * 0.8);
            }
        }
    }
    (Pose::from_isometry(present), time_s)
}
