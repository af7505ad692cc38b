//! What moves the arm, and what the user has to confirm first.

use handeye_cell::scene::{SceneChoice, ShippedScene};
use handeye_dataset::taught_poses::{Goal, TaughtPose};

use super::tests::{bench, reported};
use super::*;
use crate::model::{CapturePurpose, Drivers, JointFacts, Motion, MotionId, MotionOutcome, Moves, StopOutcome};
use crate::testing::sample;
use crate::text::{Language, Text};
use crate::worker::fake::FakeCell;
use crate::{connect, motion, taught};

/// Connected to the source, with two poses that were taught there.
fn taught_at(source: CellSource) -> Model {
    let mut model = sample::connected();
    model.source = source;
    let cell = model.taught_on(model.document().meta.target);
    let pose = |name: &str, turned| TaughtPose {
        cell: cell.clone(),
        ..TaughtPose::new(name, Goal::Joints(vec![turned, 0.5, -1.0, 0.0, 1.5, 0.0]))
    };
    let poses = vec![pose("left", 1.1), pose("right", -0.9)];
    Arc::make_mut(&mut model.session.document).taught = poses;
    model
}

fn scene(scene: ShippedScene) -> CellSource {
    CellSource::BuiltIn(SceneChoice::Shipped(scene))
}

fn driver() -> CellSource {
    CellSource::Drivers(Drivers { robot: Some("python3 my_robot.py".to_owned()), camera: None })
}

#[test]
fn poses_that_were_taught_on_another_cell_are_not_sent_to_the_arm_that_is_there() {
    let taught = taught_at(scene(ShippedScene::Reference));
    assert_eq!(taught.taught().len(), 2);
    let others: [fn(&mut Model); 5] = [
        |model| model.source = scene(ShippedScene::Xarm6),
        |model| model.source = CellSource::Address("tcp://127.0.0.1:23000".to_owned()),
        |model| model.source = driver(),
        |model| {
            let joints = &mut model.cell.as_mut().expect("connected").joints;
            joints.push(JointFacts { range: None, ..joints[0] });
        },
        |model| model.cell = None,
    ];
    for other in others {
        let mut model = taught.clone();
        other(&mut model);
        assert!(model.taught().is_empty());
        let mut bench = bench(&FakeCell::new(0));
        bench.app.replace_model(model);
        bench.app.apply(taught::Command::RunSequence { purpose: Some(CapturePurpose::Calibrate) });
        assert!(!bench.app.model().sequence_runs);
        bench.app.apply(taught::Command::GoTo("left".to_owned()));
        assert_eq!(bench.app.model().motion, Motion::Idle);
        assert_eq!(bench.app.model().asked, None);
    }
    assert!(taught.document().taught.len() == 2, "they stay in the session");
}

#[test]
fn a_session_begins_with_the_reference_poses_for_the_arm_they_are_meant_for_alone() {
    let model = sample::connected();
    assert!(model.has_reference_poses(), "the sample is the UR5 of the simulator");
    let mut driven = model.clone();
    driven.cell.as_mut().expect("connected").moves = Moves::OnceArmed { joints: true, tip: true };
    assert!(!driven.has_reference_poses(), "the same arm of somebody else stands elsewhere");
    let mut unknown = model;
    unknown.cell = None;
    assert!(!unknown.has_reference_poses());
}

#[test]
fn a_move_that_cannot_begin_ends_the_sequence_with_the_command_that_asked_for_it() {
    let mut bench = bench(&FakeCell::new(0));
    let app = &mut bench.app;
    app.replace_model(taught_at(scene(ShippedScene::Reference)));
    app.cx.workers.shut_down(std::time::Duration::from_secs(10));
    app.apply(taught::Command::RunSequence { purpose: None });
    assert!(!app.model().sequence_runs && app.model().motion == Motion::Idle);
    assert!(reported(app).starts_with("The sequence was broken off"), "{}", reported(app));
}

#[test]
fn a_pose_that_is_not_taught_any_more_does_not_end_the_motion_that_is_under_way() {
    let mut bench = bench(&FakeCell::new(0));
    let app = &mut bench.app;
    app.replace_model(taught_at(scene(ShippedScene::Reference)));
    let motion = Motion::Moving { id: MotionId(7), what: Text::verbatim("home"), since_s: 0.0 };
    app.cx.numbers.motion = MotionId(7);
    app.cx.model.motion = motion.clone();
    app.apply(taught::Command::GoTo("gone".to_owned()));
    assert_eq!(app.model().motion, motion);
    assert!(reported(app).contains("it is no longer taught"), "{}", reported(app));
}

#[test]
fn the_first_move_of_a_sequence_is_asked_for_wherever_there_may_be_a_real_arm() {
    let mut bench = bench(&FakeCell::new(0));
    let app = &mut bench.app;
    app.replace_model(taught_at(driver()));
    // Whoever switched this off did so for moves that were previewed.
    app.apply(taught::Command::SetConfirmMoves(false));
    app.apply(taught::Command::RunSequence { purpose: None });
    let asked = app.model().asked.clone().expect("the first move waits");
    assert_eq!(app.model().motion, Motion::Idle);
    assert_eq!(asked.what.in_language(Language::English), "pose left");

    app.apply(taught::Command::ConfirmMove);
    assert!(matches!(app.model().motion, Motion::Moving { .. }));
    let id = app.cx.numbers.motion;
    app.absorb(motion::Event::Moved { id, outcome: MotionOutcome::Arrived });
    assert!(app.model().asked.is_none(), "the second goes by itself");
    assert!(matches!(app.model().motion, Motion::Moving { .. }));

    app.apply(motion::Command::Stop);
    app.apply(taught::Command::ContinueSequence);
    assert!(app.model().asked.is_some(), "whatever happened meanwhile");
    app.apply(motion::Command::Stop);
    assert_eq!(app.model().asked, None);
    app.apply(taught::Command::ConfirmMove);
    assert!(!app.model().sequence_runs, "nothing begins after a stop");

    app.apply(taught::Command::RunSequence { purpose: None });
    app.apply(taught::Command::SkipMove);
    let sequence = app.model().sequence.as_ref().expect("a sequence");
    assert!(matches!(sequence.outcomes[..], [StopOutcome::Skipped(_)]));
    assert!(app.model().asked.is_some(), "the next one is asked for instead");
}

#[test]
fn poses_to_verify_at_and_moves_to_a_place_by_its_name_are_asked_for_as_well() {
    let mut bench = bench(&FakeCell::new(0));
    let app = &mut bench.app;
    let mut model = sample::solved();
    model.source = driver();
    app.replace_model(model);
    app.apply(taught::Command::VerifyAtPlanned);
    let id = app.cx.numbers.motion;
    app.absorb(taught::Event::Planned { id, views: Ok(vec![[0.1; 6].into(); 3]) });
    assert!(app.model().asked.is_some() && app.model().sequence_runs);
    app.apply(motion::Command::Stop);

    let mut robot = app.model().robot.clone().expect("connected");
    app.absorb(connect::Event::Robot(robot.clone()));
    app.apply(motion::Command::GoHome);
    assert_eq!(app.model().asked, None, "it is there");
    robot.joints_rad[0] += 0.7;
    app.absorb(connect::Event::Robot(robot));
    let id = app.cx.numbers.motion;
    app.absorb(motion::Event::Moved { id, outcome: MotionOutcome::Arrived });
    app.apply(motion::Command::GoHome);
    let asked = app.model().asked.clone().expect("it waits");
    let way = crate::motion::way::Way::to(&asked.goal, app.model()).expect("connected");
    assert!(way.joint.is_some_and(|(joint, far)| joint == 0 && (far - 0.7).abs() < 1e-9));
    assert!(way.text(app.model()).in_language(Language::English).contains("the joint that moves most is J1, by 40.1°"));
    app.apply(taught::Command::SkipMove);
    assert_eq!((&app.model().motion, &app.model().asked), (&Motion::Idle, &None));

    let first = app.model().document().captures[0].id;
    app.apply(motion::Command::GoToCapture(first));
    assert!(app.model().asked.is_some());
    app.apply(taught::Command::ConfirmMove);
    assert!(matches!(app.model().motion, Motion::Moving { .. }));
}

#[test]
fn a_built_in_cell_asks_nothing_unless_somebody_wants_it() {
    let mut bench = bench(&FakeCell::new(0));
    let app = &mut bench.app;
    app.replace_model(taught_at(scene(ShippedScene::Reference)));
    app.apply(taught::Command::RunSequence { purpose: None });
    assert!(matches!(app.model().motion, Motion::Moving { .. }));
    app.apply(motion::Command::Stop);
    app.apply(taught::Command::SetConfirmMoves(true));
    app.apply(taught::Command::RunSequence { purpose: None });
    assert!(app.model().asked.is_some());
}

#[test]
fn another_cell_has_no_move_that_waits_and_another_home() {
    let mut bench = bench(&FakeCell::new(0));
    let app = &mut bench.app;
    app.replace_model(taught_at(driver()));
    app.absorb(connect::Event::Robot(app.model().robot.clone().expect("connected")));
    app.apply(taught::Command::RunSequence { purpose: None });
    assert!(app.model().asked.is_some() && app.model().home.is_some());
    app.apply(connect::Command::Connect(CellSource::Address("tcp://127.0.0.1:9".to_owned())));
    assert_eq!((&app.model().asked, app.model().home), (&None, None));
}

/// A driver that replies `done` to `stop` and keeps moving: the reported states count.
#[test]
fn an_arm_is_said_to_be_stopped_when_its_states_say_so_and_an_alarm_has_the_number_otherwise() {
    for goes_on in [false, true] {
        let mut bench = bench(&FakeCell::new(0));
        let app = &mut bench.app;
        app.replace_model(taught_at(driver()));
        let mut robot = app.model().robot.clone().expect("connected");
        app.apply(motion::Command::Stop);
        app.absorb(motion::Event::Stopped);
        assert!(app.model().stop_pending && !reported(app).contains("stays where it is"), "{}", reported(app));
        for i in 1..=22 {
            let now_s = app.model().now_s + 0.1;
            robot.sim_time_s += 0.1;
            let turned: f64 = if goes_on || i < 4 { 34.9 - 4.0 * f64::from(i) } else { 20.0 };
            robot.joints_rad[0] = turned.to_radians();
            app.absorb(connect::Event::Robot(robot.clone()));
            app.absorb(Event::Tick { now_s });
        }
        assert!(!app.model().stop_pending);
        let newest = app.model().messages.newest().expect("said").clone();
        if goes_on {
            assert_eq!(newest.severity, Severity::Error);
            assert!(
                reported(app).contains("joint 1 from 5.7° to −") && reported(app).contains("emergency stop"),
                "{}",
                reported(app)
            );
        } else {
            assert_eq!(reported(app), "Arm stopped: every joint stays where it is");
        }
    }
}

#[test]
fn without_states_nobody_says_that_the_arm_stands() {
    let mut bench = bench(&FakeCell::new(0));
    let app = &mut bench.app;
    let mut model = taught_at(driver());
    model.cell.as_mut().expect("connected").moves = Moves::OnceArmed { joints: true, tip: true };
    app.replace_model(model);
    app.absorb(motion::Event::Stopped);
    app.absorb(Event::Tick { now_s: app.model().now_s + 2.5 });
    assert!(reported(app).contains("it is not known whether it has"), "{}", reported(app));
}
