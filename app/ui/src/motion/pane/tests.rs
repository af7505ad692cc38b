use egui::{Key, Modifiers};
use egui_kittest::kittest::Queryable as _;
use handeye_arm::{JointKind, JointValues};
use handeye_geometry::frames::Pose;
use handeye_session::{Capture, Session, SessionMeta, Store};
use image::RgbImage;

use super::*;
use crate::testing::driven::Driven;
use handeye_workbench::command::Command;
use handeye_workbench::model::{
    ArmDoubt, Axis, CellFacts, CellSource, Drivers, Home, Jog, JogFrame, JogStep, JointFacts, LinkState, Motion,
    MotionGoal, MotionId, Pane, Severity, Simulation,
};
use handeye_workbench::motion::correction::real_tip;
use handeye_workbench::testing::sample;
use handeye_workbench::text::Text;
use handeye_workbench::{connect, messages, motion};

fn driven(model: Model) -> Driven {
    Driven::new(jog_ui, model)
}

fn forward_x() -> Jog {
    Jog::Translate { frame: JogFrame::Base, axis: Axis::X, forward: true }
}

/// Presses a button and holds it for longer than any click takes, with a hand that shakes a little.
fn hold(pane: &mut Driven, label: &str) -> Vec<Command> {
    pane.commands();
    let at = pane.harness.get_by_label(label).rect().center();
    pane.harness.hover_at(at);
    pane.harness.step();
    pane.harness.drag_at(at);
    for n in 0..20 {
        pane.harness.step();
        pane.harness.hover_at(at + egui::vec2(0.5 * n as f32, 0.0));
    }
    pane.harness.step();
    pane.commands()
}

#[test]
fn a_button_moves_from_the_press_to_the_release() {
    let mut pane = driven(sample::connected());
    let held = hold(&mut pane, "Move +X");
    assert_eq!(held.first(), Some(&Command::Motion(motion::Command::Jog(forward_x()))), "{held:?}");
    assert!(
        held.len() >= 20
            && held[1..].iter().all(|command| *command == Command::Motion(motion::Command::JogHeld(forward_x()))),
        "{held:?}"
    );
    let at = pane.harness.get_by_label("Move +X").rect().center();
    pane.harness.drop_at(at);
    pane.steps();
    assert_eq!(pane.commands(), [Command::Motion(motion::Command::JogReleased)]);
    pane.steps();
    assert!(pane.commands().is_empty(), "nothing is held now");
}

#[test]
fn a_button_is_let_go_when_the_pointer_leaves_it_and_not_taken_up_when_it_comes_back() {
    let mut pane = driven(sample::connected());
    hold(&mut pane, "Move +X");
    pane.harness.hover_at(egui::pos2(200.0, 2.0));
    pane.steps();
    assert_eq!(pane.commands(), [Command::Motion(motion::Command::JogReleased)]);
    let at = pane.harness.get_by_label("Move +X").rect().center();
    pane.harness.hover_at(at);
    pane.steps();
    assert!(pane.commands().is_empty());
}

#[test]
fn the_arm_is_let_go_when_the_window_loses_the_focus() {
    let mut pane = driven(sample::connected());
    hold(&mut pane, "Jog joint 2 −");
    pane.harness.input_mut().focused = false;
    pane.steps();
    assert_eq!(pane.commands(), [Command::Motion(motion::Command::JogReleased)]);
}

#[test]
fn the_arm_is_let_go_when_the_connection_is_lost() {
    let mut pane = driven(sample::connected());
    hold(&mut pane, "Turn −Z");
    pane.model().mover = LinkState::Failed { why: Text::verbatim("gone") };
    pane.steps();
    assert_eq!(pane.commands(), [Command::Motion(motion::Command::JogReleased)]);
}

#[test]
fn every_direction_of_the_pad_and_every_joint_jogs_what_it_says() {
    let mut model = sample::connected();
    model.view.jog.frame = JogFrame::Camera;
    let mut pane = driven(model);
    for (letter, axis) in [("X", Axis::X), ("Y", Axis::Y), ("Z", Axis::Z)] {
        for (sign, forward) in [("−", false), ("+", true)] {
            let frame = JogFrame::Camera;
            let sent = pane.click(&format!("Move {sign}{letter}"));
            assert_eq!(
                sent.first(),
                Some(&Command::Motion(motion::Command::Jog(Jog::Translate { frame, axis, forward })))
            );
            assert_eq!(sent.last(), Some(&Command::Motion(motion::Command::JogReleased)));
            let sent = pane.click(&format!("Turn {sign}{letter}"));
            assert_eq!(
                sent.first(),
                Some(&Command::Motion(motion::Command::Jog(Jog::Rotate { frame, axis, forward })))
            );
        }
    }
    for index in 0..6 {
        let sent = pane.click(&format!("Jog joint {} +", index + 1));
        assert_eq!(sent.first(), Some(&Command::Motion(motion::Command::Jog(Jog::Joint { index, forward: true }))));
    }
}

#[test]
fn keys_jog_only_when_they_are_switched_on_and_no_field_is_edited() {
    let mut pane = driven(sample::connected());
    pane.harness.key_down(Key::ArrowRight);
    pane.steps();
    assert!(pane.commands().is_empty(), "keys are off at first");
    pane.harness.key_up(Key::ArrowRight);
    pane.click("Jog with keys");
    pane.harness.key_down(Key::ArrowRight);
    pane.steps();
    let sent = pane.commands();
    assert_eq!(sent.first(), Some(&Command::Motion(motion::Command::Jog(forward_x()))), "{sent:?}");
    assert!(sent.contains(&Command::Motion(motion::Command::JogHeld(forward_x()))));
    pane.harness.key_up(Key::ArrowRight);
    pane.steps();
    assert_eq!(pane.commands().last(), Some(&Command::Motion(motion::Command::JogReleased)));

    pane.harness.key_down_modifiers(Modifiers::SHIFT, Key::PageDown);
    pane.steps();
    let turn = Jog::Rotate { frame: JogFrame::Base, axis: Axis::Z, forward: false };
    assert_eq!(pane.commands().first(), Some(&Command::Motion(motion::Command::Jog(turn))));
    pane.harness.key_up(Key::PageDown);
    pane.steps();

    pane.harness.get_by_label("J1 of the goal").click();
    pane.steps();
    pane.commands();
    pane.harness.key_down(Key::ArrowRight);
    pane.steps();
    assert!(pane.commands().is_empty(), "a field is being edited");
}

#[test]
fn frame_step_and_speed_are_chosen() {
    let mut pane = driven(sample::connected());
    let before = pane.model().view.jog;
    let sent = pane.click("Camera");
    let [Command::Motion(motion::Command::SetJog(jog))] = sent[..] else { panic!("{sent:?}") };
    assert!(jog.frame == JogFrame::Camera && jog.step == before.step);
    let sent = pane.click("Step 10 mm, 10°");
    let [Command::Motion(motion::Command::SetJog(jog))] = sent[..] else { panic!("{sent:?}") };
    assert_eq!(jog.step, JogStep::Step { metres: 0.01, radians: 10.0_f64.to_radians() });
    assert!(pane.sees("50 % · line 125 mm/s"), "no arm can be hurt in the built-in cell");
    pane.model().source = CellSource::Address("tcp://127.0.0.1:23000".to_owned());
    pane.steps();
    assert!(pane.sees("25 % · line 62 mm/s"), "there may be a real arm behind an address");
    pane.model().view.jog.speed = Some(0.8);
    pane.steps();
    assert!(pane.sees("80 % · line 200 mm/s") && pane.nothing_is_cut_off());
}

#[test]
fn behind_a_driver_the_speed_is_a_share_because_no_more_is_known() {
    let mut model = sample::connected();
    model.source = CellSource::Drivers(Drivers { robot: Some("robot".to_owned()), camera: None });
    model.cell.as_mut().expect("connected").moves = Moves::OnceArmed { joints: true, tip: true };
    let pane = driven(model);
    assert!(pane.sees("25 % of the robot's highest") && !pane.sees("mm/s"));
    assert!(pane.nothing_is_cut_off());
}

/// As after a session with another arm, or after the arm was moved by its pendant.
#[test]
fn numbers_follow_the_arm_until_a_person_edits_them_and_say_how_far_the_move_is() {
    let mut pane = driven(sample::connected());
    let turn = |pane: &mut Driven, joint_deg: f64| {
        let robot = pane.model().robot.as_mut().expect("connected");
        robot.joints_rad[0] = joint_deg.to_radians();
        pane.steps();
    };
    let goal = |pane: &mut Driven| match &pane.click("Move there")[..] {
        [Command::Motion(motion::Command::Move { goal: MotionGoal::Joints(joints), .. })] => joints[0].to_degrees(),
        other => panic!("{other:?}"),
    };
    turn(&mut pane, 101.0);
    assert!((goal(&mut pane) - 101.0).abs() < 1e-9, "nobody has typed anything else");
    assert!(pane.sees("These are the numbers of where the arm is"));

    pane.type_into("J1 of the goal", "-93");
    pane.press(Key::Enter);
    assert!(pane.sees("the joint that moves most is J1, by 194.0°"));
    turn(&mut pane, 11.0);
    assert!(
        pane.sees("the joint that moves most is J1, by 104.0°"),
        "what was typed stays, and the way is that from here"
    );
    assert!((goal(&mut pane) + 93.0).abs() < 1e-9);

    pane.model().cells += 1;
    pane.steps();
    assert!((goal(&mut pane) - 11.0).abs() < 1e-9, "another cell has another arm");
    pane.type_into("J1 of the goal", "-93");
    pane.press(Key::Enter);
    pane.model().robot = None;
    pane.steps();
    pane.model().robot = sample::connected().robot;
    turn(&mut pane, 20.0);
    assert!((goal(&mut pane) - 20.0).abs() < 1e-9, "it may have been anywhere meanwhile");
}

#[test]
fn a_typed_tip_pose_is_corrected_for_the_errors_of_the_arm_unless_a_person_says_otherwise() {
    let mut pane = driven(sample::with_errors_of_the_arm());
    assert!(pane.sees("really [mm]") && pane.sees("By the errors of the arm"));
    pane.click("Tip pose in base");
    assert!(pane.sees("within 0.25 mm with it and 2.91 mm without"));
    let sent = pane.click("Move there");
    let [Command::Motion(motion::Command::MoveCorrected { base_from_tip, .. })] = &sent[..] else { panic!("{sent:?}") };
    let real = real_tip(pane.model()).expect("its errors are known");
    let off_m = base_from_tip.distance_to(&real).0;
    assert!(off_m < 2e-5, "what nobody typed is where the tip really is: {off_m} m off");
    pane.click("Correct for the errors of the arm");
    let sent = pane.click("Move there");
    assert!(matches!(&sent[..], [Command::Motion(motion::Command::Move { .. })]), "{sent:?}");
    let other_arm = Pose::from_isometry(nalgebra::Isometry3::translation(0.0, 0.0, 0.01));
    let robot = pane.model().robot.as_mut().expect("connected");
    robot.base_from_tip = robot.base_from_tip * other_arm;
    pane.steps();
    assert!(!pane.sees("Correct for the errors of the arm") && !pane.sees("really [mm]"), "it is another tool");
}

#[test]
fn a_slider_moves_its_joint_when_it_is_let_go_and_not_before() {
    let mut pane = driven(sample::connected());
    let rect = pane.harness.get_by_label("Goal of joint 1 in degrees").rect();
    pane.harness.hover_at(rect.center());
    pane.harness.step();
    pane.harness.drag_at(rect.center());
    pane.steps();
    let to = rect.center() + egui::vec2(0.25 * rect.width(), 0.0);
    pane.harness.hover_at(to);
    pane.steps();
    assert!(pane.commands().is_empty(), "it is still dragged");
    assert!(pane.sees("Joint 1 goes to"), "the goal is shown beside the place");
    assert!(pane.sees("Joint 1 is at: 5.7°"));
    pane.harness.drop_at(to);
    pane.steps();
    let sent = pane.commands();
    let [Command::Motion(motion::Command::Move { goal: MotionGoal::Joints(joints_rad), .. })] = &sent[..] else {
        panic!("{sent:?}")
    };
    assert!((1.0..6.0).contains(&joints_rad[0]), "{joints_rad:?}");
    assert_eq!(joints_rad[1..], [0.5, -1.0, 0.0, 1.5, 0.0], "the others stay");
    pane.model().now_s += 10.0;
    pane.steps();
    assert!(!pane.sees("Joint 1 goes to"), "no motion came of it");
}

#[test]
fn numbers_are_moved_to() {
    let mut pane = driven(sample::connected());
    pane.type_into("J3 of the goal", "-45");
    pane.press(Key::Enter);
    let sent = pane.click("Move there");
    let [Command::Motion(motion::Command::Move { goal: MotionGoal::Joints(joints_rad), .. })] = &sent[..] else {
        panic!("{sent:?}")
    };
    assert!((joints_rad[2] + std::f64::consts::FRAC_PI_4).abs() < 1e-9, "{joints_rad:?}");
    assert!((joints_rad[0] - 0.1).abs() < 1e-4, "the rest is where the arm is");
}

/// With an arm on a track, its rail at 250 mm.
fn on_track() -> Model {
    let mut model = sample::connected();
    let cell = model.cell.as_mut().expect("connected");
    cell.joints.insert(0, JointFacts { kind: JointKind::Prismatic, range: Some([-0.8, 0.8]) });
    model.robot.as_mut().expect("connected").joints_rad = [0.25, 0.1, 0.5, -1.0, 0.0, 1.5, 0.7].into();
    model
}

#[test]
fn an_arm_has_a_row_for_each_joint_with_degrees_or_millimetres_and_a_step_and_a_typed_goal_likewise() {
    let mut pane = driven(on_track());
    for joint in 1..=7 {
        assert!(pane.harness.query_by_label(&format!("Jog joint {joint} +")).is_some(), "joint {joint}");
        assert!(pane.harness.query_by_label(&format!("J{joint} of the goal")).is_some(), "joint {joint}");
    }
    assert!(pane.harness.query_by_label("Jog joint 8 +").is_none());
    assert!(pane.harness.query_by_label("Goal of joint 1 in millimetres").is_some());
    assert!(pane.harness.query_by_label("Goal of joint 7 in degrees").is_some());
    assert!(pane.sees("Joint 1 is at: 250.0 mm") && pane.sees("Joint 7 is at: 40.1°"));
    pane.type_into("J1 of the goal", "-300");
    pane.press(Key::Enter);
    pane.type_into("J7 of the goal", "90");
    pane.press(Key::Enter);
    let sent = pane.click("Move there");
    let [Command::Motion(motion::Command::Move { goal: MotionGoal::Joints(joints), .. })] = &sent[..] else {
        panic!("{sent:?}")
    };
    assert!((joints[0] + 0.3).abs() < 1e-12 && (joints[6] - std::f64::consts::FRAC_PI_2).abs() < 1e-9, "{joints:?}");
}

#[test]
fn a_session_of_an_arm_with_seven_joints_that_is_opened_has_seven_rows() {
    let folder = tempfile::tempdir().expect("a folder");
    let joints = [0.1, -0.6, 0.2, -2.2, 0.3, 1.6, 0.7];
    let meta = SessionMeta {
        joint_kinds: Some(vec![JointKind::Revolute; 7]),
        ..handeye_workbench::session::start::meta(None, "2026-05-02T10:11:12Z".to_owned())
    };
    let mut store = Store::create(folder.path(), meta).expect("a new session");
    let image = RgbImage::from_pixel(16, 16, [9, 9, 9].into());
    let capture = Capture { joints_rad: Some(&joints), ..Capture::new(&image, Pose::identity()) };
    store.add_capture(&capture).expect("written");
    drop(store);
    let mut model = sample::connected();
    model.session.document = Session::open(folder.path()).expect("it is one").document;
    let kept = model.document().captures[0].joints_rad.clone().expect("kept");
    model.cell.as_mut().expect("connected").joints = vec![JointFacts { kind: JointKind::Revolute, range: None }; 7];
    model.robot.as_mut().expect("connected").joints_rad = JointValues::try_from(&kept[..]).expect("seven");
    let pane = driven(model);
    for (joint, angle) in joints.iter().enumerate() {
        let reported = format!("Joint {} is at: {:.1}°", joint + 1, angle.to_degrees()).replace('-', "−");
        assert!(pane.sees(&reported), "{reported}");
    }
    assert!(pane.harness.query_by_label("Jog joint 8 +").is_none());
}

#[test]
fn a_typed_tip_pose_is_millimetres_and_degrees_in_the_base() {
    let mut model = sample::connected();
    if let Some(robot) = &mut model.robot {
        let quarter = std::f64::consts::FRAC_PI_4;
        robot.base_from_tip =
            Pose::from_translation_xyzw([0.11, -0.016, 0.847], [0.0, 0.0, quarter.sin(), quarter.cos()]);
    }
    let expected = model.robot.as_ref().map(|robot| robot.base_from_tip).expect("a robot");
    let mut pane = driven(model);
    pane.click("Tip pose in base");
    let sent = pane.click("Move there");
    let [Command::Motion(motion::Command::Move { goal: MotionGoal::Tip(base_from_tip), .. })] = &sent[..] else {
        panic!("{sent:?}")
    };
    let (metres, radians) = base_from_tip.distance_to(&expected);
    // Numbers are filled in to a hundredth of a millimetre and of a degree.
    assert!(metres < 1e-5 && radians < 2e-4, "{metres} m, {radians} rad");
}

#[test]
fn a_simulation_that_rests_is_said_and_can_be_started() {
    let mut model = sample::connected();
    if let Some(robot) = &mut model.robot {
        robot.simulation = Simulation::Stopped;
    }
    let mut pane = driven(model);
    assert!(pane.sees("The simulation is stopped"));
    assert!(!pane.is_enabled("Move +X") && !pane.is_enabled("Jog joint 1 +") && !pane.is_enabled("Move there"));
    assert_eq!(pane.click("Run the simulation"), [Command::Connect(connect::Command::StartSimulation)]);
}

#[test]
fn an_arm_of_unknown_kinematics_has_its_joints_jogged_only() {
    let mut model = sample::connected();
    if let Some(cell) = &mut model.cell {
        cell.arm = None;
    }
    let pane = driven(model);
    assert!(pane.sees("kinematics is not known"));
    assert!(!pane.is_enabled("Turn +X"));
    assert!(pane.is_enabled("Jog joint 1 +"));
}

#[test]
fn an_arm_that_takes_joint_values_alone_is_moved_along_axes_once_its_chain_is_known() {
    let alone = |change: fn(&mut CellFacts)| {
        let mut model = sample::connected();
        let cell = model.cell.as_mut().expect("connected");
        cell.moves = Moves::OnceArmed { joints: true, tip: false };
        change(cell);
        driven(model)
    };
    let known = alone(|_| ());
    assert!(!known.sees("kinematics is not known") && known.is_enabled("Move +X") && known.is_enabled("Turn +X"));
    let open = alone(|cell| (cell.arm, cell.arm_doubt) = (None, Some(ArmDoubt::Open)));
    assert!(open.sees("let it stand at four places") && !open.is_enabled("Move +X"));
    assert!(!open.sees("kinematics is not known"), "it is named, and not placed yet");
    assert!(alone(|cell| cell.arm = None).sees("kinematics is not known"));
}

#[test]
fn what_the_arm_does_can_be_stopped_and_a_refusal_is_read() {
    let mut model = sample::connected();
    model.motion = Motion::Moving { id: MotionId(1), what: Text::verbatim("pose 3"), since_s: 96.0 };
    let why = Text::verbatim("Joint 2 would leave its range");
    model.messages.notify_at(Home::Pane(Pane::Jog), Severity::Warning, why, 99.0);
    let mut pane = driven(model);
    assert!(pane.sees("Moving: pose 3 (4 s)"));
    assert_eq!(pane.click("Stop"), [Command::Motion(motion::Command::Stop)]);
    assert!(pane.sees("Joint 2 would leave its range"));
    assert_eq!(pane.click("Dismiss the message"), [Command::Messages(messages::Command::Dismiss(0))]);
}

/// Labels of the controls that move the arm.
const MOVERS: [&str; 8] =
    ["Move +X", "Turn −Z", "Jog joint 1 +", "Jog joint 6 −", "Move there", "Speed in percent", "Jog with keys", "Stop"];

#[test]
fn what_moves_the_arm_keeps_its_place_whatever_is_said() {
    let places = |model: Model| {
        let pane = driven(model);
        MOVERS.map(|name| pane.harness.get_by_label(name).rect().min)
    };
    let before = places(sample::connected());
    let long = "The arm does not move to the next pose: ".repeat(20);
    let says = |words: &str, severity| {
        let mut model = sample::connected();
        model.messages.notify_at(Home::Pane(Pane::Jog), severity, Text::verbatim(words), 99.0);
        model
    };
    let mut unknown_arm = sample::connected();
    unknown_arm.cell.as_mut().expect("a cell").arm = None;
    let mut old = sample::connected();
    old.robot_read_s = Some(old.now_s - 12.0);
    let mut sequence = sample::connected();
    sequence.sequence_runs = true;
    let mut lost = sample::connected();
    lost.mover = LinkState::Failed { why: Text::verbatim("the cable is out") };
    for (what, model) in [
        ("a refusal", Box::new(says("Joint 2 would leave its range", Severity::Warning))),
        ("a long refusal", Box::new(says(&long, Severity::Error))),
        ("an arm without kinematics", Box::new(unknown_arm)),
        ("an old reading", Box::new(old)),
        ("a sequence", Box::new(sequence)),
        ("a connection that is lost", Box::new(lost)),
    ] {
        assert_eq!(places(*model), before, "{what}");
    }
}

#[test]
fn what_is_not_known_of_the_arm_is_said_with_its_age_and_stop_says_that_it_cannot_act() {
    let mut model = sample::connected();
    assert!(driven(model.clone()).sees("The arm is at rest"));
    model.robot_read_s = Some(model.now_s - 12.0);
    let pane = driven(model.clone());
    assert!(pane.sees("Not known whether the arm moves: last read 12 s ago"));
    assert!(pane.sees("Tip in base · last read 12 s ago"));
    assert!(!pane.sees("The arm is at rest") && pane.sees("Stop"));
    model.control = LinkState::Resting { why: Text::verbatim("the cable is out") };
    let pane = driven(model);
    assert!(pane.sees("STOP cannot act") && !pane.sees("The arm is at rest"));
}

#[test]
fn nothing_is_wider_than_the_tile() {
    assert!(driven(sample::connected()).nothing_is_cut_off());
}
