use std::sync::Arc;
use std::time::{Duration, Instant};

use crossbeam_channel::{Receiver, bounded};

use super::*;
use crate::model::{Link, LinkState, Severity, Simulation};
use crate::text::Text;
use crate::worker::fake::FakeCell;
use crate::{connect, live, messages, motion};
use handeye_link::PortError;

/// A healthy worker answers within milliseconds; this is for a machine that is busy.
const PATIENCE: Duration = Duration::from_secs(20);

struct Bench {
    workers: Workers,
    woken: Receiver<()>,
    events: Vec<Event>,
    /// Events before this one have been waited for.
    next: usize,
}

impl Bench {
    fn start(source: &CellSource, cell: &FakeCell) -> Self {
        let (wake, woken) = bounded(1);
        let waker: Waker = wakes(wake);
        let clock: Clock = Arc::new(|| 7.0);
        let connector: Arc<dyn Cell> = Arc::new(cell.clone());
        let workers =
            Workers::start(source, &ViewSettings::default(), &connector, bounded(1).0, &Arc::default(), &clock, &waker)
                .expect("threads can be started");
        Self { workers, woken, events: Vec::new(), next: 0 }
    }

    fn built_in(cell: &FakeCell) -> Self {
        Self::start(&CellSource::default(), cell)
    }

    /// Collects events until one matches; the next call continues after it.
    fn until(&mut self, what: &str, wanted: impl Fn(&Event) -> bool) -> Event {
        let deadline = Instant::now() + PATIENCE;
        loop {
            if let Some(found) = self.events[self.next..].iter().position(&wanted) {
                self.next += found + 1;
                return self.events[self.next - 1].clone();
            }
            let Self { workers, events, .. } = self;
            let before = events.len();
            workers.drain(|event| events.push(event));
            if events.len() > before {
                continue;
            }
            assert!(self.woken.recv_deadline(deadline).is_ok(), "waited for {what} in vain, got {:?}", self.events);
        }
    }

    fn until_link(&mut self, link: Link, what: &str, wanted: impl Fn(&LinkState) -> bool) {
        self.until(what, |event| is(event, link, &wanted));
    }
}

fn runs(event: &Event) -> bool {
    matches!(event, Event::Connect(connect::Event::Robot(robot)) if robot.simulation == Simulation::Running)
}

#[test]
fn both_connections_are_made_and_images_and_robot_arrive() {
    let cell = FakeCell::new(u64::MAX);
    let mut bench = Bench::built_in(&cell);
    bench.until_link(Link::Control, "control", LinkState::is_connected);
    let Event::Live(live::Event::Frame { info, images: Some(images), .. }) =
        bench.until("an image", |event| matches!(event, Event::Live(live::Event::Frame { .. })))
    else {
        panic!("not an image")
    };
    assert_eq!(info.received_s, 7.0);
    assert_eq!(images.depth.as_ref().expect("it measures depth").colours.dimensions(), images.rgb.dimensions());
    assert!(info.depth_range_m[0] <= 0.4 && info.depth_range_m[1] >= 0.79, "{:?}", info.depth_range_m);
    bench.until("the robot", |event| matches!(event, Event::Connect(connect::Event::Robot(_))));
}

#[test]
fn a_server_that_comes_up_later_is_found_without_being_asked() {
    let cell = FakeCell::new(1);
    cell.script().refusals = vec![PortError::Lost(Text::verbatim("nothing answers")); 4];
    let mut bench = Bench::start(&CellSource::Address("tcp://fake:1".to_owned()), &cell);
    bench.until_link(
        Link::Camera,
        "the reason",
        |state| matches!(state, LinkState::Searching { why: Some(why), .. } if why.foreign_words() == Some("nothing answers")),
    );
    bench.until_link(Link::Camera, "the camera", LinkState::is_connected);
}

#[test]
fn a_connection_that_breaks_is_reported_and_made_again() {
    let cell = FakeCell::new(u64::MAX);
    let mut bench = Bench::built_in(&cell);
    for link in [Link::Camera, Link::Control] {
        bench.until_or_seen(link, LinkState::is_connected);
    }
    cell.script().broken = true;
    for link in [Link::Camera, Link::Control] {
        bench.until_or_seen(
            link,
            |state| matches!(state, LinkState::Lost { since_s, why, .. } if *since_s == 7.0 && why.foreign_words().is_some_and(|why| why.contains("cable"))),
        );
    }
    cell.script().broken = false;
    for link in [Link::Camera, Link::Control] {
        let lost_at = bench.index_of_last(link, |state| matches!(state, LinkState::Lost { .. }));
        bench.until_or_seen_after(lost_at, link, LinkState::is_connected);
        let retries = bench.events[lost_at.min(bench.events.len())..]
            .iter()
            .filter(|event| is(event, link, |state| matches!(state, LinkState::Retrying { .. })));
        assert!(retries.count() >= 1, "the retry is visible");
    }
}

#[test]
fn the_newest_image_wins_and_the_others_are_counted() {
    let cell = FakeCell::new(5);
    let (wake, woken) = bounded(64);
    let waker: Waker = wakes(wake);
    let clock: Clock = Arc::new(|| 0.0);
    let connector: Arc<dyn Cell> = Arc::new(cell.clone());
    let workers = Workers::start(
        &CellSource::default(),
        &ViewSettings::default(),
        &connector,
        bounded(1).0,
        &Arc::default(),
        &clock,
        &waker,
    )
    .expect("threads");
    // Nobody drains until the fifth image has been put; each put wakes.
    let mut robot_or_image = 0;
    while cell.script().frames < 5 || robot_or_image < 12 {
        woken.recv_timeout(PATIENCE).expect("the workers go on");
        robot_or_image += 1;
    }
    let mut frames = Vec::new();
    workers.drain(|event| {
        if let Event::Live(live::Event::Frame { info, dropped, images }) = event {
            frames.push((info.number, dropped, images));
        }
    });
    let (number, dropped, images) = frames.pop().expect("an image");
    assert!(frames.is_empty(), "one image only");
    assert_eq!((number, dropped), (5, 4));
    assert_eq!(images.expect("pixels").rgb, FakeCell::rgb(5));
}

#[test]
fn images_of_an_instant_that_was_seen_are_not_fetched_again() {
    let cell = FakeCell::new(2);
    let mut bench = Bench::built_in(&cell);
    bench.until(
        "the second image",
        |event| matches!(event, Event::Live(live::Event::Frame { info, .. }) if info.number == 2),
    );
    for _ in 0..5 {
        bench.until("the robot", |event| matches!(event, Event::Connect(connect::Event::Robot(_))));
    }
    let more = bench
        .events
        .iter()
        .filter(|event| matches!(event, Event::Live(live::Event::Frame { info, .. }) if info.number > 2));
    assert_eq!(more.count(), 0);
}

#[test]
fn a_stop_reaches_the_arm() {
    let cell = FakeCell::new(1);
    let mut bench = Bench::built_in(&cell);
    bench.until_link(Link::Control, "control", LinkState::is_connected);
    bench.workers.press_stop();
    bench.until("the confirmation", |event| matches!(event, Event::Motion(motion::Event::Stopped)));
    assert_eq!(cell.script().stops, 1);
}

#[test]
fn a_stop_pressed_while_the_connection_is_down_is_carried_out_when_it_is_back() {
    let cell = FakeCell::new(1);
    cell.script().refusals = vec![PortError::Lost(Text::verbatim("nothing answers")); 6];
    let mut bench = Bench::built_in(&cell);
    bench.workers.press_stop();
    bench.until("the confirmation", |event| matches!(event, Event::Motion(motion::Event::Stopped)));
}

#[test]
fn a_stop_that_fails_is_told_and_tried_again() {
    let cell = FakeCell::new(1);
    cell.script().refuse_tasks = Some(PortError::Lost(Text::verbatim("the cable is out")));
    let mut bench = Bench::built_in(&cell);
    bench.workers.press_stop();
    bench.until("the failure", |event| {
        matches!(event, Event::Messages(messages::Event::Notice { severity: Severity::Error, text })
                if text.in_language(crate::text::Language::English).contains("may still move"))
    });
    cell.script().refuse_tasks = None;
    bench.until("the confirmation", |event| matches!(event, Event::Motion(motion::Event::Stopped)));
}

#[test]
fn the_simulation_of_the_built_in_cell_is_started_and_that_of_somebody_else_is_not() {
    let cell = FakeCell::new(1);
    cell.script().simulation = Simulation::Stopped;
    let mut bench = Bench::built_in(&cell);
    bench.until("it runs", runs);

    cell.script().simulation = Simulation::Stopped;
    let mut bench = Bench::start(&CellSource::Address("tcp://fake:1".to_owned()), &cell);
    for _ in 0..3 {
        bench.until("the robot", |event| matches!(event, Event::Connect(connect::Event::Robot(_))));
    }
    assert_eq!(cell.script().simulation, Simulation::Stopped);
    bench.workers.ask_control(Request::Do(ControlTask::StartSimulation)).expect("it takes requests");
    bench.until("it runs", runs);
}

#[test]
fn what_cannot_work_waits_for_the_user_and_is_then_tried_again() {
    let cell = FakeCell::new(1);
    cell.script().refusals = vec![PortError::Hopeless(Text::verbatim("no free port")); 2];
    let mut bench = Bench::built_in(&cell);
    for link in [Link::Control, Link::Camera] {
        bench.until_or_seen(link, |state| *state == LinkState::Failed { why: Text::verbatim("no free port") });
    }
    bench.workers.ask_control(Request::Reconnect).expect("it takes requests");
    bench.until_link(Link::Control, "control", LinkState::is_connected);
}

#[test]
fn the_workers_end_within_the_deadline() {
    let cell = FakeCell::new(u64::MAX);
    let mut bench = Bench::built_in(&cell);
    bench.until_link(Link::Camera, "the camera", LinkState::is_connected);
    assert_eq!(bench.workers.shut_down(PATIENCE), 0);
    // Each thread held the connector; a thread that is still alive would still hold it.
    assert_eq!(cell.owners(), 1);
}

#[test]
fn a_server_that_never_answers_does_not_hold_up_the_end() {
    let (cell, release) = FakeCell::that_never_answers();
    let mut bench = Bench::built_in(&cell);
    bench.until_link(Link::Camera, "the camera", LinkState::is_connected);
    let began = Instant::now();
    let left_alone = bench.workers.shut_down(Duration::from_millis(100));
    assert!(left_alone >= 1, "the fake ignores every cancellation");
    assert!(began.elapsed() < PATIENCE);
    drop(release);
}

#[test]
fn requests_to_a_worker_that_hangs_are_refused_when_the_queue_is_full() {
    let (cell, _release) = FakeCell::that_never_answers();
    let mut bench = Bench::start(&CellSource::Address("tcp://fake:1".to_owned()), &cell);
    bench.until_link(Link::Control, "control", LinkState::is_connected);
    let taken = (0..1000).filter(|_| bench.workers.ask_control(Request::Reconnect).is_ok()).count();
    assert!(taken <= MAX_REQUESTS, "{taken}");
    assert_eq!(bench.workers.ask_control(Request::Reconnect), Err(Busy));
    bench.workers.press_stop();
    assert!(bench.workers.stop.is_pressed(), "a stop is never refused");
    bench.workers.shut_down(Duration::ZERO);
}

fn wakes(wake: crossbeam_channel::Sender<()>) -> Waker {
    // A full channel wakes as well as a fuller one.
    Arc::new(move || {
        let _full = wake.try_send(()).is_err();
    })
}

fn is(event: &Event, link: Link, wanted: impl Fn(&LinkState) -> bool) -> bool {
    matches!(event, Event::Connect(connect::Event::Link { link: which, state }) if *which == link && wanted(state))
}

impl Bench {
    /// As [`Self::until_link`], but an event that was collected already counts too.
    fn until_or_seen(&mut self, link: Link, wanted: impl Fn(&LinkState) -> bool) {
        self.until_or_seen_after(0, link, wanted);
    }

    fn until_or_seen_after(&mut self, first: usize, link: Link, wanted: impl Fn(&LinkState) -> bool) {
        self.next = first;
        self.until_link(link, "a state", wanted);
    }

    fn index_of_last(&self, link: Link, wanted: impl Fn(&LinkState) -> bool) -> usize {
        self.events.iter().rposition(|event| is(event, link, &wanted)).unwrap_or_default()
    }
}
