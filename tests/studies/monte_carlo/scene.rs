//! Views of a known chain: the camera and the board of the reference cell, with the noise of one trial.

use handeye_estimate::handeye::Mode;
use handeye_estimate::handeye::joint::Noise;
use handeye_geometry::camera::{Distortion, Intrinsics};
use handeye_geometry::frames::{Base, Camera, Pose, Target, Tip};
use handeye_geometry::targets::observation::{Corner, View};
use handeye_geometry::testing::BOARD;
use handeye_simulate::lens::{is_in_image, pixel};
use handeye_simulate::links::{Links, normal, reported};
use handeye_simulate::session::{Cone, add_field, noisy};
use nalgebra::{Isometry3, Point3, UnitQuaternion, UnitVector3, Vector2, Vector3};
use rand::seq::SliceRandom as _;
use rand::{Rng, RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

/// Opening angle of the reference cell's camera, degrees.
const VIEW_ANGLE_DEG: f64 = 57.0;
/// A mild barrel lens, so that no derivative with respect to a coefficient is taken at zero distortion.
const DISTORTION: Distortion = Distortion::BrownConrady([-0.08, 0.05, 0.0006, -0.0004, -0.01]);
/// Minimum distance \[px\] of the true corners from the edge of the image: seven times the largest corner noise of the
/// study.
const MARGIN_PX: f64 = 2.0;

/// What is the same in all trials of a cell of the table.
#[derive(Debug, Clone, Copy)]
pub struct Cell {
    pub mode: Mode,
    pub poses: usize,
    /// True noise levels; zero is exact.
    pub noise: Noise,
    pub free_intrinsics: bool,
    /// Whether a tenth of the views, at least one, is grossly wrong.
    pub corrupted: bool,
}

/// One trial: what the estimator sees, and the truth.
pub struct Trial {
    pub cell: Cell,
    pub points: Vec<Point3<f64>>,
    pub intrinsics: Intrinsics,
    pub links: Links,
    /// Where the tip really was.
    pub true_base_from_tip: Vec<Pose<Base, Tip>>,
    pub views: Vec<View>,
    /// Which views are grossly wrong.
    pub wrong: Vec<bool>,
}

pub fn intrinsics() -> Intrinsics {
    Intrinsics { distortion: DISTORTION, ..Intrinsics::from_view_angle(640, 480, VIEW_ANGLE_DEG.to_radians()) }
}

/// Hand-eye and place of the target: in the hand, the camera of the reference cell, 50 mm next to the tip and rotated by
/// 90°, in front of its upright board; to the hand, a camera on a stand next to the arm, which holds the board.
fn truth(mode: Mode) -> Links {
    let quarter = std::f64::consts::FRAC_PI_2;
    let (camera, target) = match mode {
        Mode::EyeInHand => ([[0.05, 0.0, 0.0], [0.0, 0.0, quarter]], [[-0.19, -0.4, 0.85], [-1.57, 0.03, 0.02]]),
        Mode::EyeToHand => ([[0.9, 0.15, 0.6], [-1.2, 1.2, -1.1]], [[-0.07, 0.04, 0.06], [3.1, 0.05, -0.1]]),
    };
    Links::at(mode, camera, target)
}

fn direction(rng: &mut impl Rng) -> UnitVector3<f64> {
    UnitVector3::new_normalize(Vector3::from_fn(|_, _| normal(rng)))
}

/// The pixels of all points, `None` when one is not well inside the image.
fn true_pixels(
    intrinsics: &Intrinsics,
    points: &[Point3<f64>],
    camera_from_target: &Pose<Camera, Target>,
) -> Option<Vec<Vector2<f64>>> {
    let inside = |px: &Vector2<f64>| {
        px.min() > MARGIN_PX
            && px.x < f64::from(intrinsics.width) - 1.0 - MARGIN_PX
            && px.y < f64::from(intrinsics.height) - 1.0 - MARGIN_PX
    };
    points.iter().map(|p| pixel(intrinsics, &(camera_from_target.isometry() * p)).filter(inside)).collect()
}

/// Draws a trial. Trials with one seed and different numbers are independent; the same pair gives the same trial.
pub fn trial(cell: &Cell, seed: u64, number: u64) -> Trial {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(number);
    let points = BOARD.points();
    let intrinsics = intrinsics();
    let links = truth(cell.mode);
    let (mut true_base_from_tip, mut pixels) = (Vec::new(), Vec::new());
    while pixels.len() < cell.poses {
        let camera_from_target = Pose::from_isometry(Cone::PUBLISHED.draw(&BOARD, &mut rng));
        if let Some(px) = true_pixels(&intrinsics, &points, &camera_from_target) {
            true_base_from_tip.push(links.base_from_tip(&camera_from_target));
            pixels.push(px);
        }
    }
    let noise = &cell.noise;
    let mut views = Vec::with_capacity(cell.poses);
    for (index, (true_pose, px)) in true_base_from_tip.iter().zip(&pixels).enumerate() {
        let reported = reported(&mut rng, true_pose, noise);
        let seen = |(i, px): (usize, &Vector2<f64>)| Corner::new(i, noisy(&mut rng, px, noise.corner_px));
        views.push(View::new(format!("view {index}"), reported, px.iter().enumerate().map(seen).collect::<Vec<_>>()));
    }
    add_field(&mut rng, noise, &mut views);
    let wrong = vec![false; cell.poses];
    let mut trial = Trial { cell: *cell, points, intrinsics, links, true_base_from_tip, views, wrong };
    if cell.corrupted {
        trial.corrupt(number, &mut rng);
    }
    trial
}

impl Trial {
    /// Corrupts a tenth of the views, at least one, with the three faults in turn.
    fn corrupt(&mut self, number: u64, rng: &mut impl Rng) {
        let mut order: Vec<usize> = (0..self.views.len()).collect();
        order.shuffle(rng);
        order.truncate(self.views.len().div_ceil(10));
        for (k, index) in order.into_iter().enumerate() {
            self.wrong[index] = true;
            match (number as usize + k) % 3 {
                0 => self.wrong_robot_pose(index, rng),
                1 => self.count_from_the_other_end(index),
                _ => self.move_the_board(index, rng),
            }
        }
    }

    fn wrong_robot_pose(&mut self, index: usize, rng: &mut impl Rng) {
        let offset = direction(rng).into_inner() * rng.random_range(0.005..0.05);
        let turn = UnitQuaternion::from_axis_angle(&direction(rng), rng.random_range(1f64..10.0).to_radians());
        let error = Isometry3::from_parts(offset.into(), turn);
        let view = &mut self.views[index];
        view.base_from_tip = Pose::from_isometry(view.base_from_tip.isometry() * error);
    }

    fn count_from_the_other_end(&mut self, index: usize) {
        let last = self.points.len() - 1;
        for corner in &mut self.views[index].corners {
            corner.index = last - corner.index;
        }
    }

    /// The board slides in its plane while this image is taken. Corners that leave the image are lost.
    fn move_the_board(&mut self, index: usize, rng: &mut impl Rng) {
        let heading = rng.random_range(0.0..std::f64::consts::TAU);
        let shift = Vector3::new(heading.cos(), heading.sin(), 0.0) * rng.random_range(0.005..0.02);
        let camera_from_target = self.links.camera_from_target(&self.true_base_from_tip[index]);
        let (points, intrinsics) = (&self.points, &self.intrinsics);
        let moved = |corner: &Corner| {
            let pixel = |p: Point3<f64>| pixel(intrinsics, &(camera_from_target.isometry() * p));
            let point = points[corner.index];
            let px = corner.px + pixel(point + shift)? - pixel(point)?;
            is_in_image(intrinsics, &px).then_some(Corner { px, ..*corner })
        };
        let corners = &mut self.views[index].corners;
        *corners = corners.iter().filter_map(moved).collect();
    }
}
