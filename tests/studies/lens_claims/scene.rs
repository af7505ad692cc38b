//! Sessions whose lens and links are drawn too, and whose robot has wave-like errors across its workspace, which no model of it
//! fits.

use handeye_estimate::diagnose::Calibration;
use handeye_estimate::handeye::Mode;
use handeye_estimate::{CameraKnowledge, Observations, ObservedView};
use handeye_geometry::camera::{Distortion, Intrinsics};
use handeye_geometry::frames::Pose;
use handeye_geometry::targets::observation::Corner;
use handeye_geometry::targets::{Grid, TargetSpec};
use handeye_simulate::lens::pixel;
use handeye_simulate::links::{Links, normal};
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector2, Vector3};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

const COLUMNS: usize = 10;
const ROWS: usize = 7;
const SQUARE_M: f64 = 0.015;
const SIZE: (u32, u32) = (640, 480);

/// Parameters of a drawn session.
#[derive(Debug, Clone, Copy)]
pub struct Scene {
    pub mode: Mode,
    pub views: usize,
    /// Noise of a corner per axis, pixels.
    pub corner_px: f64,
    /// Errors that the corners of one view share, a bend of the grid in the image, pixels.
    pub shared_px: f64,
    /// Noise of the robot per axis, metres and radians.
    pub robot: (f64, f64),
    /// Errors of the robot that depend on where it is: waves across the workspace of this amplitude, metres; radians are a
    /// fifth of a degree per millimetre.
    pub waves_m: f64,
    /// Largest tilt of the board, degrees.
    pub tilt_deg: f64,
    /// Largest rotation of the camera about its axis, degrees.
    pub roll_deg: f64,
    /// Largest distance of the board from the axis, as a fraction of its distance.
    pub beside: f64,
    /// Deflection of the board's centre, metres.
    pub bend_m: f64,
    /// Print error of every point of the board within its plane, per axis, metres.
    pub print_m: f64,
    /// fx over fy, minus one, for images that were scaled in one direction.
    pub aspect: f64,
}

impl Scene {
    /// A good robot, a good camera and a flat board.
    pub const fn new(mode: Mode, views: usize) -> Self {
        Self {
            mode,
            views,
            corner_px: 0.1,
            shared_px: 0.0,
            robot: (1e-4, 3.5e-4),
            waves_m: 0.0,
            tilt_deg: 35.0,
            roll_deg: 60.0,
            beside: 0.15,
            bend_m: 0.0,
            print_m: 0.0,
            aspect: 0.0,
        }
    }

    pub fn draw(&self, seed: u64) -> Session {
        let mut rng = ChaCha8Rng::seed_from_u64(seed ^ 0x1e45);
        let rng = &mut rng;
        let focal = rng.random_range(550.0..750.0);
        let lens = Intrinsics {
            fx: focal,
            fy: focal * rng.random_range(0.999..1.001) / (1.0 + self.aspect),
            cx: rng.random_range(310.0..330.0),
            cy: rng.random_range(230.0..250.0),
            distortion: Distortion::BrownConrady([
                rng.random_range(-0.2..0.05),
                rng.random_range(-0.05..0.1),
                rng.random_range(-1e-3..1e-3),
                rng.random_range(-1e-3..1e-3),
                rng.random_range(-0.02..0.02),
            ]),
            width: SIZE.0,
            height: SIZE.1,
        };
        let links = links(rng, self.mode);
        let waves = Waves::draw(rng, self.waves_m);
        // With random numbers of their own, so that nothing else changes.
        let mut of_print = ChaCha8Rng::seed_from_u64(seed ^ 0xb0a4d);
        let print = (0..COLUMNS * ROWS).map(|_| self.print_m * normal3(&mut of_print)).collect::<Vec<_>>();
        let mut views = Vec::new();
        while views.len() < self.views {
            let camera_from_target = self.seen_at(rng);
            let true_tip = *links.base_from_tip(&Pose::from_isometry(camera_from_target)).isometry();
            let Some(corners) = self.corners(rng, &lens, &print, &camera_from_target) else { continue };
            let noise = Isometry3::new(normal3(rng) * self.robot.0, normal3(rng) * self.robot.1);
            let reported = Pose::from_isometry(true_tip * waves.at(&true_tip) * noise);
            views.push(ObservedView::new(format!("{:03}", views.len()), Some(reported), Some(corners.into())));
        }
        Session { lens, links, views }
    }

    fn seen_at(&self, rng: &mut ChaCha8Rng) -> Isometry3<f64> {
        let tilt = self.tilt_deg.to_radians() * rng.random::<f64>().sqrt();
        let azimuth = rng.random_range(0.0..std::f64::consts::TAU);
        let roll = rng.random_range(-self.roll_deg..self.roll_deg).to_radians();
        let rotation = UnitQuaternion::from_scaled_axis(Vector3::new(azimuth.cos(), azimuth.sin(), 0.0) * tilt)
            * UnitQuaternion::from_scaled_axis(Vector3::z() * roll);
        let distance = rng.random_range(0.35..0.6);
        let beside = [0, 1].map(|_| rng.random_range(-self.beside..self.beside) * distance);
        let middle = Vector3::new((COLUMNS - 1) as f64, (ROWS - 1) as f64, 0.0) * (0.5 * SQUARE_M);
        let place = Vector3::new(beside[0], beside[1], distance);
        Isometry3::from_parts(place.into(), rotation) * Translation3::from(-middle)
    }

    fn corners(
        &self,
        rng: &mut ChaCha8Rng,
        lens: &Intrinsics,
        print: &[Vector3<f64>],
        camera_from_target: &Isometry3<f64>,
    ) -> Option<Vec<Corner>> {
        let shared: [Vector2<f64>; 6] =
            std::array::from_fn(|_| Vector2::new(normal(rng), normal(rng)) * (0.5 * self.shared_px));
        let mut corners = Vec::with_capacity(COLUMNS * ROWS);
        for row in 0..ROWS {
            for column in 0..COLUMNS {
                let (u, v) =
                    (2.0 * column as f64 / (COLUMNS - 1) as f64 - 1.0, 2.0 * row as f64 / (ROWS - 1) as f64 - 1.0);
                let height = self.bend_m * (1.0 - u * u);
                let printed = print[row * COLUMNS + column].xy();
                let point =
                    Point3::new(column as f64 * SQUARE_M + printed.x, row as f64 * SQUARE_M + printed.y, height);
                let px = pixel(lens, &(camera_from_target * point))?;
                let inside = px.min() > 2.0 && px.x < f64::from(SIZE.0) - 3.0 && px.y < f64::from(SIZE.1) - 3.0;
                if !inside {
                    return None;
                }
                let bend: Vector2<f64> =
                    shared.iter().zip([1.0, u, v, u * v, u * u, v * v]).map(|(by, mode)| by * mode).sum();
                let noise = Vector2::new(normal(rng), normal(rng)) * self.corner_px;
                corners.push(Corner::new(row * COLUMNS + column, px + noise + bend));
            }
        }
        Some(corners)
    }
}

/// What was drawn.
pub struct Session {
    pub lens: Intrinsics,
    links: Links,
    views: Vec<ObservedView>,
}

impl Session {
    /// With the lens given, its centre off by this many pixels.
    pub fn given(&self, centre_off: [f64; 2]) -> Observations {
        let [across, down] = centre_off;
        let given = Intrinsics { cx: self.lens.cx + across, cy: self.lens.cy + down, ..self.lens };
        Self::observed(Some(self.links.mode), CameraKnowledge::Fixed(given), self.views.clone())
    }

    /// With the lens to be estimated.
    pub fn unknown(&self) -> Observations {
        Self::observed(Some(self.links.mode), CameraKnowledge::NOTHING, self.views.clone())
    }

    /// What the camera saw, without a robot.
    pub fn alone(&self) -> Observations {
        let without = |view: &ObservedView| ObservedView { base_from_tip: None, ..view.clone() };
        Self::observed(None, CameraKnowledge::NOTHING, self.views.iter().map(without).collect())
    }

    /// Both halves of a session whose lens has to be estimated: the views before the middle and those after it.
    pub fn halves(&self) -> [Observations; 2] {
        let (first, second) = self.views.split_at(self.views.len() / 2);
        [first, second].map(|views| Self::observed(Some(self.links.mode), CameraKnowledge::NOTHING, views.to_vec()))
    }

    fn observed(mode: Option<Mode>, camera: CameraKnowledge, views: Vec<ObservedView>) -> Observations {
        let target = TargetSpec::Chessboard(Grid { columns: COLUMNS, rows: ROWS, square_m: SQUARE_M });
        Observations { mode, target, image_size: SIZE, camera, views }
    }

    /// Error of a point where the camera saw the target, metres, and the stated one.
    pub fn errors_m(&self, calibration: &Calibration) -> Option<(f64, Option<f64>)> {
        let point = calibration.joint.as_ref()?.reference_point;
        let answer = calibration.hand_eye.as_ref()?.mount_from_camera();
        let truth = self.links.mount_from_camera.isometry() * point;
        Some(((answer.isometry() * point - truth).norm(), calibration.tip_error_95_m()))
    }
}

/// Camera and target where they are fixed.
fn links(rng: &mut ChaCha8Rng, mode: Mode) -> Links {
    let mut near = |rotation: [f64; 3], place: [f64; 3]| {
        let turn = UnitQuaternion::from_scaled_axis(Vector3::from(rotation) + normal3(rng) * 0.1);
        Isometry3::from_parts((Vector3::from(place) + normal3(rng) * 0.03).into(), turn)
    };
    let (camera, target) = match mode {
        Mode::EyeInHand => (near([0.1, -0.1, 1.3], [0.05, 0.0, 0.08]), near([3.1, 0.0, 0.1], [0.45, 0.05, 0.0])),
        Mode::EyeToHand => (near([3.0, 0.1, 0.0], [0.45, 0.0, 1.0]), near([0.0, -0.1, 0.3], [-0.05, -0.05, 0.04])),
    };
    Links { mode, mount_from_camera: Pose::from_isometry(camera), anchor_from_target: Pose::from_isometry(target) }
}

/// Errors of a robot that depend on where it is.
struct Waves {
    amplitude_m: f64,
    directions: [Vector3<f64>; 6],
    phases: [f64; 6],
}

impl Waves {
    fn draw(rng: &mut ChaCha8Rng, amplitude_m: f64) -> Self {
        // Half a turn to one and a half turns across half a metre.
        let directions = std::array::from_fn(|_| normal3(rng).normalize() * rng.random_range(6.0..18.0));
        Self { amplitude_m, directions, phases: std::array::from_fn(|_| rng.random_range(0.0..6.3)) }
    }

    fn at(&self, tip: &Isometry3<f64>) -> Isometry3<f64> {
        let wave =
            |k: usize| (self.directions[k].dot(&tip.translation.vector) + self.phases[k]).sin() * self.amplitude_m;
        let rad_per_m = 0.2f64.to_radians() / 1e-3;
        Isometry3::new(Vector3::from_fn(|k, _| wave(k)), Vector3::from_fn(|k, _| wave(k + 3) * rad_per_m))
    }
}

fn normal3(rng: &mut ChaCha8Rng) -> Vector3<f64> {
    Vector3::from_fn(|_, _| normal(rng))
}
