//! Guided sessions among random boxes, judged by geometry that has nothing in common with the planner's distances: points on
//! the surfaces of links, camera and board, checked along the whole path of every move.

use std::collections::BTreeSet;

use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use super::guided_cell::{CellSetup, GuidedCell};
use crate::guided::{GuidedOptions, Outcome};
use crate::{Obstacle, SpeedLimits, travel};
use handeye_arm::JointValues;
use handeye_arm::links::{self, LinkCapsule};
use handeye_estimate::handeye::Mode;
use handeye_geometry::testing::BOARD;

/// Boxes of a scene.
const BOXES: usize = 10;
/// Clearance that they leave around the arm at the start, metres: nothing is known of the hand then.
const ROOM_AT_START_M: f64 = 0.06;
/// Points along and around a link.
const ALONG: usize = 9;
const ABOUT: usize = 10;
/// Points along an edge of the board.
const SHEET_POINTS: usize = 24;
/// Places that are checked along a move.
const PLACES: usize = 240;
/// Edges of the clear sheet beyond the outermost corners, in squares, of which one is printed.
const EDGE_SQUARES: f64 = 2.0;
/// A camera's housing: radius and length behind the lens, metres.
const HOUSING_M: (f64, f64) = (0.03, 0.03);
/// Edge of a camera next to the robot, metres.
const CAMERA_BESIDE_M: f64 = 0.1;
/// Limits that the arm has to keep, m/s and rad/s.
const LIMITS: SpeedLimits = SpeedLimits { tip_m_s: Some(0.25), joint_rad_s: Some(0.8) };

/// Results of moves. See [`session`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tally {
    /// Sessions that were run.
    pub sessions: usize,
    /// Moves that were made.
    pub moves: usize,
    /// Moves on which some point of arm, camera or board was inside a box, or inside the board or the camera.
    pub contacts: usize,
    /// Moves on which the arm or what it carries was inside the arm.
    pub self_contacts: usize,
    /// Moves with a joint out of its range.
    pub out_of_range: usize,
    /// Moves on which tip or a joint was too fast.
    pub too_fast: usize,
    /// Moves after which the board was not wholly in the image.
    pub cut: usize,
    /// The nearest that anything came to a box, metres.
    pub nearest_m: f64,
}

impl Default for Tally {
    fn default() -> Self {
        Self {
            sessions: 0,
            moves: 0,
            contacts: 0,
            self_contacts: 0,
            out_of_range: 0,
            too_fast: 0,
            cut: 0,
            nearest_m: f64::INFINITY,
        }
    }
}

impl Tally {
    /// The sum of both.
    #[must_use]
    pub fn and(self, other: Self) -> Self {
        Self {
            sessions: self.sessions + other.sessions,
            moves: self.moves + other.moves,
            contacts: self.contacts + other.contacts,
            self_contacts: self.self_contacts + other.self_contacts,
            out_of_range: self.out_of_range + other.out_of_range,
            too_fast: self.too_fast + other.too_fast,
            cut: self.cut + other.cut,
            nearest_m: self.nearest_m.min(other.nearest_m),
        }
    }
}

/// A guided session of this many views among random boxes, with limits of speed. With `is_known` false the planner does
/// not know of the boxes: its collisions then show that the check detects contacts.
///
/// # Panics
/// Never: joint values are those of the arm.
pub fn session(setup: CellSetup, views: usize, is_known: bool) -> Tally {
    let mut cell = GuidedCell::new(setup);
    let body = Body::new(&cell, setup.mode);
    let first = cell.robot.joints;
    let boxes = clutter(setup.seed, &body.at(&cell, &first));
    let mut solid = cell.robot.around.obstacles.clone();
    solid.extend(boxes.iter().cloned());
    solid.push(beside(&cell, setup.mode));
    cell.robot.around.limits = LIMITS;
    if is_known {
        cell.robot.around.obstacles.extend(boxes);
    }
    let options = GuidedOptions {
        goal_m: 0.0,
        least_gain: 0.0,
        most_views: views,
        candidates: 250,
        seed: setup.seed,
        ..GuidedOptions::default()
    };
    let run = cell.run(options);
    let mut tally = Tally { sessions: 1, ..Tally::default() };
    let mut at = first;
    for step in &run.steps {
        let Some(to) = step.joints.filter(|_| step.outcome != Outcome::Pending) else { continue };
        tally = tally.and(judged(&cell, &body, &solid, &at, &to));
        tally.cut += usize::from(step.outcome == Outcome::Failed);
        at = to;
    }
    tally
}

/// One move.
fn judged(cell: &GuidedCell, body: &Body, solid: &[Obstacle], from: &JointValues, to: &JointValues) -> Tally {
    let robot = &cell.robot;
    let rad_s = robot.arm.joint_speed(from, to, &robot.around, robot.pace.speed);
    let place_s = travel(from, to) / rad_s / PLACES as f64;
    let mut nearest_m = f64::INFINITY;
    let (mut inside_itself, mut is_out, mut is_fast) = (false, false, false);
    let mut tip_before: Option<Vector3<f64>> = None;
    for place in 0..=PLACES {
        let part = place as f64 / PLACES as f64;
        let joints = JointValues::from_fn(from.len(), |k| from[k] + part * (to[k] - from[k]));
        is_out |= robot.arm.chain.first_violation(&joints).is_some();
        let tip = robot.arm.tip(&joints).expect("its own joints").translation();
        if let (Some(before), Some(limit)) = (tip_before, LIMITS.tip_m_s) {
            is_fast |= (tip - before).norm() > limit * place_s * 1.01;
        }
        tip_before = Some(tip);
        let points = body.at(cell, &joints);
        for (_, point) in points.iter().filter(|(part, _)| *part != Part::Link(0)) {
            nearest_m = solid.iter().map(|solid| outside_m(solid, point)).fold(nearest_m, f64::min);
        }
        inside_itself |= body.inside(cell, &joints, &points).iter().any(|pair| !body.by_design.contains(pair));
    }
    let fastest_rad_s = travel(from, to) / (place_s * PLACES as f64);
    is_fast |= LIMITS.joint_rad_s.is_some_and(|limit| fastest_rad_s > limit * 1.01);
    Tally {
        sessions: 0,
        moves: 1,
        contacts: usize::from(nearest_m <= 0.0),
        self_contacts: usize::from(inside_itself),
        out_of_range: usize::from(is_out),
        too_fast: usize::from(is_fast),
        cut: 0,
        nearest_m,
    }
}

/// Distance of a point from a box along the axis on which it is farthest outside, metres; zero and less inside.
fn outside_m(solid: &Obstacle, point: &Point3<f64>) -> f64 {
    let local = solid.world_from_centre.inverse() * point;
    (0..3).map(|axis| local[axis].abs() - 0.5 * solid.size_m[axis]).fold(f64::NEG_INFINITY, f64::max)
}

/// Boxes at random in reach of the arm, away from where it begins.
fn clutter(seed: u64, start: &[(Part, Point3<f64>)]) -> Vec<Obstacle> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed ^ 0xb0c5);
    let mut uniform = |low: f64, high: f64| low + (high - low) * rng.random::<f64>();
    let mut boxes = Vec::new();
    while boxes.len() < BOXES {
        let at = Vector3::new(uniform(0.1, 0.8), uniform(-0.6, 0.6), uniform(0.05, 0.8));
        let turn = Vector3::new(uniform(-1.0, 1.0), uniform(-1.0, 1.0), uniform(-1.0, 1.0));
        let size_m = [uniform(0.02, 0.2), uniform(0.02, 0.2), uniform(0.02, 0.3)];
        let centre = Isometry3::from_parts(at.into(), UnitQuaternion::from_scaled_axis(turn));
        let found = Obstacle::new(format!("box {}", boxes.len() + 1), centre, size_m);
        if start.iter().all(|(_, point)| outside_m(&found, point) > ROOM_AT_START_M) {
            boxes.push(found);
        }
    }
    boxes
}

/// The one of board and camera that the arm does not carry, at its true place.
fn beside(cell: &GuidedCell, mode: Mode) -> Obstacle {
    match mode {
        Mode::EyeInHand => {
            let [x, y] = sheet_m();
            let centre = cell.links.anchor_from_target.isometry() * Isometry3::from(BOARD.centre().coords);
            Obstacle::new("board", centre, [x, y, 0.002])
        }
        Mode::EyeToHand => {
            let behind = Isometry3::translation(0.0, 0.0, -0.5 * CAMERA_BESIDE_M + 0.02);
            Obstacle::new("camera", cell.links.mount_from_camera.isometry() * behind, [CAMERA_BESIDE_M; 3])
        }
    }
}

fn sheet_m() -> [f64; 2] {
    let edge_m = 2.0 * EDGE_SQUARES * BOARD.grid().square_m;
    [BOARD.extent().x + edge_m, BOARD.extent().y + edge_m]
}

/// The part that a point belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Part {
    /// The link with this number.
    Link(usize),
    /// Camera or board.
    Hand,
}

/// Points on the surfaces of the arm and of what it carries, at its true place.
struct Body {
    links: Vec<LinkCapsule>,
    of_link: Vec<(usize, Point3<f64>)>,
    /// Points of the hand, in the frame of the tip.
    of_hand: Vec<Point3<f64>>,
    /// Parts that overlap where the arm begins: the links between them are so short that their tubes overlap everywhere.
    by_design: BTreeSet<(Part, usize)>,
}

impl Body {
    fn new(cell: &GuidedCell, mode: Mode) -> Self {
        let links = links::capsules(&cell.robot.arm.chain);
        let of_link = links.iter().flat_map(|link| {
            surface(&link.from, &link.to, link.radius_m).into_iter().map(move |point| (link.link, point))
        });
        let of_hand = match mode {
            Mode::EyeInHand => {
                let (radius_m, length_m) = HOUSING_M;
                let housing = surface(&Point3::origin(), &Point3::new(0.0, 0.0, -length_m), radius_m);
                housing.into_iter().map(|point| cell.links.mount_from_camera.isometry() * point).collect()
            }
            Mode::EyeToHand => {
                let [x, y] = sheet_m();
                let centre = BOARD.centre();
                let along = |k: usize, edge_m: f64| (k as f64 / (SHEET_POINTS - 1) as f64 - 0.5) * edge_m;
                let all = (0..SHEET_POINTS).flat_map(|i| (0..SHEET_POINTS).map(move |j| (i, j)));
                all.map(|(i, j)| Point3::new(centre.x + along(i, x), centre.y + along(j, y), 0.0))
                    .map(|point| cell.links.anchor_from_target.isometry() * point)
                    .collect()
            }
        };
        let mut body = Self { of_link: of_link.collect(), of_hand, links, by_design: BTreeSet::new() };
        let first = cell.robot.joints;
        body.by_design = body.inside(cell, &first, &body.at(cell, &first));
        body
    }

    /// All points at their places with these joint values.
    fn at(&self, cell: &GuidedCell, joints: &JointValues) -> Vec<(Part, Point3<f64>)> {
        let arm = &cell.robot.arm;
        let frames = arm.chain.frames(joints).expect("its own joints");
        let links: Vec<Isometry3<f64>> = links::arm_from_links(&frames).map(|link| arm.world_from_arm * link).collect();
        let tip = *arm.tip(joints).expect("its own joints").isometry();
        let of_link = self.of_link.iter().map(|(link, point)| (Part::Link(*link), links[*link] * point));
        of_link.chain(self.of_hand.iter().map(|point| (Part::Hand, tip * point))).collect()
    }

    /// Which parts are inside which link: links that are four joints or more apart, and the hand in any link but the last. Nearer
    /// ones are so close together that the tubes overlap in places where the arm itself does not.
    fn inside(
        &self,
        cell: &GuidedCell,
        joints: &JointValues,
        points: &[(Part, Point3<f64>)],
    ) -> BTreeSet<(Part, usize)> {
        let arm = &cell.robot.arm;
        let frames = arm.chain.frames(joints).expect("its own joints");
        let links: Vec<Isometry3<f64>> = links::arm_from_links(&frames).map(|link| arm.world_from_arm * link).collect();
        let last = self.links.iter().map(|link| link.link).max().unwrap_or(0);
        let mut found = BTreeSet::new();
        for link in &self.links {
            let (a, b) = (links[link.link] * link.from, links[link.link] * link.to);
            for (part, point) in points {
                let is_far = match part {
                    Part::Link(of) => of.abs_diff(link.link) >= 4,
                    Part::Hand => link.link < last,
                };
                if is_far && from_segment_m(&a, &b, point) < link.radius_m {
                    found.insert((*part, link.link));
                }
            }
        }
        found
    }
}

fn from_segment_m(a: &Point3<f64>, b: &Point3<f64>, point: &Point3<f64>) -> f64 {
    let along = b - a;
    let part = ((point - a).dot(&along) / along.norm_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
    (point - (a + along * part)).norm()
}

/// Points on a tube with round ends.
fn surface(from: &Point3<f64>, to: &Point3<f64>, radius_m: f64) -> Vec<Point3<f64>> {
    let axis = (to - from).try_normalize(1e-9).unwrap_or_else(Vector3::z);
    let across = axis.cross(&if axis.x.abs() < 0.7 { Vector3::x() } else { Vector3::y() }).normalize();
    let other = axis.cross(&across);
    let mut points = vec![from - axis * radius_m, to + axis * radius_m];
    for k in 0..ABOUT {
        let (sin, cos) = (std::f64::consts::TAU * k as f64 / ABOUT as f64).sin_cos();
        let out = across * cos + other * sin;
        points.extend((0..=ALONG).map(|i| from + (to - from) * (i as f64 / ALONG as f64) + out * radius_m));
        for (end, away) in [(from, -1.0), (to, 1.0)] {
            points.push(end + (out + axis * away) * (radius_m * std::f64::consts::FRAC_1_SQRT_2));
        }
    }
    points
}
