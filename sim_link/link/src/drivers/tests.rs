//! The workers over a driver that serves the built-in cell on a socket.

use std::io::{BufRead as _, Write as _};
use std::net::TcpListener;
use std::sync::Arc;
use std::thread;

use handeye_cell::scene::Scene;
use handeye_coppeliasim::CancelToken;
use handeye_coppeliasim::cell::ArmKinematics;
use handeye_driver::fake::{Fake, FakeOptions, FakePart};
use handeye_driver::message::Ability;
use handeye_geometry::frames::Pose;
use handeye_plan::{Obstacle, Surroundings};

use super::*;
use crate::{Axis, Jog, JogFrame, MotionGoal, MotionOutcome, Moves, RobotState};
use crate::{JogRequest, Newest, RawFrame};
use handeye_wording::English;

/// Serves one part of a cell to everybody who connects; the address.
fn served(part: FakePart) -> String {
    served_without(part, Vec::new())
}

/// The same for a driver that reports some abilities as missing.
fn served_without(part: FakePart, cannot: Vec<Ability>) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
    let address = format!("tcp://{}", listener.local_addr().expect("bound"));
    let scene = Scene::reference().expect("the reference scene");
    let fake = Arc::new(Fake::start(FakeOptions { part, cannot, ..FakeOptions::new(scene) }).expect("a cell"));
    thread::spawn(move || {
        for stream in listener.incoming().map_while(Result::ok) {
            let fake = Arc::clone(&fake);
            thread::spawn(move || {
                let input = std::io::BufReader::new(stream.try_clone().expect("a socket"));
                let _ended = fake.converse(input, stream);
            });
        }
    });
    address
}

fn connector(robot: Option<String>, camera: Option<String>) -> DrivenCell {
    DrivenCell::new(Drivers { robot, camera })
}

fn first_state(control: &mut dyn ControlPort) -> RobotState {
    loop {
        if let Some(state) = control.state().expect("connected") {
            return state;
        }
        thread::yield_now();
    }
}

fn image(camera: &mut dyn CameraPort, seen_s: Option<f64>) -> RawFrame {
    loop {
        if let Newest::Frame(frame) = camera.newest(seen_s).expect("connected") {
            return *frame;
        }
    }
}

#[test]
fn a_cell_behind_a_driver_is_seen_read_and_moved_once_somebody_allows_it() {
    let connector = connector(Some(served(FakePart::Both)), None);
    let shutdown = CancelToken::default();
    let mut control = connector.control(&shutdown).expect("connected").port;
    let facts = control.facts().expect("connected");
    assert_eq!((facts.joints.len(), facts.moves), (6, Moves::OnceArmed { joints: true, tip: true }));
    assert!(!facts.poses_are_typed && facts.truth.is_none());
    let mut camera = connector.camera(&shutdown).expect("connected").port;
    // The first images may come before the clocks are related.
    let mut frame = image(camera.as_mut(), None);
    while frame.base_from_tip.is_none() {
        frame = image(camera.as_mut(), Some(frame.sim_time_s));
    }
    assert_eq!((frame.rgb.dimensions(), frame.depth.is_some()), ((640, 480), facts.has_depth));
    let later = image(camera.as_mut(), Some(frame.sim_time_s));
    assert!(later.sim_time_s > frame.sim_time_s);

    let mut motion = connector.motion(&shutdown).expect("connected").port;
    let before = first_state(control.as_mut());
    assert!(!before.is_armed);
    let jog = Jog::Translate { frame: JogFrame::Base, axis: Axis::Z, forward: true };
    let request = JogRequest { jog, tip_from_camera: None, speed: 0.5 };
    let refused = motion.jog_step(&request, 0.02, &shutdown).expect("connected");
    assert!(matches!(refused, MotionOutcome::Refused(_)), "{refused:?}");
    control.arm(true).expect("allowed");
    assert_eq!(motion.jog_step(&request, 0.02, &shutdown), Ok(MotionOutcome::Arrived));
    let moved = (first_state(control.as_mut()).base_from_tip.translation() - before.base_from_tip.translation()) * 1e3;
    assert!((moved - nalgebra::Vector3::new(0.0, 0.0, 20.0)).norm() < 0.2, "moved by {moved} mm");
    let back = MotionGoal::Joints(before.joints_rad);
    assert_eq!(motion.move_to(&back, 0.5, &shutdown), Ok(MotionOutcome::Arrived));
    control.arm(false).expect("taken back");
    assert!(matches!(motion.move_to(&back, 0.5, &shutdown), Ok(MotionOutcome::Refused(_))));
    control.stop().expect("a stop is always heard");
}

/// The arm as the workbench drives it, once it has been at rest.
fn known_arm(control: &mut dyn ControlPort) -> ArmKinematics {
    loop {
        if let Some(arm) = control.facts().expect("connected").arm {
            return arm;
        }
        while !control.facts_differ() {
            thread::yield_now();
        }
    }
}

#[test]
fn an_arm_whose_flange_is_reported_beside_its_tip_is_planned_for_and_keeps_out_of_boxes() {
    let connector = connector(Some(served(FakePart::Both)), None);
    let shutdown = CancelToken::default();
    let mut control = connector.control(&shutdown).expect("connected").port;
    let mut motion = connector.motion(&shutdown).expect("connected").port;
    let arm = known_arm(control.as_mut());
    let here = first_state(control.as_mut());
    assert!(arm.fits(&here.joints_rad, &here.base_from_tip));
    let robot = motion.robot(0.5).expect("connected").expect("its chain is known");
    assert_eq!(robot.joints.len(), 6);
    assert!(robot.arm.is_free(&robot.joints, &robot.around, 0.0), "the plane under the arm is kept clear");

    control.arm(true).expect("allowed");
    let mut there = here.joints_rad;
    there[0] += 0.5;
    let goal = MotionGoal::Joints(there);
    let at = *arm.tip(&there).isometry();
    let wall = Surroundings::of(vec![Obstacle::new("wall", at, [0.05, 0.05, 0.05])]);
    assert!(motion.keep_out(&wall).is_ok());
    for goal in [goal, MotionGoal::Tip(arm.tip(&there))] {
        let refused = motion.move_to(&goal, 0.5, &shutdown).expect("connected");
        let MotionOutcome::Refused(why) = &refused else { panic!("{refused:?}") };
        assert!(why.in_language(English).contains("wall"), "{why:?}");
    }
    assert!(motion.keep_out(&Surroundings::default()).is_ok());
    assert_eq!(motion.move_to(&goal, 0.5, &shutdown), Ok(MotionOutcome::Arrived));
}

/// As in most manufacturers' libraries.
#[test]
fn an_arm_that_takes_joint_values_alone_is_jogged_along_axes_and_goes_to_poses_by_its_chain() {
    let connector = connector(Some(served_without(FakePart::Robot, vec![Ability::MoveTip])), None);
    let shutdown = CancelToken::default();
    let mut control = connector.control(&shutdown).expect("connected").port;
    let mut motion = connector.motion(&shutdown).expect("connected").port;
    assert_eq!(control.facts().expect("connected").moves, Moves::OnceArmed { joints: true, tip: false });
    known_arm(control.as_mut());
    let before = first_state(control.as_mut()).base_from_tip;
    control.arm(true).expect("allowed");
    for (axis, along) in [(Axis::Z, [0.0, 0.0, 0.02]), (Axis::X, [0.02, 0.0, 0.0])] {
        let here = first_state(control.as_mut()).base_from_tip;
        let jog = Jog::Translate { frame: JogFrame::Base, axis, forward: true };
        let request = JogRequest { jog, tip_from_camera: None, speed: 0.5 };
        assert_eq!(motion.jog_step(&request, 0.02, &shutdown), Ok(MotionOutcome::Arrived));
        let there = first_state(control.as_mut()).base_from_tip;
        let off_mm = (there.translation() - here.translation() - nalgebra::Vector3::from(along)) * 1e3;
        assert!(off_mm.norm() < 0.2 && there.rotation().angle_to(&here.rotation()) < 1e-3, "off by {off_mm} mm");
    }
    assert_eq!(motion.move_to(&MotionGoal::Tip(before), 0.5, &shutdown), Ok(MotionOutcome::Arrived));
    let (off_m, off_rad) = first_state(control.as_mut()).base_from_tip.distance_to(&before);
    assert!(off_m < 2e-4 && off_rad < 1e-3, "{off_m} m, {off_rad} rad");
    let far = Pose::from_translation_xyzw([9.0, 0.0, 0.3], [0.0, 1.0, 0.0, 0.0]);
    let refused = motion.move_to(&MotionGoal::Tip(far), 0.5, &shutdown).expect("connected");
    assert!(
        matches!(&refused, MotionOutcome::Refused(why) if why.in_language(English).contains("reach")),
        "{refused:?}"
    );
}

/// A driver in a few lines: it greets, answers pings, and sends images where it has some, and no states.
fn scripted(has_images: bool) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
    let address = format!("tcp://{}", listener.local_addr().expect("bound"));
    thread::spawn(move || {
        let (mut stream, _) = listener.accept().expect("the workbench");
        let began = std::time::Instant::now();
        let lines = std::io::BufReader::new(stream.try_clone().expect("a socket")).lines();
        for line in lines.map_while(Result::ok) {
            let asked: serde_json::Value = serde_json::from_str(&line).expect("a message");
            let (id, stamp) = (&asked["id"], began.elapsed().as_secs_f64());
            let answer = match asked["type"].as_str() {
                Some("hello") => serde_json::json!({ "type": "hello", "protocol": 1, "name": "slow",
                    "can": ["state", "image"], "camera": { "width": 4, "height": 2 } }),
                Some("ping") => serde_json::json!({ "type": "pong", "id": id, "stamp": stamp }),
                Some("next_image") if has_images => serde_json::json!({ "type": "image", "id": id, "stamp": stamp,
                    "width": 4, "height": 2, "encoding": "mono8", "bytes": 8 }),
                _ => continue,
            };
            let bytes: &[u8] = if answer["type"] == "image" { &[9; 8] } else { &[] };
            let sent = stream.write_all(format!("{answer}\n").as_bytes()).and_then(|()| stream.write_all(bytes));
            if sent.is_err() {
                break;
            }
        }
    });
    address
}

/// Not the camera of a simulation that is paused, which answers that it has no other image.
#[test]
fn a_slow_camera_has_not_answered_yet() {
    let shutdown = CancelToken::default();
    let connector = connector(Some(scripted(false)), None);
    let mut camera = connector.camera(&shutdown).expect("connected").port;
    assert_eq!(camera.newest(None), Ok(Newest::Awaited));
}

#[test]
fn an_image_without_a_state_around_it_says_what_its_driver_owes_and_not_what_a_pendant_shows() {
    let shutdown = CancelToken::default();
    let connector = connector(Some(scripted(true)), None);
    let mut camera = connector.camera(&shutdown).expect("connected").port;
    let frame = image(camera.as_mut(), None);
    assert_eq!(frame.base_from_tip, None);
    let why = frame.no_pose.expect("a reason").in_language(English);
    assert!(why.contains("has not sent a state") && !why.contains("pendant"), "{why}");
}

#[test]
fn freehand_a_person_types_where_the_robot_is() {
    let connector = connector(None, Some(served(FakePart::Camera)));
    let shutdown = CancelToken::default();
    let mut control = connector.control(&shutdown).expect("connected").port;
    let facts = control.facts().expect("connected");
    assert!(facts.poses_are_typed && facts.joints.is_empty() && facts.moves == Moves::Never);
    assert_eq!(control.state(), Ok(None));
    let mut camera = connector.camera(&shutdown).expect("connected").port;
    let frame = image(camera.as_mut(), None);
    assert_eq!(frame.base_from_tip, None, "nobody has said where the robot is");
    assert!(frame.no_pose.is_some_and(|why| why.in_language(English).contains("pendant")));
    let pose = Pose::from_translation_xyzw([0.4, -0.1, 0.3], [0.0, 1.0, 0.0, 0.0]);
    control.type_pose(Some(pose)).expect("taken");
    assert_eq!(control.state().expect("connected").map(|state| state.base_from_tip), Some(pose));
    assert_eq!(image(camera.as_mut(), Some(frame.sim_time_s)).base_from_tip, Some(pose));
    control.type_pose(None).expect("taken");
    assert_eq!(control.state(), Ok(None), "the robot was moved on");
}

#[test]
fn a_driver_without_images_says_what_is_missing_and_one_that_is_not_there_is_tried_again() {
    let shutdown = CancelToken::default();
    let robot_alone = connector(Some(served(FakePart::Robot)), None);
    assert!(matches!(robot_alone.camera(&shutdown), Err(PortError::Hopeless(_))));
    let free = TcpListener::bind("127.0.0.1:0").expect("a free port").local_addr().expect("bound");
    let nobody = connector(Some(format!("tcp://{free}")), None);
    assert!(matches!(nobody.control(&shutdown), Err(PortError::Later { .. })));
    nobody.rest();
    let Err(PortError::Rests(why)) = nobody.control(&shutdown) else { panic!("it is tried on") };
    assert!(why.in_language(English).contains("no driver listens"), "{why:?}");
    nobody.again();
    assert!(matches!(nobody.control(&shutdown), Err(PortError::Later { .. })));
    let no_program = connector(Some("no-such-program-anywhere --x".to_owned()), None);
    assert!(matches!(no_program.control(&shutdown), Err(PortError::Hopeless(_))));
}
