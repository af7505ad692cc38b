use std::time::{Duration, Instant};

use handeye_arm::JointValues;
use handeye_estimate::diagnose::{Promise, Promised};
use handeye_estimate::handeye::Mode;
use handeye_geometry::frames::Pose;
use handeye_geometry::progress::CancelToken;
use handeye_geometry::targets::observation::Corner;
use handeye_plan::guided::by_hand::{HandGuide, HandNext, Wanted};
use handeye_plan::guided::choose::{Plan, Proposal};
use handeye_plan::guided::design::Part;
use handeye_plan::guided::{Ending, GuidedOptions, Known, Next, Why};
use handeye_session::{CaptureId, Role};

use super::*;
use crate::by_hand::state::HandWaits;
use crate::by_hand::update::captured_by_hand;
use crate::guided::state::{Choice, ChosenStep, Waits};
use crate::model::{
    ArmDoubt, ByHand, CapturePurpose, CaptureRefused, CellFacts, DepthScale, Dialog, FollowRequest, FollowStatus, Home,
    JobId, Jog, Link, LinkState, LiveDetection, Motion, MotionGoal, MotionOutcome, Pane, PoseSequence, RefusalKind,
    RobotState, SceneView, SolveStatus, StopOutcome, ThemeChoice, WorkBox,
};
use crate::session::start;
use crate::solve::update::seen;
use crate::testing::sample;
use crate::text::{Language, Text};
use crate::worker::fake::{FakeCell, FakeMotions};
use crate::{capture, connect, guided, live, motion, recording, scene, session, shell, solve, taught, track};
use handeye_cell::scene::{SceneChoice, ShippedScene};
use handeye_coppeliasim::cell::ArmKinematics;
use handeye_link::Cell;

pub(super) struct Bench {
    pub app: App,
    sessions: tempfile::TempDir,
}

pub(super) fn bench(cell: &FakeCell) -> Bench {
    let cell = cell.clone();
    bench_with(Arc::new(move |_source, _objects| Arc::new(cell.clone()) as Arc<dyn Cell>))
}

fn bench_with(connect: Connect) -> Bench {
    let clock: Clock = Arc::new(|| 3.0);
    let waker: Waker = Arc::new(|| {});
    let sessions = tempfile::tempdir().expect("a folder");
    let start = Start {
        source: CellSource::default(),
        view: ViewSettings::default(),
        addresses: Vec::new(),
        drivers: Vec::new(),
        objects: CellPaths::default(),
        keep_out: None,
        sessions: sessions.path().to_path_buf(),
        open: None,
        in_browser: None,
    };
    Bench { app: App::start(start, connect, clock, waker).expect("threads"), sessions }
}

pub(super) fn reported(app: &App) -> String {
    app.model().messages.newest().map_or_else(String::new, |message| message.text.in_language(Language::English))
}

/// Collects what the threads report until the condition holds for the model.
fn until(app: &mut App, is_so: impl Fn(&Model) -> bool) {
    let deadline = Instant::now() + Duration::from_mins(1);
    while !is_so(app.model()) {
        assert!(Instant::now() < deadline, "{}", reported(app));
        app.collect();
        std::thread::yield_now();
    }
}

/// A scene is read when a connection is made, so another scene needs a new connection; the built-in cell has one scene, and a
/// new connection would be a new cell.
#[test]
fn objects_of_another_scene_and_connect_again_make_a_new_connection_to_an_address_alone() {
    let made: Arc<std::sync::Mutex<Vec<(CellSource, CellPaths)>>> = Arc::default();
    let noted = Arc::clone(&made);
    let cell = FakeCell::new(0);
    let mut bench = bench_with(Arc::new(move |source, objects| {
        noted.lock().expect("whole").push((source.clone(), objects.clone()));
        Arc::new(cell.clone()) as Arc<dyn Cell>
    }));
    let connected = LinkState::Connected { server: "a cell".to_owned(), address: "tcp://127.0.0.1:9".to_owned() };
    let panda = CellPaths::below("Panda");
    bench.app.cx.model.control = connected.clone();
    bench.app.apply(connect::Command::SetObjects(panda.clone()));
    bench.app.apply(connect::Command::Reconnect);
    assert_eq!(made.lock().expect("whole").len(), 1, "the cell of the start goes on");

    let address = CellSource::Address("tcp://127.0.0.1:9".to_owned());
    bench.app.apply(connect::Command::Connect(address.clone()));
    let xarm = CellPaths::below("xArm");
    bench.app.apply(connect::Command::SetObjects(xarm.clone()));
    bench.app.cx.model.control = connected;
    bench.app.apply(connect::Command::Reconnect);
    let made = made.lock().expect("whole")[1..].to_vec();
    assert_eq!(made, [(address.clone(), panda), (address.clone(), xarm.clone()), (address, xarm)]);
}

/// Captures of two cells cannot be calibrated together, and a session does not record which cell it belongs to.
#[test]
fn who_connects_to_another_cell_with_captures_at_hand_is_told_of_a_new_session() {
    let mut bench = bench(&FakeCell::new(0));
    let reported = |bench: &mut Bench, port: u16| {
        let source = CellSource::Address(format!("tcp://127.0.0.1:{port}"));
        bench.app.apply(connect::Command::Connect(source));
        reported(&bench.app).contains("begin a new session")
    };
    assert!(!reported(&mut bench, 9), "nothing was captured");
    bench.app.cx.model.session.document = sample::solved().session.document;
    assert!(!reported(&mut bench, 9), "it is the same cell");
    assert!(reported(&mut bench, 8));
}

#[test]
fn commands_return_at_once_while_the_cell_never_answers() {
    let (cell, release) = FakeCell::that_never_answers();
    let mut bench = bench(&cell);
    let began = Instant::now();
    let jog = Jog::Joint { index: 0, forward: true };
    for _ in 0..50 {
        for command in [
            Command::Motion(motion::Command::Stop),
            Command::Connect(connect::Command::StartSimulation),
            Command::Connect(connect::Command::Reconnect),
            Command::Live(live::Command::SetDepthScale(DepthScale::Full)),
            Command::Shell(shell::Command::SetTheme(ThemeChoice::Light)),
            Command::Motion(motion::Command::JogHeld(jog)),
            Command::Motion(motion::Command::JogReleased),
            Command::Capture(capture::Command::Take(CapturePurpose::Calibrate)),
            Command::Taught(taught::Command::GoTo("P1".to_owned())),
            Command::Solve(solve::Command::Solve),
        ] {
            bench.app.apply(command);
            bench.app.collect();
        }
    }
    // 500 commands; a single one that waited for a reply would wait for ever.
    assert!(began.elapsed() < Duration::from_secs(10), "{:?}", began.elapsed());
    drop(release);
}

#[test]
fn a_lost_connection_is_said_and_a_retry_does_not_hide_why() {
    let mut bench = bench(&FakeCell::new(0));
    let connected = LinkState::Connected { address: "tcp://a:1".to_owned(), server: "sim".to_owned() };
    let why = Text::verbatim("the cable is out");
    bench.app.absorb(connect::Event::Link { link: Link::Camera, state: connected });
    let lost = LinkState::Lost { since_s: 1.0, why: why.clone(), attempt: 0, next_s: 1.5 };
    bench.app.absorb(connect::Event::Link { link: Link::Camera, state: lost });
    assert_eq!(reported(&bench.app), "Camera connection lost: the cable is out");
    let retrying = LinkState::Retrying { since_s: 1.0, why, attempt: 1 };
    bench.app.absorb(connect::Event::Link { link: Link::Camera, state: retrying });
    assert_eq!(reported(&bench.app), "Camera connection lost: the cable is out");
}

#[test]
fn a_stop_without_connection_points_to_the_emergency_stop() {
    let mut bench = bench(&FakeCell::new(0));
    bench.app.absorb(connect::Event::Link { link: Link::Control, state: LinkState::StartingCell { why: None } });
    bench.app.apply(motion::Command::Stop);
    assert!(reported(&bench.app).contains("emergency stop"), "{}", reported(&bench.app));
    assert!(bench.app.model().stop_pending);
    bench.app.absorb(motion::Event::Stopped);
    assert!(bench.app.model().stop_pending, "nobody has said that it stands");
}

#[test]
fn leaving_brakes_an_arm_that_it_moves_and_leaves_the_arm_of_others_alone() {
    for moves in [true, false] {
        let cell = FakeCell::new(0);
        cell.script().motions = FakeMotions::Hang;
        let mut bench = bench(&cell);
        until(&mut bench.app, |model| model.control.is_connected() && model.mover.is_connected());
        if moves {
            let goal = MotionGoal::Joints([0.5; 6].into());
            bench.app.apply(motion::Command::Move { goal, what: Text::verbatim("there") });
            until(&mut bench.app, |_| !cell.script().moved.is_empty());
        }
        let began = Instant::now();
        drop(bench);
        assert!(began.elapsed() < Duration::from_secs(2), "{:?}", began.elapsed());
        assert_eq!(cell.script().stops, u32::from(moves));
        assert_eq!(cell.owners(), 1, "no thread is left alone with the arm");
    }
}

#[test]
fn leaving_ends_in_time_while_the_cell_never_answers() {
    let (cell, release) = FakeCell::that_never_answers();
    let mut bench = bench(&cell);
    bench.app.apply(motion::Command::Stop);
    bench.app.collect();
    let began = Instant::now();
    drop(bench);
    assert!(began.elapsed() < Duration::from_secs(2), "{:?}", began.elapsed());
    drop(release);
}

#[test]
fn where_no_browser_opens_the_address_is_shown_but_never_in_place_of_what_is_in_use() {
    let mut bench = bench(&FakeCell::new(0));
    bench.app.absorb(recording::Event::NoBrowser);
    assert_eq!(bench.app.model().dialog, Some(Dialog::RerunAddress));
    bench.app.apply(shell::Command::SetDialog(Some(Dialog::SaveAs)));
    bench.app.absorb(recording::Event::NoBrowser);
    assert_eq!(bench.app.model().dialog, Some(Dialog::SaveAs));
}

#[test]
fn commands_and_events_survive_being_written_down() {
    let commands = [
        Command::Motion(motion::Command::Stop),
        Command::Live(live::Command::PointAt(None)),
        Command::Shell(shell::Command::SetTheme(ThemeChoice::Light)),
        Command::Session(session::Command::Delete(vec![CaptureId(3)])),
        Command::Taught(taught::Command::RunSequence { purpose: Some(CapturePurpose::Verify) }),
        Command::Track(track::Command::SetFollow(Some(FollowRequest::KeepViewWithRoom))),
        Command::Taught(taught::Command::VerifyAtPlanned),
    ];
    for command in commands {
        let text = serde_json::to_string(&command).expect("it can be written");
        assert_eq!(serde_json::from_str::<Command>(&text).expect("it can be read"), command);
    }
    let state = LinkState::Lost { since_s: 1.5, why: Text::verbatim("gone"), attempt: 2, next_s: 2.0 };
    let text =
        serde_json::to_string(&Event::Connect(connect::Event::Link { link: Link::Control, state: state.clone() }))
            .expect("written");
    let Event::Connect(connect::Event::Link { state: read, .. }) = serde_json::from_str(&text).expect("read") else {
        panic!("another event")
    };
    assert_eq!(read, state);
}

#[test]
fn a_pose_that_cannot_be_reached_is_left_out_and_a_stop_ends_the_sequence() {
    let mut bench = bench(&FakeCell::new(0));
    bench.app.cx.model.sequence_runs = true;
    let names = vec!["a".to_owned(), "b".to_owned()];
    bench.app.cx.model.sequence =
        Some(PoseSequence { names, planned: None, purpose: None, outcomes: Vec::new(), began_s: 0.0, guided: None });
    let id = bench.app.cx.numbers.motion;
    bench.app.absorb(motion::Event::Moved { id, outcome: MotionOutcome::Refused(Text::verbatim("too far")) });
    let sequence = bench.app.model().sequence.clone().expect("the sequence");
    assert!(matches!(sequence.outcomes.as_slice(), [StopOutcome::Skipped(_), ..]), "{sequence:?}");

    bench.app.cx.model.sequence_runs = true;
    let id = bench.app.cx.numbers.motion;
    bench.app.absorb(motion::Event::Moved { id, outcome: MotionOutcome::Stopped });
    assert!(!bench.app.model().sequence_runs);
    assert_eq!(bench.app.model().motion, Motion::Idle);
}

#[test]
fn a_pause_breaks_a_sequence_off_and_it_is_continued_with_the_pose_that_has_no_capture() {
    let mut bench = bench(&FakeCell::new(0));
    bench.app.replace_model(sample::solved());
    bench.app.apply(taught::Command::VerifyAtPlanned);
    let id = bench.app.cx.numbers.motion;
    bench.app.absorb(taught::Event::Planned { id, views: Ok(vec![[0.1; 6].into(); 3]) });
    let id = bench.app.cx.numbers.motion;
    bench.app.absorb(motion::Event::Moved { id, outcome: MotionOutcome::Arrived });
    let number = bench.app.cx.numbers.capture;
    let why = Text::verbatim("the simulation is paused");
    let refused = CaptureRefused { kind: RefusalKind::Paused, why, at_s: 3.0 };
    bench.app.absorb(capture::Event::Refused { number, refused });
    let sequence = bench.app.model().sequence.clone().expect("a sequence");
    assert!(!bench.app.model().sequence_runs);
    assert_eq!(sequence.outcomes, [], "the pose is not left out");

    bench.app.apply(taught::Command::ContinueSequence);
    assert!(bench.app.model().sequence_runs);
    assert!(matches!(bench.app.model().motion, Motion::Moving { .. }), "it is on its way to the first again");

    bench.app.apply(motion::Command::Stop);
    let mut another = bench.app.model().session.clone();
    bench.app.absorb(session::Event::Document(Box::new(another.clone())));
    another.folder = Some(PathBuf::from("another session"));
    bench.app.absorb(session::Event::Document(Box::new(another)));
    bench.app.apply(taught::Command::ContinueSequence);
    assert!(!bench.app.model().sequence_runs, "its poses are those of another session");
}

/// Chooses the next pose as a worker does.
pub(super) fn choose(app: &mut App) {
    let id = app.cx.numbers.motion;
    let guided = app.cx.model.sequence.as_mut().and_then(|it| it.guided.as_deref_mut()).expect("a guided sequence");
    guided.waits = Waits::Choice;
    let proposal = Proposal {
        base_from_tip: Pose::identity(),
        camera_from_target: Pose::identity(),
        joints: Some([0.1; 6].into()),
        travel_s: 1.0,
        error_ratio: 0.9,
        part: Part::Position,
    };
    let plan = Plan { proposals: vec![proposal], best_ratio: 0.9, candidates: 9 };
    let why = Why::Gain { from_m: 1e-3, to_m: 9e-4, part: Part::Position };
    let step = ChosenStep::Next(Box::new(Next::Go { plan, why }));
    let guide = guided.guide.clone();
    let chosen_at = app.cx.model.robot.as_ref().expect("connected").joints_rad;
    app.absorb(guided::Event::Chosen {
        id,
        outcome: Ok(Box::new(Choice { guide, step, views_left: Some(3), chosen_at })),
    });
}

pub(super) fn waits(app: &App) -> Option<Waits> {
    app.model().sequence.as_ref().and_then(|it| it.guided.as_deref()).map(|guided| guided.waits)
}

#[test]
fn a_chosen_pose_waits_for_a_person_wherever_there_may_be_a_real_arm() {
    let mut bench = bench(&FakeCell::new(0));
    let app = &mut bench.app;
    let mut model = sample::solved();
    model.source = CellSource::Address("tcp://10.0.0.2:23000".to_owned());
    app.replace_model(model);
    app.apply(guided::Command::CalibrateForMe);
    choose(app);
    assert!(app.model().asked.is_some());
    assert_eq!(app.model().motion, Motion::Idle);

    app.apply(taught::Command::SkipMove);
    assert!(app.model().asked.is_none() && waits(app) != Some(Waits::Nothing), "another one is chosen");
    assert_eq!(app.model().motion, Motion::Idle);

    choose(app);
    app.apply(taught::Command::ConfirmMove);
    assert!(matches!(app.model().motion, Motion::Moving { .. }));
    app.apply(motion::Command::Stop);
    assert!(!app.model().sequence_runs);
    app.apply(taught::Command::ConfirmMove);
    assert!(!app.model().sequence_runs, "nothing begins after a stop");
}

/// The box stays in its place in the base, so it is elsewhere in the camera with every answer.
#[test]
fn the_goal_is_judged_over_the_box_that_was_chosen_for_the_expected_error() {
    let mut bench = bench(&FakeCell::new(0));
    let app = &mut bench.app;
    app.replace_model(sample::solved());
    let judged_over = |app: &mut App| {
        app.apply(guided::Command::CalibrateForMe);
        // The present answer stands in for one from the present method.
        app.cx.model.solve.status = SolveStatus::Idle;
        app.cx.model.solve.fresh = true;
        guided_step(&mut app.cx.model, &app.cx.workers, &mut app.cx.numbers);
        assert_eq!(waits(app), Some(Waits::Choice));
        let guided = app.cx.model.sequence.as_ref().and_then(|it| it.guided.as_deref()).expect("a guided sequence");
        guided.guide.options().tool_box
    };
    assert_eq!(judged_over(app), None);
    app.apply(motion::Command::Stop);
    app.apply(solve::Command::SetTipBox(Some(WorkBox { from_m: [0.3, 0.0, 0.0], to_m: [0.5, 0.2, 0.1] })));
    let [low, high] = judged_over(app).expect("a box").bounds();
    assert_eq!((low.coords.as_slice(), high.coords.as_slice()), (&[0.3, 0.0, 0.0][..], &[0.5, 0.2, 0.1][..]));
}

/// The path was checked from where the arm was.
#[test]
fn an_arm_that_was_moved_meanwhile_does_not_go_where_it_was_let() {
    let mut bench = bench(&FakeCell::new(0));
    let app = &mut bench.app;
    app.replace_model(sample::solved());
    app.apply(taught::Command::SetConfirmMoves(true));
    app.apply(guided::Command::CalibrateForMe);
    choose(app);
    let mut robot = app.model().robot.clone().expect("connected");
    let mut joints = robot.joints_rad.to_vec();
    joints[0] += 0.02;
    robot.joints_rad = JointValues::try_from(&joints[..]).expect("six");
    app.absorb(connect::Event::Robot(robot));
    app.apply(taught::Command::ConfirmMove);
    assert_eq!(app.model().motion, Motion::Idle);
    assert!(reported(app).contains("elsewhere"), "{}", reported(app));
    // Without confirmation the waiting one starts at once.
    choose(app);
    app.apply(taught::Command::SetConfirmMoves(false));
    assert!(matches!(app.model().motion, Motion::Moving { .. }));
}

/// As when another tool is set on the controller while a pose waits.
#[test]
fn a_pose_that_was_chosen_by_a_chain_that_does_not_fit_any_more_is_not_driven_to() {
    let mut bench = bench(&FakeCell::new(0));
    let app = &mut bench.app;
    app.replace_model(sample::solved());
    app.apply(taught::Command::SetConfirmMoves(true));
    app.apply(guided::Command::CalibrateForMe);
    choose(app);
    let cell = app.model().cell.clone().expect("connected");
    let doubt = ArmDoubt::Foreign { distance_m: 0.05, angle_rad: 0.0 };
    app.absorb(connect::Event::Cell(Box::new(CellFacts { arm: None, arm_doubt: Some(doubt), ..cell })));
    assert!(!app.model().sequence_runs);
    app.apply(taught::Command::ConfirmMove);
    assert_eq!(app.model().motion, Motion::Idle);
}

/// The user is guided, with a view that is wanted.
fn led(ending: Option<Ending>) -> Model {
    let mut model = sample::solved();
    let hand = ByHand { ending, ..ByHand::new(GuidedOptions::default(), HandWaits::View, 0.0) };
    model.by_hand = Some(Box::new(hand));
    model
}

#[test]
fn nobody_is_led_any_longer_once_the_arm_goes_by_itself_or_is_another_one() {
    let another = Command::Connect(connect::Command::Connect(CellSource::Address("tcp://127.0.0.1:9".to_owned())));
    for command in [
        Command::Guided(guided::Command::CalibrateForMe),
        another,
        Command::Session(session::Command::SetMode(Mode::EyeToHand)),
    ] {
        let mut bench = bench(&FakeCell::new(0));
        bench.app.replace_model(led(None));
        bench.app.apply(command.clone());
        assert_eq!(bench.app.model().by_hand, None, "{command:?}");
    }
}

#[test]
fn only_a_capture_for_verification_checks_an_answer_by_hand() {
    let mut bench = bench(&FakeCell::new(0));
    bench.app.replace_model(led(Some(Ending::GoalReached {
        promised: Promised { error_m: 1e-4, least_m: 0.0, of: Promise::Point },
    })));
    let checked = |app: &App| app.model().by_hand.as_ref().map(|hand| hand.checked);
    let of = |app: &App, role| app.model().document().captures.iter().find(|it| it.role == role).map(|it| it.id);
    let calibrates = of(&bench.app, Role::Calibration).expect("a capture in the fit");
    bench.app.absorb(capture::Event::Captured { number: 99, id: calibrates });
    assert_eq!(checked(&bench.app), Some(0));
    captured_by_hand(&mut bench.app.cx.model, Some(Role::Verification));
    assert_eq!(checked(&bench.app), Some(1));
}

/// A view that is wanted, and a detection in which the board looks like it.
fn wanted_and_seen(app: &App) -> (Box<Wanted>, LiveDetection) {
    let document = Arc::clone(&app.cx.model.session.document);
    let observations = seen(&app.cx.model, &document).observations;
    let solved = app.cx.model.solve.solved.clone().expect("solved");
    let known =
        Known { observations: &observations, calibration: Some(&solved.calibration), robot: None, elapsed_s: 0.0 };
    let intrinsics = app.cx.model.intrinsics().expect("calibrated");
    let mut guide = HandGuide::new(GuidedOptions { goal_m: 1e-9, least_gain: 0.0, ..GuidedOptions::default() });
    let next = guide.next(&known, &Pose::identity(), &intrinsics, &CancelToken::default());
    let HandNext::Take(wanted) = next else { panic!("{next:?}") };
    let corner = |(index, point)| {
        let px = wanted.intrinsics().project(&(wanted.camera_from_target.isometry() * point));
        Corner::new(index, px.expect("before the camera"))
    };
    let corners = document.meta.target.points().into_iter().enumerate().map(corner).collect();
    let detection = app.cx.model.detection.clone().expect("seen");
    (wanted, LiveDetection { corners: Some(corners), ..detection })
}

/// Nothing else would change there, and the user would read "hold still" for ever.
#[test]
fn where_a_capture_by_hand_was_refused_it_is_not_tried_again() {
    let mut bench = bench(&FakeCell::new(0));
    let app = &mut bench.app;
    app.replace_model(led(None));
    let (wanted, seen) = wanted_and_seen(app);
    app.cx.model.by_hand.as_mut().expect("led").wanted = Some(wanted);
    let stand = |app: &mut App, seen: &LiveDetection| {
        for _ in 0..2 {
            app.absorb(Event::Tick { now_s: app.cx.model.now_s + 0.5 });
            app.absorb(live::Event::Detection(Box::new(seen.clone())));
        }
        app.cx.model.capture.is_some()
    };
    assert!(stand(app, &seen), "at rest in a good view");
    let number = app.cx.numbers.capture;
    let why = Text::verbatim("too similar");
    let refused = CaptureRefused { kind: RefusalKind::TooSimilar, why, at_s: 3.0 };
    app.absorb(capture::Event::Refused { number, refused });
    assert!(!stand(app, &seen), "the same place");
    let at = seen.base_from_tip.expect("the robot is known");
    let moved = Pose::from_isometry(*at.isometry() * nalgebra::Translation3::new(0.0, 0.0, 0.05));
    assert!(stand(app, &LiveDetection { base_from_tip: Some(moved), ..seen }), "another place");
}

#[test]
fn keeping_all_views_is_another_question_and_is_solved_at_once() {
    let mut bench = bench(&FakeCell::new(0));
    bench.app.apply(solve::Command::SetKeepOutliers(true));
    assert!(bench.app.model().keep_outliers);
    let asked = bench.app.cx.numbers.job;
    bench.app.apply(solve::Command::SetKeepOutliers(true));
    assert_eq!(bench.app.cx.numbers.job, asked, "the same question is not asked twice");
    bench.app.apply(solve::Command::SetKeepOutliers(false));
    assert_ne!(bench.app.cx.numbers.job, asked);
}

#[test]
fn an_answer_to_an_earlier_question_is_not_shown() {
    let mut bench = bench(&FakeCell::new(0));
    bench.app.cx.numbers.job = JobId(7);
    bench.app.cx.model.solve.status = SolveStatus::Idle;
    let outcome = crate::solve::SolveOutcome::Failed(Text::verbatim("old"));
    bench.app.absorb(solve::Event::Ended { job: JobId(6), outcome });
    assert_eq!(bench.app.model().solve.status, SolveStatus::Idle);
}

#[test]
fn an_answer_of_the_session_before_does_not_get_into_another_one() {
    let mut bench = bench(&FakeCell::new(0));
    let mut state = bench.app.model().session.clone();
    state.folder = Some(PathBuf::from("first"));
    bench.app.absorb(session::Event::Document(Box::new(state.clone())));
    let job = bench.app.cx.numbers.job;
    // Its captures have yet to be searched, so that nothing new is solved before the old answer comes.
    state.folder = Some(PathBuf::from("second"));
    state.document = sample::captured().session.document;
    bench.app.absorb(session::Event::Document(Box::new(state)));
    let outcome = crate::solve::SolveOutcome::Failed(Text::verbatim("of the first session"));
    bench.app.absorb(solve::Event::Ended { job, outcome });
    assert_eq!(bench.app.model().solve.status, SolveStatus::Idle);
}

#[test]
fn poses_to_verify_at_are_visited_once_they_are_planned_and_a_stop_meanwhile_leaves_nothing_that_begins() {
    let mut bench = bench(&FakeCell::new(0));
    bench.app.apply(taught::Command::VerifyAtPlanned);
    assert!(!bench.app.model().planning, "there is no calibration");
    assert_eq!(bench.app.model().messages.newest().map(|it| it.home), Some(Home::Pane(Pane::Verify)));

    bench.app.replace_model(sample::solved());
    bench.app.apply(taught::Command::VerifyAtPlanned);
    assert!(bench.app.model().planning);
    let id = bench.app.cx.numbers.motion;
    bench.app.apply(motion::Command::Stop);
    assert!(!bench.app.model().planning);
    bench.app.absorb(taught::Event::Planned { id, views: Ok(vec![[0.1; 6].into(); 3]) });
    assert!(!bench.app.model().sequence_runs, "it was stopped");

    bench.app.apply(taught::Command::VerifyAtPlanned);
    let id = bench.app.cx.numbers.motion;
    bench.app.absorb(taught::Event::Planned { id, views: Ok(vec![[0.1; 6].into(); 3]) });
    let sequence = bench.app.model().sequence.clone().expect("a sequence");
    assert!(bench.app.model().sequence_runs && !bench.app.model().planning);
    assert_eq!(sequence.names, ["V1", "V2", "V3"]);
    assert_eq!(sequence.purpose, Some(CapturePurpose::Verify));
    assert!(matches!(bench.app.model().motion, Motion::Moving { .. }), "it is on its way to the first");
    bench.app.apply(taught::Command::StopSequence);
    assert!(!bench.app.model().sequence_runs);

    bench.app.apply(taught::Command::VerifyAtPlanned);
    let id = bench.app.cx.numbers.motion;
    // A motion that is requested meanwhile is refused, and the poses still come.
    bench.app.apply(motion::Command::GoToCapture(CaptureId(1)));
    let other = bench.app.cx.numbers.motion;
    bench.app.absorb(motion::Event::Moved { id: other, outcome: MotionOutcome::Refused(Text::verbatim("busy")) });
    assert!(bench.app.model().planning);
    bench.app.absorb(taught::Event::Planned { id, views: Err(Text::verbatim("the board is too far")) });
    assert!(!bench.app.model().planning && !bench.app.model().sequence_runs);
    assert_eq!(reported(&bench.app), "There are no poses to verify at: the board is too far");
}

#[test]
fn why_following_ended_stands_in_its_pane_and_what_was_asked_for_is_no_warning() {
    let mut bench = bench(&FakeCell::new(0));
    let mut model = sample::tracking();
    model.track.follow = FollowStatus::Off;
    bench.app.replace_model(model);
    bench.app.apply(track::Command::SetFollow(Some(FollowRequest::KeepViewWithRoom)));
    let id = bench.app.cx.numbers.follow.expect("it follows");
    bench
        .app
        .absorb(motion::Event::Moved { id, outcome: MotionOutcome::Failed(Text::verbatim("joint 3 is at its limit")) });
    let newest = bench.app.model().messages.newest().expect("said").clone();
    assert_eq!((newest.home, newest.severity), (Home::Pane(Pane::Track), crate::model::Severity::Warning));
    assert!(matches!(bench.app.model().track.follow, FollowStatus::Ended(_)));

    bench.app.apply(track::Command::SetFollow(Some(FollowRequest::KeepViewWithRoom)));
    assert_eq!(bench.app.model().track.follow, FollowStatus::Off, "the reason before is no longer so");
    let id = bench.app.cx.numbers.follow.expect("it follows");
    bench.app.absorb(motion::Event::Moved { id, outcome: MotionOutcome::Stopped });
    assert_eq!(bench.app.model().messages.newest().map(|it| it.home), Some(Home::StatusLine));
}

#[test]
fn the_view_in_3d_is_fitted_to_every_cell_once_and_then_left_as_a_person_turned_it() {
    let facts = |scene: ShippedScene| {
        let scene = scene.scene().and_then(|scene| scene.resolve(0)).expect("it is shipped");
        let arm = ArmKinematics::new(scene.arm.clone(), scene.world_from_arm);
        let state = RobotState {
            base_from_tip: arm.tip(&scene.start_joints),
            joints_rad: scene.start_joints,
            ..sample_robot()
        };
        (CellFacts { arm: Some(arm), truth: None, ..sample::connected().cell.expect("connected") }, state)
    };
    let mut bench = bench(&FakeCell::new(0));
    let (cell, robot) = facts(ShippedScene::Reference);
    bench.app.absorb(connect::Event::Cell(Box::new(cell)));
    bench.app.absorb(connect::Event::Robot(robot.clone()));
    let first = bench.app.model().scene;
    assert_eq!(Some(first), crate::scene::fitted_view(bench.app.model()));
    let turned = SceneView { azimuth_rad: 1.0, distance_m: 0.5, ..first };
    bench.app.apply(scene::Command::SetView(turned));
    bench.app.absorb(connect::Event::Robot(robot));
    assert_eq!(bench.app.model().scene, turned, "a person looks at something");

    bench.app.apply(connect::Command::Connect(CellSource::BuiltIn(SceneChoice::Shipped(ShippedScene::Panda))));
    let (cell, robot) = facts(ShippedScene::Panda);
    bench.app.absorb(connect::Event::Robot(robot.clone()));
    assert_eq!(bench.app.model().scene, turned, "what it looks like is not known yet");
    bench.app.absorb(connect::Event::Cell(Box::new(cell)));
    let second = bench.app.model().scene;
    assert_eq!(Some(second), crate::scene::fitted_view(bench.app.model()));
    assert!(second != turned && second != first, "{second:?}");
}

#[test]
fn a_session_that_was_named_at_the_start_takes_on_the_cell_that_connects() {
    // The cell reports nothing by itself.
    let (cell, release) = FakeCell::that_never_answers();
    let mut bench = bench(&cell);
    let folder = bench.sessions.path().join("named");
    open_or_begin(&mut bench.app.cx.model, &bench.app.cx.desk, folder.clone());
    until(&mut bench.app, |model| model.session.folder.is_some());
    bench.app.apply(session::Command::SetMode(Mode::EyeToHand));
    let known = sample::connected().cell.expect("connected");
    let panda = ShippedScene::Panda.scene().and_then(|scene| scene.resolve(0)).expect("it is shipped");
    let panda = Some(ArmKinematics::new(panda.arm.clone(), panda.world_from_arm));
    let undecided = CellFacts { arm: None, arm_doubt: Some(ArmDoubt::Open), ..known.clone() };
    for facts in [known.clone(), CellFacts { arm: panda, ..known }] {
        let arm = start::arm(facts.arm.as_ref());
        assert!(arm.is_some());
        bench.app.absorb(connect::Event::Cell(Box::new(facts)));
        until(&mut bench.app, |model| model.document().meta.arm == arm);
        // An arm that may still turn out to be known disables nothing; what is requested later is done later.
        bench.app.absorb(connect::Event::Cell(Box::new(undecided.clone())));
        for mode in [Mode::EyeInHand, Mode::EyeToHand] {
            bench.app.apply(session::Command::SetMode(mode));
            until(&mut bench.app, |model| model.document().meta.mode == mode);
        }
        assert_eq!(bench.app.model().document().meta.arm, arm);
    }
    let kept = bench.app.model().document().meta.clone();
    let meta = &handeye_session::Session::open(&folder).expect("a session").document.meta;
    assert_eq!((&kept, meta.mode), (meta, Mode::EyeToHand));
    drop(release);
}

#[test]
fn tracking_corrects_for_the_arm_that_stands_here_as_long_as_a_person_wants_that_and_the_arm_does_not_follow() {
    let (cell, release) = FakeCell::that_never_answers();
    let mut bench = bench(&cell);
    bench.app.cx.model = sample::with_errors_of_the_arm();
    let corrects = |app: &App| app.model().track.by.as_ref().is_some_and(|by| by.arm.is_some());
    bench.app.apply(track::Command::SetTracking(true));
    assert!(corrects(&bench.app));
    bench.app.apply(track::Command::SetCorrected(false));
    assert!(!corrects(&bench.app));
    bench.app.apply(track::Command::SetCorrected(true));
    assert!(corrects(&bench.app));

    // With another tool than that of the answer the tip is elsewhere.
    let robot = sample_robot();
    let tool = Pose::from_translation_xyzw([0.0, 0.0, 0.01], [0.0, 0.0, 0.0, 1.0]);
    let other = RobotState { base_from_tip: robot.base_from_tip * tool, ..robot.clone() };
    bench.app.absorb(connect::Event::Robot(other.clone()));
    assert!(!corrects(&bench.app));
    bench.app.absorb(connect::Event::Robot(robot));
    assert!(corrects(&bench.app));
    bench.app.cx.model.track.request = Some(FollowRequest::KeepView);
    bench.app.absorb(connect::Event::Robot(other));
    assert!(corrects(&bench.app), "an arm that follows goes on as it began");
    drop(release);
}

fn sample_robot() -> RobotState {
    sample::connected().robot.expect("connected")
}
