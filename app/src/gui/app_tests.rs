use std::time::{Duration, Instant};

use super::*;
use crate::model::{DepthScale, Simulation, ThemeChoice};
use crate::text::Language;
use crate::worker::fake::FakeCell;

fn app(cell: &FakeCell) -> App {
    let connector: Arc<dyn Connector> = Arc::new(cell.clone());
    let clock: Clock = Arc::new(|| 3.0);
    let waker: Waker = Arc::new(|| {});
    App::start(CellSource::BuiltIn, ViewSettings::default(), &connector, clock, &waker).expect("threads")
}

fn message(app: &App) -> String {
    app.model().messages.newest().map_or_else(String::new, |message| message.text.say(Language::English))
}

#[test]
fn commands_return_at_once_while_the_cell_never_answers() {
    let (cell, release) = FakeCell::that_never_answers();
    let mut app = app(&cell);
    let began = Instant::now();
    for _ in 0..100 {
        for command in [
            Command::Stop,
            Command::StartSimulation,
            Command::Reconnect,
            Command::SetDepthScale(DepthScale::Full),
            Command::SetTheme(ThemeChoice::Light),
        ] {
            app.apply(command);
            app.collect();
        }
    }
    // 500 commands; a single one that waited for a reply would wait for ever.
    assert!(began.elapsed() < Duration::from_secs(10));
    app.apply(Command::StartSimulation);
    assert!(message(&app).contains("does not answer"), "{}", message(&app));
    drop(release);
}

#[test]
fn a_lost_connection_is_said_and_a_retry_does_not_hide_why() {
    let mut app = app(&FakeCell::new(0));
    let connected = LinkState::Connected { address: "tcp://a:1".to_owned(), server: "sim".to_owned() };
    let why = "the cable is out".to_owned();
    app.absorb(Event::Link { link: Link::Camera, state: connected });
    app.absorb(Event::Link {
        link: Link::Camera,
        state: LinkState::Lost { since_s: 1.0, why: why.clone(), attempt: 0 },
    });
    assert_eq!(message(&app), "Camera connection lost: the cable is out");
    app.absorb(Event::Link { link: Link::Camera, state: LinkState::Retrying { since_s: 1.0, why, attempt: 1 } });
    assert_eq!(message(&app), "Camera connection lost: the cable is out");
}

#[test]
fn a_stop_without_connection_points_to_the_emergency_stop() {
    let mut app = app(&FakeCell::new(0));
    app.absorb(Event::Link { link: Link::Control, state: LinkState::StartingCell { why: None } });
    app.apply(Command::Stop);
    assert!(message(&app).contains("emergency stop"), "{}", message(&app));
    assert!(app.model().stop_pending);
    app.absorb(Event::Stopped);
    assert!(!app.model().stop_pending);
}

#[test]
fn commands_and_events_survive_being_written_down() {
    let commands = [Command::Stop, Command::PointAt(None), Command::SetTheme(ThemeChoice::Light)];
    for command in commands {
        let text = serde_json::to_string(&command).expect("it can be written");
        assert_eq!(serde_json::from_str::<Command>(&text).expect("it can be read"), command);
    }
    let state = LinkState::Lost { since_s: 1.5, why: "gone".to_owned(), attempt: 2 };
    let text = serde_json::to_string(&Event::Link { link: Link::Control, state: state.clone() }).expect("written");
    let Event::Link { state: read, .. } = serde_json::from_str(&text).expect("read") else { panic!("another event") };
    assert_eq!(read, state);
}

#[test]
fn a_resting_simulation_is_only_known_while_connected() {
    let mut model = Model::new(CellSource::BuiltIn, ViewSettings::default());
    model.robot = Some(crate::model::RobotState {
        base_from_tip: handeye_core::frames::Pose::identity(),
        joints_rad: [0.0; 6],
        sim_time_s: 0.0,
        simulation: Simulation::Stopped,
    });
    assert_eq!(model.resting_simulation(), None);
    model.control = LinkState::Connected { address: String::new(), server: String::new() };
    assert_eq!(model.resting_simulation(), Some(Simulation::Stopped));
}
