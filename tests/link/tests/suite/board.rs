//! A board that moves and hides, and frames of one instant, against the real cell over a socket.

use handeye_cell::scene::Scene;
use handeye_coppeliasim::cell::{Arm, BoardMotion, BoardPath, CameraFeed, CellPaths, Frame};
use handeye_coppeliasim::{CallOptions, ConnectionOptions, Endpoint, LinkError};
use handeye_geometry::frames::PointIn;
use handeye_server::{CellConfig, CellServer};
use nalgebra::{Point3, Vector3};

struct Bench {
    arm: Arm,
    camera: CameraFeed,
    _server: CellServer,
}

impl Bench {
    /// A cell whose passes come only when the arm's client steps, after the first.
    fn stepped(scene: Scene) -> Self {
        let config = CellConfig { real_time: Some(false), ..CellConfig::new(scene) };
        let server = CellServer::start(config).expect("a free port");
        let endpoint: Endpoint = server.endpoint().parse().expect("an address");
        let (options, paths) = (ConnectionOptions::default(), CellPaths::default());
        let mut arm = Arm::connect(&endpoint, &options, &paths).expect("the scene is whole");
        let camera = CameraFeed::connect(&endpoint, &options, &paths).expect("the scene is whole");
        arm.sim().set_stepping(true).expect("a call");
        arm.sim().start_simulation().expect("a call");
        let mut bench = Self { arm, camera, _server: server };
        bench.step(1);
        bench
    }

    fn step(&mut self, passes: usize) {
        for _ in 0..passes {
            self.arm.sim().step(&CallOptions::default()).expect("a pass");
        }
    }

    fn grab(&mut self) -> Frame {
        self.camera.grab().expect("a frame")
    }

    /// How far behind the sheet, by moment and truth, the point is that is seen by the pixel in the middle of the board
    /// \[m\].
    fn depth_error(&mut self, frame: &Frame) -> f64 {
        let truth = self.camera.ground_truth().expect("published");
        let camera_from_base = (frame.base_from_tip * truth.tip_from_camera).inverse();
        let camera_from_target = camera_from_base * frame.base_from_target_true.expect("published");
        let centre = (camera_from_target * PointIn::new(Point3::new(0.0675, 0.045, 0.0))).point();
        let px = truth.intrinsics.project(&centre).expect("in front");
        let (column, row) = (px.x.round() as u32, px.y.round() as u32);
        let seen = frame.depth.point(column, row, 3.5, &truth.intrinsics).expect("in view").expect("a surface");
        (camera_from_target.inverse() * seen).point().z
    }
}

#[test]
fn a_frame_is_of_one_instant_while_joints_are_put_and_the_board_moves() {
    let mut bench = Bench::stepped(Scene::reference().expect("valid"));
    let joints: Vec<_> = (0..6).map(|i| bench.arm.sim().get_object_index("/UR5/joint", i).expect("a joint")).collect();
    bench.arm.move_board(&BoardMotion::along(BoardPath::RandomWalk, 0.2)).expect("a built-in cell");
    let kinematics = bench.arm.kinematics().expect("calls").expect("it is the UR5");
    let mut before = bench.grab();
    for pass in 0..40_u32 {
        let mut goal = before.joints;
        goal[1] += 0.004;
        goal[2] -= 0.007;
        for (joint, angle_rad) in joints.iter().zip(&goal) {
            bench.arm.sim().set_joint_position(*joint, *angle_rad).expect("a call");
        }
        assert_eq!(bench.arm.joint_values(), Ok(goal), "they are there already");
        assert_eq!(bench.grab(), before, "and not in the images yet");
        bench.step(1);
        let frame = bench.grab();
        assert_eq!(frame.joints, goal);
        assert!((frame.sim_time_s - f64::from(pass + 2) * 0.05).abs() < 1e-9, "{} s", frame.sim_time_s);
        let (distance_m, angle_rad) = frame.base_from_tip.distance_to(&kinematics.tip(&goal));
        assert!(distance_m < 1e-9 && angle_rad < 1e-7);
        // The joints alone move the camera by some millimetres per pass.
        let error_m = bench.depth_error(&frame);
        assert!(error_m.abs() < 1e-6, "pass {pass}: {error_m} m");
        before = frame;
    }
}

#[test]
fn the_board_goes_as_it_is_told_and_comes_to_rest() {
    let mut bench = Bench::stepped(Scene::reference().expect("valid"));
    let place = |frame: &Frame| frame.base_from_target_true.expect("published").translation();
    let start = place(&bench.grab());
    let motion = BoardMotion { size_m: Some(0.03), tilt_deg: Some(0.0), ..BoardMotion::along(BoardPath::Circle, 0.06) };
    bench.arm.move_board(&motion).expect("a built-in cell");
    bench.step(21);
    for _ in 0..10 {
        let a = place(&bench.grab());
        bench.step(1);
        let b = place(&bench.grab());
        assert!(((a - start).norm() - 0.03).abs() < 1e-9, "on its circle");
        assert!(((b - a).norm() / 0.05 - 0.06).abs() < 1e-4, "{} m/s", (b - a).norm() / 0.05);
    }
    bench.arm.move_board(&BoardMotion::along(BoardPath::Still, 0.0)).expect("a built-in cell");
    bench.step(13);
    let at_rest = place(&bench.grab());
    bench.step(5);
    assert_eq!(place(&bench.grab()), at_rest);
}

#[test]
fn a_hidden_board_is_not_in_the_depth_and_shows_again() {
    let mut bench = Bench::stepped(Scene::reference().expect("valid"));
    let seen = bench.grab();
    bench.arm.show_board(false).expect("a built-in cell");
    bench.step(1);
    let hidden = bench.grab();
    assert_eq!(hidden.base_from_target_true, seen.base_from_target_true);
    // The support of the sheet is half a millimetre behind it.
    let error_m = bench.depth_error(&hidden);
    assert!((error_m - 5e-4).abs() < 1e-5, "{error_m} m");
    assert_ne!(hidden.rgb, seen.rgb);
    bench.arm.show_board(true).expect("a built-in cell");
    bench.step(1);
    assert_eq!(bench.grab().rgb, seen.rgb);
}

#[test]
fn a_motion_out_of_range_is_refused_by_name() {
    let mut bench = Bench::stepped(Scene::reference().expect("valid"));
    let too_fast = BoardMotion::along(BoardPath::Circle, 3.0);
    let refused = bench.arm.move_board(&too_fast).expect_err("3 m/s");
    assert!(matches!(&refused, LinkError::Remote { message, .. } if message.contains("speed_m_s is 3")), "{refused}");
}

#[test]
fn a_frame_of_a_stopped_simulation_has_the_present_state_and_no_board() {
    let mut bench = Bench::stepped(Scene::reference().expect("valid"));
    bench.arm.sim().stop_simulation().expect("a call");
    bench.step(5);
    let frame = bench.grab();
    assert_eq!(frame.base_from_target_true, None);
    assert_eq!(Ok(frame.joints), bench.arm.joint_values());
    let reported = bench.arm.base_from_tip().expect("a call");
    assert_eq!(frame.base_from_tip, reported);
}

#[test]
fn the_tracking_scene_moves_its_board_by_itself_in_its_plane() {
    let mut bench = Bench::stepped(Scene::tracking().expect("valid"));
    let centre = |frame: &Frame| {
        (frame.base_from_target_true.expect("published") * PointIn::new(Point3::new(0.0675, 0.045, 0.0))).point()
    };
    let first = bench.grab();
    assert_eq!(bench.camera.info().time_step_s, 0.03);
    bench.step(50);
    let (a, from) = (centre(&bench.grab()), centre(&first));
    assert!(((a - from).norm() - 0.04).abs() < 1e-3, "{} m", (a - from).norm());
    bench.step(1);
    let b = centre(&bench.grab());
    let velocity: Vector3<f64> = (b - a) / 0.03;
    assert!((velocity.norm() - 0.1).abs() < 1e-3 && velocity.y.abs() < 5e-3, "{velocity}");
}
