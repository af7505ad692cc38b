//! One set-up of the comparison: what all strategies to choose poses share, and the strategies.

use std::path::Path;

use handeye_arm::JointValues;
use handeye_cell::scene::Scene;
use handeye_dataset::taught_poses::{Goal, TaughtPoses};
use handeye_estimate::handeye::joint::{ExpectedView, ViewModel};
use handeye_geometry::frames::{Base, Pose, Tip};
use handeye_geometry::se3;
use handeye_geometry::testing::BOARD;
use handeye_plan::guided::GuidedOptions;
use handeye_plan::guided::candidates::ViewRange;
use handeye_plan::guided::design::{Design, weight_about};
use handeye_plan::testing::guided_cell::GuidedCell;
use nalgebra::{Matrix6, Point3, UnitQuaternion, Vector3};
use rand::SeedableRng as _;
use rand_chacha::ChaCha8Rng;

use super::COUNTS;

/// What a capture takes after the arm has arrived, seconds.
const DWELL_S: f64 = 1.5;
/// Random views that all strategies choose from.
const CANDIDATES: usize = 1000;
/// First views of guided capture that are small rotations, because nothing is known yet.
const FIRST_VIEWS: usize = 3;
/// The ten poses of the reference script.
const REFERENCE_POSES: &str = include_str!("../../../assets/poses/seed10.toml");

/// One strategy's run through a session: the error after each view and when.
pub struct Way {
    /// By number of views from 1 on: expected error \[m\] and time \[s\].
    pub after: Vec<(f64, f64)>,
    /// True error of the answer from as many views as each of [`COUNTS`], metres; `None` if there are not that many, or no
    /// answer.
    pub truth_m: [Option<f64>; COUNTS.len()],
}

/// A view of a run, and when it is taken, seconds.
struct Visit {
    base_from_tip: Pose<Base, Tip>,
    view: ExpectedView,
    time_s: f64,
}

/// All runs of one session.
pub struct Ways {
    /// In the order of [`NAMES`].
    pub of: [Way; 5],
    /// The best error of each of [`COUNTS`] \[m\].
    pub optimum: Vec<f64>,
    /// The same if the first three views are those of guided capture.
    pub optimum_after: Vec<f64>,
}

/// Names of the strategies.
pub const NAMES: [&str; 5] = ["guided", "farthest rotation", "random", "easy_handeye", "reference script"];

/// A view that the arm can reach.
struct Reachable {
    joints: JointValues,
    base_from_tip: Pose<Base, Tip>,
    view: ExpectedView,
}

/// What all runs of a session share.
pub struct Bench {
    /// Before its first view.
    cell: GuidedCell,
    seed: u64,
    truth: ViewModel,
    weight: Matrix6<f64>,
    pool: Vec<Reachable>,
    first: ExpectedView,
}

impl Bench {
    /// For a cell before its first view.
    pub fn new(cell: GuidedCell, seed: u64) -> Self {
        let truth = cell.truth();
        let first_tip = cell.base_from_tip();
        let centre = truth.camera_from_target(&first_tip.into()).isometry() * BOARD.centre();
        let weight = weight_about(&centre, &BOARD);
        let all: Vec<usize> = (0..BOARD.len()).collect();
        let range = ViewRange::about([centre.coords.norm()].into_iter()).expect("it is in front of the camera");
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut pool = Vec::new();
        for _ in 0..CANDIDATES * 60 {
            if pool.len() == CANDIDATES {
                break;
            }
            let Some(drawn) = range.draw(&mut rng, truth.intrinsics(), &BOARD) else { continue };
            if !range.shows(truth.intrinsics(), &BOARD, &drawn) {
                continue;
            }
            let base_from_tip = truth.base_from_tip(&drawn);
            let Some(joints) = cell.robot.arm.reach(&base_from_tip, &cell.robot.joints) else { continue };
            if !cell.robot.arm.is_free(&joints, &cell.robot.around, cell.robot.clearance_m) {
                continue;
            }
            let Some(view) = truth.expected(&base_from_tip.into(), &all) else { continue };
            pool.push(Reachable { joints, base_from_tip, view });
        }
        let first = truth.expected(&first_tip.into(), &all).expect("it is in view");
        Self { cell, seed, truth, weight, pool, first }
    }

    /// All runs, from the same first view.
    pub fn ways(&self) -> Ways {
        let cell = &self.cell;
        let (guided, views) = self.guided();
        let first = &views[..FIRST_VIEWS.min(views.len())];
        Ways {
            of: [guided, self.farthest(cell), self.random(cell), self.easy_handeye(cell), self.reference(cell)],
            optimum: COUNTS.map(|count| self.optimum(&[], count)).to_vec(),
            optimum_after: COUNTS.map(|count| self.optimum(first, count)).to_vec(),
        }
    }

    /// Errors along a list of views.
    fn along(&self, visits: &[Visit]) -> Way {
        let mut design = Design::new(self.truth.prior(), [], self.weight).expect("the prior is one");
        let after = visits.iter().map(|visit| {
            design = design.with(&visit.view);
            (design.error_m(), visit.time_s)
        });
        let after = after.collect();
        let mut cell = self.cell.clone();
        for visit in visits {
            // The board may be cut off by noise at the edge of the image: one view fewer.
            cell.capture_at(&visit.base_from_tip);
        }
        Way { after, truth_m: self.truth_m(&cell) }
    }

    /// True errors of the answers from the first views of a session.
    fn truth_m(&self, cell: &GuidedCell) -> [Option<f64>; COUNTS.len()] {
        COUNTS.map(|count| {
            let mut cell = cell.clone();
            if cell.observations.views.len() < count {
                return None;
            }
            cell.observations.views.truncate(count);
            let estimated = cell.calibrate()?.hand_eye?.mount_from_camera();
            let off = se3::log((cell.links.mount_from_camera.inverse() * estimated).isometry());
            Some(off.dot(&(self.weight * off)).sqrt())
        })
    }

    /// Through views of the pool, after the first one.
    fn through(&self, cell: &GuidedCell, chosen: &[usize]) -> Way {
        let mut at = cell.robot.joints;
        let mut time_s = DWELL_S;
        let mut visits = vec![self.first_visit()];
        for &k in chosen {
            let next = &self.pool[k];
            time_s += cell.robot.travel_s(&at, &next.joints) + DWELL_S;
            at = next.joints;
            visits.push(Visit { base_from_tip: next.base_from_tip, view: next.view.clone(), time_s });
        }
        self.along(&visits)
    }

    /// The first view of all runs that start with it.
    fn first_visit(&self) -> Visit {
        Visit { base_from_tip: self.cell.base_from_tip(), view: self.first.clone(), time_s: DWELL_S }
    }

    fn guided(&self) -> (Way, Vec<ExpectedView>) {
        let mut cell = self.cell.clone();
        let most = *COUNTS.last().expect("some");
        // A goal that is never reached, and gains that are always worth it: only the choice is examined.
        let options = GuidedOptions {
            goal_m: 0.0,
            most_views: most,
            least_gain: 0.0,
            dwell_s: DWELL_S,
            seed: self.seed,
            ..GuidedOptions::default()
        };
        let run = cell.run(options);
        let all: Vec<usize> = (0..BOARD.len()).collect();
        let visited = cell.observations.views.iter().zip(&run.times_s).map(|(view, &time_s)| {
            let base_from_tip = view.base_from_tip.expect("a robot");
            Visit {
                base_from_tip,
                view: self.truth.expected(&base_from_tip.into(), &all).expect("it was seen"),
                time_s,
            }
        });
        let visits: Vec<Visit> = visited.collect();
        // Its own images, not the same places seen once more.
        let way = Way { truth_m: self.truth_m(&cell), ..self.along(&visits) };
        (way, visits.into_iter().map(|visit| visit.view).collect())
    }

    /// Each time the view whose rotation is farthest from all previous ones.
    fn farthest(&self, cell: &GuidedCell) -> Way {
        let mut taken = vec![cell.base_from_tip()];
        let mut chosen: Vec<usize> = Vec::new();
        let angle = |a: &Pose<Base, Tip>, b: &Pose<Base, Tip>| a.rotation().angle_to(&b.rotation());
        while taken.len() < *COUNTS.last().expect("some") {
            let nearest =
                |k: usize| taken.iter().map(|t| angle(t, &self.pool[k].base_from_tip)).fold(f64::INFINITY, f64::min);
            let Some(best) = (0..self.pool.len()).max_by(|&a, &b| nearest(a).total_cmp(&nearest(b))) else { break };
            taken.push(self.pool[best].base_from_tip);
            chosen.push(best);
        }
        self.through(cell, &chosen)
    }

    fn random(&self, cell: &GuidedCell) -> Way {
        let most = COUNTS.last().expect("some") - 1;
        self.through(cell, &(0..most.min(self.pool.len())).collect::<Vec<_>>())
    }

    /// The poses of `easy_handeye`: the tip of the first view rotated about each of its axes by ±25° and ±12.5°, and
    /// shifted along the axes of the base by ±50 mm, ±100 mm and 33 mm; after the first one those that show the board and
    /// that the arm can reach.
    fn easy_handeye(&self, cell: &GuidedCell) -> Way {
        let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
        let turns = [25.0, 12.5].into_iter().flat_map(|deg: f64| {
            axes.into_iter().flat_map(move |axis| [deg, -deg].map(|deg| (axis * deg.to_radians(), Vector3::zeros())))
        });
        let shifts = [[0.05, 0.0, 0.0], [-0.05, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, -0.1, 0.0], [0.0, 0.0, 0.1 / 3.0]];
        let shifts = shifts.into_iter().map(|shift| (Vector3::zeros(), Vector3::from(shift)));
        let first = *cell.base_from_tip().isometry();
        self.at(
            cell,
            true,
            turns.chain(shifts).map(|(turn, shift)| {
                let mut pose = first;
                pose.rotation *= UnitQuaternion::from_scaled_axis(turn);
                pose.translation.vector += shift;
                Pose::from_isometry(pose)
            }),
        )
    }

    /// The ten views of the reference script, with the board as seen by the camera of its scene; those that are
    /// completely in this camera's image and that this arm can reach. They were taught by hand, so that there is no
    /// first view before them.
    fn reference(&self, cell: &GuidedCell) -> Way {
        let taught = TaughtPoses::parse(Path::new("seed10.toml"), REFERENCE_POSES).expect("a file of this project");
        let scene = Scene::reference().and_then(|scene| scene.resolve(scene.seed)).expect("a scene of this project");
        let views = taught.poses.iter().filter_map(|pose| match &pose.goal {
            Goal::Tip(base_from_tip) => Some(scene.camera_from_target(base_from_tip)),
            Goal::Joints(_) => None,
        });
        self.at(cell, false, views.map(|view| self.truth.base_from_tip(&view)))
    }

    /// Through unchecked tip poses: those that show the board and that the arm can reach.
    fn at(&self, cell: &GuidedCell, with_first: bool, poses: impl Iterator<Item = Pose<Base, Tip>>) -> Way {
        let all: Vec<usize> = (0..BOARD.len()).collect();
        let (mut at, mut time_s) = (cell.robot.joints, 0.0);
        let mut visits = Vec::new();
        if with_first {
            time_s += DWELL_S;
            visits.push(self.first_visit());
        }
        for base_from_tip in poses {
            let seen = self.is_seen(&base_from_tip);
            let joints = cell.robot.arm.reach(&base_from_tip, &at);
            if let (true, Some(joints), Some(view)) = (seen, joints, self.truth.expected(&base_from_tip.into(), &all)) {
                time_s += cell.robot.travel_s(&at, &joints) + DWELL_S;
                at = joints;
                visits.push(Visit { base_from_tip, view, time_s });
            }
        }
        self.along(&visits)
    }

    /// Whether all corners are in the image.
    fn is_seen(&self, base_from_tip: &Pose<Base, Tip>) -> bool {
        let (intrinsics, view) = (self.truth.intrinsics(), self.truth.camera_from_target(&(*base_from_tip).into()));
        let (width, height) = (f64::from(intrinsics.width), f64::from(intrinsics.height));
        let is_inside = |point: &Point3<f64>| {
            let px = intrinsics.project(&(view.isometry() * point));
            px.is_ok_and(|px| px.x >= 0.0 && px.x <= width - 1.0 && px.y >= 0.0 && px.y <= height - 1.0)
        };
        BOARD.points().iter().all(is_inside)
    }

    /// The smallest error of a set of `count` views \[m\], some of which are given and the others from the pool.
    fn optimum(&self, given: &[ExpectedView], count: usize) -> f64 {
        let none = Design::new(self.truth.prior(), given, self.weight).expect("the prior is one");
        let free = count - given.len();
        let mut chosen: Vec<usize> = Vec::new();
        let of = |chosen: &[usize]| chosen.iter().fold(none.clone(), |design, &k| design.with(&self.pool[k].view));
        let best = |design: &Design| {
            (0..self.pool.len())
                .map(|k| (design.error_with_m(&self.pool[k].view), k))
                .min_by(|a, b| a.0.total_cmp(&b.0))
                .expect("a pool")
        };
        while chosen.len() < free {
            chosen.push(best(&of(&chosen)).1);
        }
        let mut now_m = of(&chosen).error_m();
        for _ in 0..10 {
            let before_m = now_m;
            for place in 0..free {
                let mut others = chosen.clone();
                others.remove(place);
                let (error_m, k) = best(&of(&others));
                if error_m < now_m * (1.0 - 1e-6) {
                    (chosen[place], now_m) = (k, error_m);
                }
            }
            if now_m > before_m * (1.0 - 1e-4) {
                break;
            }
        }
        now_m
    }
}
