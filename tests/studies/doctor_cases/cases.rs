//! Forty degenerate or hostile sessions, and the code that each has to get.

use handeye_estimate::Observations;
use handeye_estimate::diagnose::doctor::Diagnosis;
use handeye_estimate::diagnose::findings::FindingCode as Code;
use handeye_estimate::diagnose::findings::Severity;
use handeye_estimate::handeye::Mode;
use handeye_geometry::frames::Pose;
use handeye_geometry::observations::Noise;
use handeye_geometry::planar_pose;
use handeye_geometry::testing::GRID;
use handeye_simulate::session::{Fault, REALISTIC, Setup, camera, changed, observed, observed_of};
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector2, Vector3, Vector6};

pub struct Case {
    pub name: &'static str,
    /// One of these has to be among the findings, as a warning or a problem.
    pub expected: Vec<Code>,
    pub observations: Observations,
}

impl Case {
    /// What was reported, or what is wrong with it.
    pub fn verdict(&self, examined: impl Fn(&Observations) -> Diagnosis) -> Result<String, String> {
        let diagnosis = examined(&self.observations);
        let grave: Vec<Code> =
            diagnosis.findings.iter().filter(|f| f.severity >= Severity::Warning).map(|f| f.code).collect();
        if diagnosis.is_healthy() {
            return Err("a false \"ok\"".to_owned());
        }
        if grave.iter().any(|code| self.expected.contains(code)) {
            return Ok(format!("{grave:?}"));
        }
        let best = diagnosis.hypotheses.first();
        Err(format!("{:?} expected, {grave:?} said; {:?} {best:?}", self.expected, diagnosis.untested))
    }
}

const IN_HAND: Mode = Mode::EyeInHand;
const TO_HAND: Mode = Mode::EyeToHand;

fn healthy(mode: Mode, seed: u64) -> Observations {
    observed(&Setup::new(mode, 20, seed))
}

/// Views of the board with rotations of the camera about given axes.
fn turned(
    mode: Mode,
    seed: u64,
    turn: impl Fn(f64, usize) -> Vector3<f64>,
    shift: impl Fn(f64) -> Vector3<f64>,
) -> Observations {
    let setup = Setup { seed, ..Setup::new(mode, 12, seed) };
    let centre = Vector3::new(4.5, 3.0, 0.0) * GRID.square_m;
    let planned: Vec<Isometry3<f64>> = (0..12)
        .map(|i| {
            let part = f64::from(i) / 5.5 - 1.0;
            let rotation = UnitQuaternion::from_scaled_axis(turn(part, i as usize));
            let place = Vector3::new(0.0, 0.0, 0.5) + shift(part);
            Isometry3::from_parts(Translation3::from(place), rotation) * Translation3::from(-centre)
        })
        .collect();
    observed_of(&setup, &planned)
}

fn still(_: f64) -> Vector3<f64> {
    Vector3::zeros()
}

/// A wave that goes back and forth several times per session.
fn wave(part: f64) -> Vector3<f64> {
    Vector3::new((5.0 * part).sin(), (7.0 * part).cos(), 1.5 * (4.0 * part).sin()) * 0.03
}

fn slipped(mode: Mode, seed: u64, from: usize, twist: [f64; 6]) -> Observations {
    let fault = Fault { board_moved: Some((from, Vector6::from(twist))), ..Fault::default() };
    observed(&Setup::new(mode, 20, seed).with(fault))
}

fn scaled(mode: Mode, seed: u64, scale: f64) -> Observations {
    observed(&Setup::new(mode, 20, seed).with(Fault { scale, ..Fault::default() }))
}

fn in_motion(seed: u64, views: &[usize], twist: [f64; 6]) -> Observations {
    let moving = views.iter().map(|v| (*v, Vector6::from(twist))).collect();
    observed(&Setup::new(IN_HAND, 20, seed).with(Fault { moving, ..Fault::default() }))
}

fn edited(mut observations: Observations, edit: impl FnOnce(&mut Observations)) -> Observations {
    edit(&mut observations);
    observations
}

fn millimetres(mut p: Isometry3<f64>) -> Isometry3<f64> {
    p.translation.vector *= 1e3;
    p
}

fn metres(mut p: Isometry3<f64>) -> Isometry3<f64> {
    p.translation.vector *= 1e-3;
    p
}

/// Written w x y z, read x y z w.
fn w_first(mut p: Isometry3<f64>) -> Isometry3<f64> {
    let q = p.rotation.coords;
    p.rotation = UnitQuaternion::from_quaternion(Quaternion::new(q.z, q.w, q.x, q.y));
    p
}

/// Written x y z w, read w x y z.
fn w_last(mut p: Isometry3<f64>) -> Isometry3<f64> {
    let q = p.rotation.coords;
    p.rotation = UnitQuaternion::from_quaternion(Quaternion::new(q.x, q.y, q.z, q.w));
    p
}

fn with_mode(mut observations: Observations, mode: Mode) -> Observations {
    observations.mode = Some(mode);
    observations
}

/// Robot poses shifted by one row.
fn out_of_step(mut observations: Observations) -> Observations {
    let poses: Vec<_> = observations.views.iter().map(|v| v.base_from_tip).collect();
    let count = poses.len();
    for (i, view) in observations.views.iter_mut().enumerate() {
        view.base_from_tip = poses[(i + 1) % count];
    }
    observations
}

fn seen_in(mut observations: Observations, views: usize) -> Observations {
    for view in observations.views.iter_mut().skip(views) {
        view.corners = None;
    }
    observations
}

fn case(name: &'static str, expected: &[Code], observations: Observations) -> Case {
    Case { name, expected: expected.to_vec(), observations }
}

pub fn cases() -> Vec<Case> {
    let mut cases = degenerate();
    cases.extend(gross());
    cases.extend(hostile());
    cases
}

/// Sets that cannot determine an answer, or hardly.
fn degenerate() -> Vec<Case> {
    let alike = [Code::ViewsAlike];
    let one_axis = [Code::OneRotationAxis];
    vec![
        case("no views", &[Code::TooFewViews], edited(healthy(IN_HAND, 1), |o| o.views.clear())),
        case("one view", &[Code::TooFewViews], edited(healthy(IN_HAND, 2), |o| o.views.truncate(1))),
        case("two views", &[Code::TooFewViews], edited(healthy(TO_HAND, 3), |o| o.views.truncate(2))),
        case("target seen in two views of twenty", &[Code::TooFewViews], seen_in(healthy(IN_HAND, 4), 2)),
        case("target never found", &[Code::TargetNotFound], seen_in(healthy(IN_HAND, 5), 0)),
        case("translation only, eye in hand", &alike, turned(IN_HAND, 6, |_, _| Vector3::zeros(), wave)),
        case("translation only, eye to hand", &alike, turned(TO_HAND, 7, |_, _| Vector3::zeros(), wave)),
        case("turns about the camera's x only", &one_axis, turned(IN_HAND, 8, |p, _| Vector3::x() * 0.5 * p, wave)),
        case("turns about the camera's y only", &one_axis, turned(IN_HAND, 9, |p, _| Vector3::y() * 0.5 * p, still)),
        case("roll only", &one_axis, turned(IN_HAND, 10, |p, _| Vector3::z() * p, wave)),
        case("turns about one axis, eye to hand", &one_axis, turned(TO_HAND, 11, |p, _| Vector3::x() * 0.6 * p, wave)),
        case(
            "turns about one oblique axis",
            &one_axis,
            turned(IN_HAND, 12, |p, _| Vector3::new(0.3, 0.2, 0.4) * p, wave),
        ),
        case("the same pose again and again", &alike, turned(IN_HAND, 13, |_, _| Vector3::x() * 0.2, still)),
        case(
            "two poses, repeated",
            &one_axis,
            turned(IN_HAND, 14, |_, i| Vector3::new(0.4, 0.1, 0.3) * f64::from(i % 2 == 0), still),
        ),
        case(
            "all views within a few degrees",
            &alike,
            turned(IN_HAND, 15, |p, i| Vector3::new(0.05 * p, 0.05 * (i % 3) as f64, 0.03), wave),
        ),
        case(
            "hardly any turn about a second axis",
            &[Code::WeakRotation],
            turned(IN_HAND, 16, |p, i| Vector3::new(0.05 * (i % 3) as f64, 0.0, p), wave),
        ),
        case(
            "a pose that is not a number",
            &[Code::NotFinite],
            edited(healthy(IN_HAND, 17), |o| {
                o.views[3].base_from_tip = Some(Pose::from_translation_xyzw([f64::NAN; 3], [0.0, 0.0, 0.0, 1.0]));
            }),
        ),
    ]
}

/// Poses that were written or read differently than stated.
fn gross() -> Vec<Case> {
    let inverted = [Code::InvertedPoses, Code::WrongMode];
    let unit = [Code::WrongLengthUnit];
    let order = [Code::WrongQuaternionOrder];
    vec![
        case("inverted poses, eye in hand", &[Code::InvertedPoses], changed(healthy(IN_HAND, 21), |p| p.inverse())),
        case("inverted poses, eye to hand", &[Code::InvertedPoses], changed(healthy(TO_HAND, 22), |p| p.inverse())),
        case("eye to hand stated as eye in hand", &inverted, with_mode(healthy(TO_HAND, 23), IN_HAND)),
        case("eye in hand stated as eye to hand", &inverted, with_mode(healthy(IN_HAND, 24), TO_HAND)),
        case("millimetres as metres, eye in hand", &unit, changed(healthy(IN_HAND, 25), millimetres)),
        case("millimetres as metres, eye to hand", &unit, changed(healthy(TO_HAND, 26), millimetres)),
        case("metres as millimetres", &unit, changed(healthy(IN_HAND, 27), metres)),
        case("quaternion w first", &order, changed(healthy(IN_HAND, 28), w_first)),
        case("quaternion w last", &order, changed(healthy(TO_HAND, 29), w_last)),
        case("inverted and in millimetres", &unit, changed(healthy(IN_HAND, 30), |p| millimetres(p).inverse())),
        case("w first and in millimetres", &order, changed(healthy(IN_HAND, 31), |p| w_first(millimetres(p)))),
        case(
            "target poses inverted, eye in hand",
            &[Code::InvertedTargetPoses],
            with_target_poses(healthy(IN_HAND, 33), |pose| pose.inverse()),
        ),
        case(
            "target poses inverted, z of the target towards the camera",
            &[Code::InvertedTargetPoses],
            with_target_poses(healthy(IN_HAND, 34), |pose| (pose * half_turn_about_x()).inverse()),
        ),
        case("poses and images out of step", &[Code::ShiftedPoses], out_of_step(healthy(IN_HAND, 32))),
    ]
}

/// The session with the poses of the target, measured elsewhere, instead of the corners.
fn with_target_poses(
    mut observations: Observations,
    change: impl Fn(Isometry3<f64>) -> Isometry3<f64>,
) -> Observations {
    let target = observations.target;
    for view in &mut observations.views {
        let corners = view.corners.take().unwrap_or_default();
        let pose = planar_pose::camera_from_target(&corners, &target, &camera()).ok();
        view.camera_from_target = pose.map(|pose| Pose::from_isometry(change(*pose.isometry())));
    }
    observations
}

fn half_turn_about_x() -> UnitQuaternion<f64> {
    UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI)
}

/// Sessions with something wrong in them.
fn hostile() -> Vec<Case> {
    let outlier = [Code::OutlierView];
    vec![
        case("square 2 % too small", &[Code::WrongScale], scaled(IN_HAND, 41, 0.02)),
        case("square 11 % off, digits swapped", &[Code::WrongScale], scaled(TO_HAND, 42, -0.1)),
        case("board slipped 5 mm", &[Code::BoardMoved], slipped(IN_HAND, 43, 12, [5e-3, 0.0, 0.0, 0.0, 0.0, 0.0])),
        case("board turned by 1°", &[Code::BoardMoved], slipped(TO_HAND, 44, 9, [0.0, 0.0, 0.0, 0.0, 0.0, 0.017])),
        case(
            "camera bumped",
            &[Code::CameraMoved],
            observed(&Setup::new(IN_HAND, 20, 45).with(Fault {
                camera_moved: Some((8, Vector6::new(1e-3, 0.0, 0.0, 0.01, 0.01, 0.0))),
                ..Fault::default()
            })),
        ),
        case("one view in motion", &outlier, in_motion(46, &[7], [3e-3, -2e-3, 1e-3, 0.005, 0.004, 0.0])),
        case("three views in motion", &outlier, in_motion(47, &[2, 9, 15], [-3e-3, 2e-3, 4e-3, 0.0, 0.02, 0.01])),
        case(
            "a pose repeated for two images",
            &outlier,
            edited(healthy(IN_HAND, 48), |o| o.views[11].base_from_tip = o.views[10].base_from_tip),
        ),
        case(
            "board read the wrong way round in two views",
            &outlier,
            edited(healthy(IN_HAND, 49), |o| {
                for view in [4, 13] {
                    for corner in o.views[view].corners.iter_mut().flatten() {
                        corner.index = GRID.len() - 1 - corner.index;
                    }
                }
            }),
        ),
        case(
            "three corners wrong",
            &[Code::OutlierCorners],
            edited(healthy(IN_HAND, 50), |o| {
                for (view, corner) in [(3, 10), (3, 41), (8, 69)] {
                    if let Some(corners) = &mut o.views[view].corners {
                        corners[corner].px += Vector2::new(9.0, -7.0);
                    }
                }
            }),
        ),
        case(
            "joint 3 off by 0.5°",
            &[Code::JointOffset],
            observed(
                &Setup { joints: true, ..Setup::new(IN_HAND, 20, 51) }
                    .with(Fault { joint: Some((2, 0.5f64.to_radians())), ..Fault::default() }),
            ),
        ),
        case(
            "board bent by 1 mm",
            &[Code::BoardBent],
            observed(
                &Setup { estimated: true, ..Setup::new(TO_HAND, 20, 56) }
                    .with(Fault { warp_m: 1e-3, ..Fault::default() }),
            ),
        ),
        case(
            "focal length given 3 % wrong",
            &[Code::WrongIntrinsics],
            observed(&Setup::new(IN_HAND, 20, 52).with(Fault { focal: 0.03, ..Fault::default() })),
        ),
        case(
            "poses of another session",
            &[Code::InconsistentPoses],
            edited(healthy(IN_HAND, 53), |o| {
                for (view, other) in o.views.iter_mut().zip(healthy(IN_HAND, 54).views) {
                    view.base_from_tip = other.base_from_tip;
                }
            }),
        ),
        case(
            "an arm that shakes by 5 mm and 1°",
            &[Code::InconsistentPoses],
            observed(&Setup {
                noise: Noise { robot_m: 5e-3, robot_rad: 0.017, ..REALISTIC },
                ..Setup::new(IN_HAND, 20, 55)
            }),
        ),
    ]
}
