//! The motion worker with a cell that obeys.

use handeye_arm::JointValues;
use std::sync::Mutex;
use std::sync::PoisonError;

use crossbeam_channel::Receiver;

use super::*;
use crate::model::{CellFacts, FollowRequest, FollowStatus, Link, LinkState, MotionGoal, MotionOutcome};
use crate::motion::jog_line::HELD_S;
use crate::motion::state::Correction;
use crate::testing::sample;
use crate::text::{Language, Text};
use crate::track::worker::TrackedBy;
use crate::worker::fake::{FakeCell, FakeMotions};
use crate::{connect, messages, motion, taught, track};
use handeye_link::{PortError, Room};

/// A healthy worker answers within milliseconds; this is for a machine that is busy.
const PATIENCE: Duration = Duration::from_mins(1);

/// Workers, what they reported, and a clock that the test moves.
pub(super) struct Bench {
    pub workers: Workers,
    woken: Receiver<()>,
    now_s: Arc<Mutex<f64>>,
    events: Vec<Event>,
    /// Events before this one have been waited for.
    pub next: usize,
}

impl Bench {
    pub fn start(source: &CellSource, connector: &Arc<dyn Cell>) -> Self {
        let (wake, woken) = bounded(1);
        let waker: Waker = Arc::new(move || {
            // A full channel wakes as well as a fuller one.
            let _full = wake.try_send(()).is_err();
        });
        let now_s = Arc::new(Mutex::new(0.0));
        let shown = Arc::clone(&now_s);
        let clock: Clock = Arc::new(move || *shown.lock().unwrap_or_else(PoisonError::into_inner));
        let view = ViewSettings::default();
        let workers =
            Workers::start(source, &view, connector, bounded(1).0, &Arc::default(), &clock, &waker).expect("threads");
        let mut bench = Self { workers, woken, now_s, events: Vec::new(), next: 0 };
        for link in [Link::Control, Link::Motion] {
            bench.next = 0;
            bench.until_link(link, LinkState::is_connected);
        }
        bench
    }

    /// The clock of the application shows another time.
    pub(crate) fn set_clock(&self, now_s: f64) {
        *self.now_s.lock().unwrap_or_else(PoisonError::into_inner) = now_s;
    }

    /// Collects events until one matches; the next call continues after it.
    pub fn until<T>(&mut self, what: &str, wanted: impl Fn(&Event) -> Option<T>) -> T {
        let deadline = Instant::now() + PATIENCE;
        loop {
            while let Some(event) = self.events.get(self.next) {
                self.next += 1;
                if let Some(found) = wanted(event) {
                    return found;
                }
            }
            let Self { workers, events, .. } = self;
            let before = events.len();
            workers.drain(|event| events.push(event));
            if events.len() == before {
                assert!(self.woken.recv_deadline(deadline).is_ok(), "waited for {what} in vain, got {:?}", self.events);
            }
        }
    }

    pub(crate) fn until_link(&mut self, link: Link, wanted: impl Fn(&LinkState) -> bool) -> LinkState {
        self.until("a state of a connection", |event| match event {
            Event::Connect(connect::Event::Link { link: which, state }) if *which == link && wanted(state) => {
                Some(state.clone())
            }
            _ => None,
        })
    }

    pub fn moved(&mut self, id: u64) -> MotionOutcome {
        self.until("the end of a motion", |event| match event {
            Event::Motion(motion::Event::Moved { id: which, outcome }) if *which == MotionId(id) => {
                Some(outcome.clone())
            }
            _ => None,
        })
    }

    pub(crate) fn jog_ended(&mut self) -> Option<String> {
        self.until("the end of a jog", |event| match event {
            Event::Motion(motion::Event::JogEnded { why }) => {
                Some(why.as_ref().map(|why| why.in_language(Language::English)))
            }
            _ => None,
        })
    }

    pub fn stopped(&mut self) {
        self.until("the confirmation of a stop", |event| {
            matches!(event, Event::Motion(motion::Event::Stopped)).then_some(())
        });
    }

    pub fn facts(&mut self) -> CellFacts {
        self.next = 0;
        self.until("what is known of the cell", |event| match event {
            Event::Connect(connect::Event::Cell(facts)) => Some(facts.as_ref().clone()),
            _ => None,
        })
    }

    pub fn move_to(&self, id: u64, goal: MotionGoal, speed: f64) {
        self.workers
            .move_to(MotionRequest { id: MotionId(id), goal, speed, correction: None })
            .expect("the worker is there");
    }

    /// Events of the ends of motions so far.
    pub fn ends(&mut self) -> usize {
        let Self { workers, events, .. } = self;
        workers.drain(|event| events.push(event));
        self.events.iter().filter(|event| matches!(event, Event::Motion(motion::Event::Moved { .. }))).count()
    }
}

#[test]
fn a_corrected_move_is_sent_by_the_errors_of_the_arm_and_one_out_of_reach_is_refused() {
    let (cell, mut bench) = fake(FakeMotions::Arrive);
    let arm = Arc::new(sample::corrected_arm());
    let near_rad = vec![0.1, 0.5, -1.0, 0.0, 1.5, 0.0];
    let wanted = arm.arm.forward(&near_rad).expect("six joints");
    let correction = Correction { arm: Arc::clone(&arm), near_rad };
    let request = |id, goal| MotionRequest { id: MotionId(id), goal, speed: 1.0, correction: Some(correction.clone()) };
    bench.workers.move_to(request(1, MotionGoal::Tip(wanted))).expect("the worker is there");
    assert_eq!(bench.moved(1), MotionOutcome::Arrived);
    let [MotionGoal::Tip(sent)] = cell.script().moved[..] else { panic!("one move") };
    assert!(sent.distance_to(&wanted).0 > 1e-4, "the errors are seen");
    let joints = arm.arm.inverse(&sent, &correction.near_rad).expect("within reach");
    assert!(arm.actual(&joints).expect("six joints").distance_to(&wanted).0 < 1e-8, "the tip gets there");
    let far = Pose::from_isometry(nalgebra::Isometry3::translation(9.0, 0.0, 0.0));
    bench.workers.move_to(request(2, MotionGoal::Tip(far))).expect("the worker is there");
    assert!(matches!(bench.moved(2), MotionOutcome::Refused(_)));
    assert_eq!(cell.script().moved.len(), 1, "nothing moved");
}

const HOME: MotionGoal = MotionGoal::Joints(JointValues::of([0.0, 0.5, -1.0, 0.0, 1.5, 0.0]));
const LEFT: Jog = Jog::Joint { index: 0, forward: true };
const RIGHT: Jog = Jog::Joint { index: 0, forward: false };

fn fake(motions: FakeMotions) -> (FakeCell, Bench) {
    let cell = FakeCell::new(1);
    cell.script().motions = motions;
    let connector: Arc<dyn Cell> = Arc::new(cell.clone());
    let bench = Bench::start(&CellSource::default(), &connector);
    (cell, bench)
}

/// Waits until the cell has begun this many motions and jogs.
fn begun(cell: &FakeCell, count: usize) {
    let deadline = Instant::now() + PATIENCE;
    loop {
        let script = cell.script();
        if script.moved.len() + script.jogged.len() >= count {
            return;
        }
        drop(script);
        assert!(Instant::now() < deadline, "nothing was begun");
        std::thread::yield_now();
    }
}

#[test]
fn the_facts_of_the_cell_are_told_after_connecting() {
    let (_cell, mut bench) = fake(FakeMotions::Arrive);
    assert!(bench.facts().arm.is_some());
}

/// The window is in a long frame: nothing takes in what the workers report, and a driver sends many messages.
#[test]
fn a_stop_does_not_wait_for_a_window_that_takes_nothing_in() {
    let (cell, bench) = fake(FakeMotions::Arrive);
    cell.script().lines = 2 * MAX_EVENTS;
    let deadline = Instant::now() + PATIENCE;
    let asked = cell.script().asked_for_lines;
    while cell.script().asked_for_lines < asked + 2 {
        assert!(Instant::now() < deadline, "the worker waits for the window");
        std::thread::yield_now();
    }
    bench.workers.stop_line().press_outside();
    while cell.script().stops == 0 {
        assert!(Instant::now() < deadline, "the arm is not stopped");
        std::thread::yield_now();
    }
}

#[test]
fn nothing_begins_between_a_stop_of_another_thread_and_the_note_that_the_window_takes() {
    let (cell, mut bench) = fake(FakeMotions::Arrive);
    let stop = Arc::clone(bench.workers.stop_line());
    let number = stop.press_outside();
    bench.stopped();
    // A sequence that continues, a button that was pressed before.
    bench.move_to(1, HOME, 1.0);
    assert!(matches!(bench.moved(1), MotionOutcome::Refused(_)));
    bench.workers.hold_jog(LEFT, 0.5, None);
    assert!(bench.jog_ended().is_some_and(|why| why.contains("being stopped")));
    assert!(cell.script().moved.is_empty() && cell.script().jogged.is_empty());
    bench.workers.release_jog();
    stop.note(number);
    bench.move_to(2, HOME, 1.0);
    assert_eq!(bench.moved(2), MotionOutcome::Arrived);
}

#[test]
fn what_is_let_go_at_a_page_stands_while_the_window_still_takes_it_for_held() {
    let (cell, mut bench) = fake(FakeMotions::Arrive);
    let grip = Arc::clone(bench.workers.stop_line().grip());
    bench.workers.hold_jog(LEFT, 0.5, None);
    begun(&cell, 1);
    grip.let_go();
    assert_eq!(bench.jog_ended(), None);
    for step in 1..20 {
        // Frames that take longer than a press holds without a report.
        bench.set_clock(f64::from(step));
        bench.workers.hold_jog(LEFT, 0.5, None);
    }
    bench.workers.release_jog();
    assert_eq!(bench.jog_ended(), None);
    assert_eq!(cell.script().jogged.len(), 1, "it begins again by itself");
    grip.know(grip.times(Instant::now()));
    bench.workers.hold_jog(RIGHT, 0.5, None);
    begun(&cell, 2);
}

#[test]
fn a_motion_arrives_or_is_refused_with_the_words_of_the_cell() {
    let (cell, mut bench) = fake(FakeMotions::Arrive);
    bench.move_to(1, HOME, 1.0);
    assert_eq!(bench.moved(1), MotionOutcome::Arrived);
    assert_eq!(cell.script().moved, [HOME]);
    let why = Text::verbatim("the table is in the way");
    cell.script().motions = FakeMotions::Refuse(why.clone());
    bench.move_to(2, HOME, 1.0);
    assert_eq!(bench.moved(2), MotionOutcome::Refused(why));
    bench.workers.jog_step(MotionId(3), LEFT, 0.1, 0.5, None).expect("the worker is there");
    assert!(matches!(bench.moved(3), MotionOutcome::Refused(_)));
    assert_eq!(bench.ends(), 3);
}

#[test]
fn one_motion_at_a_time_and_a_stop_leaves_none() {
    let (cell, mut bench) = fake(FakeMotions::Hang);
    bench.move_to(1, HOME, 1.0);
    begun(&cell, 1);
    bench.move_to(2, HOME, 1.0);
    let MotionOutcome::Refused(why) = bench.moved(2) else { panic!("it was not refused") };
    assert_eq!(why.in_language(Language::English), "a motion of the joints is still under way");
    bench.workers.press_stop();
    assert_eq!(bench.moved(1), MotionOutcome::Stopped);
    bench.next = 0;
    bench.stopped();
    assert_eq!(bench.ends(), 2);
    assert_eq!(cell.script().moved, [HOME]);
    assert_eq!(cell.script().stops, 1);
    cell.script().motions = FakeMotions::Arrive;
    bench.move_to(3, HOME, 1.0);
    assert_eq!(bench.moved(3), MotionOutcome::Arrived, "after a stop the arm moves again");
}

#[test]
fn a_motion_can_be_cancelled_without_a_stop() {
    let (cell, mut bench) = fake(FakeMotions::Hang);
    bench.move_to(1, HOME, 1.0);
    begun(&cell, 1);
    bench.workers.cancel_motion();
    assert_eq!(bench.moved(1), MotionOutcome::Stopped);
    assert_eq!(cell.script().stops, 0);
}

#[test]
fn nothing_begins_before_a_stop_is_done() {
    let (cell, mut bench) = fake(FakeMotions::Arrive);
    cell.script().refuse_tasks = Some(PortError::Lost(Text::verbatim("the cable is out")));
    bench.workers.press_stop();
    bench.move_to(1, HOME, 1.0);
    let MotionOutcome::Refused(why) = bench.moved(1) else { panic!("it was not refused") };
    assert_eq!(why.in_language(Language::English), "The arm is being stopped");
    bench.workers.hold_jog(LEFT, 0.5, None);
    assert_eq!(bench.jog_ended().as_deref(), Some("The arm is being stopped"));
    cell.script().refuse_tasks = None;
    bench.stopped();
    assert!(cell.script().moved.is_empty());
    assert!(cell.script().jogged.is_empty());
}

#[test]
fn a_jog_lasts_for_as_long_as_its_button_is_held() {
    let (cell, mut bench) = fake(FakeMotions::Arrive);
    bench.workers.hold_jog(LEFT, 0.5, None);
    begun(&cell, 1);
    for tenth in 1..20 {
        bench.set_clock(f64::from(tenth) * 0.1);
        bench.workers.hold_jog(LEFT, 0.5, None);
    }
    bench.workers.release_jog();
    assert_eq!(bench.jog_ended(), None);
    assert_eq!(cell.script().jogged.len(), 1, "one jog for all of it");
}

#[test]
fn a_window_that_falls_silent_lets_the_arm_go() {
    let (cell, mut bench) = fake(FakeMotions::Arrive);
    bench.workers.hold_jog(LEFT, 0.5, None);
    begun(&cell, 1);
    bench.set_clock(HELD_S + 0.01);
    let why = bench.jog_ended().expect("a reason");
    assert!(why.contains("no signal from the jog button for 0.3 s"), "{why}");
}

#[test]
fn a_stop_ends_a_jog_and_the_held_button_does_not_begin_it_again() {
    let (cell, mut bench) = fake(FakeMotions::Arrive);
    bench.workers.hold_jog(LEFT, 0.5, None);
    begun(&cell, 1);
    bench.workers.press_stop();
    assert_eq!(bench.jog_ended().as_deref(), Some("The arm was stopped"));
    bench.next = 0;
    bench.stopped();
    for tenth in 1..20 {
        bench.set_clock(f64::from(tenth) * 0.1);
        bench.workers.hold_jog(LEFT, 0.5, None);
    }
    bench.move_to(1, HOME, 1.0);
    assert_eq!(bench.moved(1), MotionOutcome::Arrived, "the worker has looked");
    assert_eq!(cell.script().jogged.len(), 1);
    bench.workers.release_jog();
    bench.workers.hold_jog(LEFT, 0.5, None);
    begun(&cell, 3);
}

#[test]
fn another_button_takes_over_without_a_word_in_between() {
    let (cell, mut bench) = fake(FakeMotions::Arrive);
    bench.workers.hold_jog(LEFT, 0.5, None);
    begun(&cell, 1);
    bench.workers.hold_jog(RIGHT, 0.5, None);
    begun(&cell, 2);
    bench.workers.release_jog();
    assert_eq!(bench.jog_ended(), None);
    let ends =
        bench.events.iter().filter(|event| matches!(event, Event::Motion(motion::Event::JogEnded { .. }))).count();
    assert_eq!(ends, 1);
}

#[test]
fn a_connection_that_breaks_ends_the_motion_and_the_jog() {
    let (cell, mut bench) = fake(FakeMotions::Hang);
    bench.move_to(1, HOME, 1.0);
    begun(&cell, 1);
    cell.script().broken = true;
    assert!(matches!(bench.moved(1), MotionOutcome::Failed(_)));
    bench.until_link(Link::Motion, |state| matches!(state, LinkState::Lost { .. }));
    bench.move_to(2, HOME, 1.0);
    assert!(matches!(bench.moved(2), MotionOutcome::Refused(_)));
    cell.script().broken = false;
    bench.until_link(Link::Motion, LinkState::is_connected);
    bench.workers.hold_jog(LEFT, 0.5, None);
    begun(&cell, 2);
    cell.script().broken = true;
    assert!(bench.jog_ended().is_some());
}

/// The board of the sample is tracked.
fn tracked(bench: &Bench) {
    let model = sample::tracking();
    let setup = handeye_track::Setup {
        target: model.document().meta.target,
        calibrated: model.calibrated().expect("calibrated").clone(),
        motion: handeye_track::MotionModel::default(),
    };
    bench.workers.follow.set_up(Some(TrackedBy { setup, arm: None }));
    bench.workers.follow.see(&model.track.newest.as_ref().expect("tracked").update);
}

#[test]
fn following_moves_to_where_there_is_room_first_when_that_is_wished_and_needed() {
    let (cell, mut bench) = fake(FakeMotions::Arrive);
    tracked(&bench);
    let joints = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6];
    let follow = |bench: &Bench, id, requested| {
        bench.workers.follow(MotionId(id), requested, 0.25).expect("the worker is there");
    };
    follow(&bench, 1, FollowRequest::KeepViewWithRoom);
    bench.moved(1);
    assert!(cell.script().moved.is_empty(), "there is room");
    cell.script().room = Room::At(joints.into());
    follow(&bench, 2, FollowRequest::KeepView);
    bench.moved(2);
    assert!(cell.script().moved.is_empty(), "it was not wished");
    follow(&bench, 3, FollowRequest::KeepViewWithRoom);
    bench.until("word of the move", |event| {
        matches!(event, Event::Track(track::Event::Follow(FollowStatus::MakingRoom))).then_some(())
    });
    let reported = bench.until("what it does", |event| match event {
        Event::Messages(messages::Event::Notice { text, .. }) => Some(text.in_language(Language::English)),
        _ => None,
    });
    assert!(reported.contains("no room to follow the board"), "{reported}");
    bench.moved(3);
    assert_eq!(cell.script().moved, [MotionGoal::Joints(joints.into())]);
    let why = Text::verbatim("the board is at the column");
    cell.script().room = Room::Nowhere(why.clone());
    follow(&bench, 4, FollowRequest::KeepViewWithRoom);
    assert_eq!(bench.moved(4), MotionOutcome::Refused(why));
}

#[test]
fn a_stop_on_the_way_to_where_there_is_room_ends_the_following() {
    let (cell, mut bench) = fake(FakeMotions::Hang);
    tracked(&bench);
    cell.script().room = Room::At([0.0; 6].into());
    bench.workers.follow(MotionId(1), FollowRequest::KeepViewWithRoom, 0.25).expect("the worker is there");
    begun(&cell, 1);
    bench.workers.press_stop();
    assert_eq!(bench.moved(1), MotionOutcome::Stopped);
    bench.next = 0;
    bench.stopped();
}

#[test]
fn poses_are_planned_without_a_motion_and_the_arm_is_free_afterwards() {
    let (cell, mut bench) = fake(FakeMotions::Arrive);
    tracked(&bench);
    let board = bench.workers.follow.board_in_view().expect("tracked");
    let request = ViewsRequest { board, taken: Vec::new(), count: 2, seed: 1 };
    let views = vec![JointValues::from([0.1; 6]), [0.2; 6].into()];
    cell.script().views = Ok(views.clone());
    bench.workers.plan_views(MotionId(1), request).expect("the worker is there");
    let planned = bench.until("the poses", |event| match event {
        Event::Taught(taught::Event::Planned { id: MotionId(1), views }) => Some(views.clone()),
        _ => None,
    });
    assert_eq!(planned, Ok(views));
    bench.move_to(2, HOME, 1.0);
    assert_eq!(bench.moved(2), MotionOutcome::Arrived);
    assert_eq!(cell.script().moved, [HOME]);
}
