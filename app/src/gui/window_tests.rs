use std::sync::Arc;

use egui::{Vec2, vec2};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable as _;
use handeye_core::depth::DepthImage;
use handeye_core::frames::Pose;
use handeye_core::image::{Rgb, RgbImage};

use super::*;
use crate::command::{Command, Event};
use crate::model::{
    CellSource, FrameImages, FrameInfo, ImagePoint, Link, LinkState, RobotState, RotationFormat, Simulation,
};
use crate::worker::fake::FakeCell;
use crate::worker::{Clock, Connector, PortError, Waker};

/// The window over workers that have nothing to say: the tests are the only ones that report.
struct Silent {
    harness: Harness<'static, Window>,
    _release: crossbeam_channel::Sender<()>,
}

const SIZE: Vec2 = vec2(1440.0, 900.0);

impl Silent {
    fn new(source: CellSource) -> Self {
        Self::of_size(source, SIZE)
    }

    fn of_size(source: CellSource, size: Vec2) -> Self {
        let (cell, release) = FakeCell::that_never_answers();
        // The workers fail once and then wait for the user, so that nothing comes from them.
        cell.script().refusals = vec![PortError::Hopeless("not in this test".to_owned()); 2];
        let connector: Arc<dyn Connector> = Arc::new(cell);
        let clock: Clock = Arc::new(|| 100.0);
        let (wake, woken) = crossbeam_channel::bounded(1);
        let waker: Waker = wakes(wake);
        let mut app = App::start(source, ViewSettings::default(), &connector, clock, &waker).expect("threads");
        while ![Link::Control, Link::Camera]
            .iter()
            .all(|&link| matches!(app.model().link(link), LinkState::Failed { .. }))
        {
            woken.recv_timeout(std::time::Duration::from_secs(20)).expect("the workers report");
            app.collect();
        }
        let harness = Harness::builder().with_size(size).build_ui_state(
            |ui, window: &mut Window| {
                let ctx = ui.ctx().clone();
                window.collect(&ctx);
                window.window_ui(ui);
            },
            Window::new(app, &egui::Context::default()),
        );
        let mut silent = Self { harness, _release: release };
        theme::install(&silent.harness.ctx);
        silent.steps();
        silent
    }

    fn steps(&mut self) {
        self.harness.run_steps(3);
    }

    fn app(&mut self) -> &mut App {
        self.harness.state_mut().app()
    }

    fn absorb(&mut self, event: Event) {
        self.app().absorb(event);
        self.steps();
    }

    fn links(&mut self, state: &LinkState) {
        for link in [Link::Control, Link::Camera] {
            self.absorb(Event::Link { link, state: state.clone() });
        }
    }

    fn sees(&self, part: &str) -> bool {
        self.harness.query_all_by_label_contains(part).count() > 0
    }

    fn live() -> Self {
        let mut silent = Self::new(CellSource::BuiltIn);
        silent.links(&connected());
        silent.absorb(Event::Robot(robot(Simulation::Running)));
        silent.absorb(frame(1));
        silent
    }
}

fn wakes(wake: crossbeam_channel::Sender<()>) -> Waker {
    // A full channel wakes as well as a fuller one.
    Arc::new(move || {
        let _full = wake.try_send(()).is_err();
    })
}

fn connected() -> LinkState {
    LinkState::Connected { address: "tcp://127.0.0.1:1".to_owned(), server: "built-in cell".to_owned() }
}

fn robot(simulation: Simulation) -> RobotState {
    RobotState {
        base_from_tip: Pose::from_translation_xyzw([0.11, -0.016, 0.847], [0.0, 0.0, 0.0, 1.0]),
        joints_rad: [0.0, std::f64::consts::FRAC_PI_4, -1.0, 0.0, 0.0, 0.0],
        sim_time_s: 12.35,
        simulation,
    }
}

/// Column and row are in the colours, and the column is in the depth.
fn frame(number: u64) -> Event {
    let (width, height) = (64, 48);
    let rgb = RgbImage::from_fn(width, height, |column, row| Rgb([column as u8, row as u8, 200]));
    let mut metres: Vec<f32> = (0..width * height).map(|i| 0.5 + 0.01 * (i % width) as f32).collect();
    metres[0] = 3.5;
    let images = FrameImages { depth_coloured: rgb.clone(), depth: DepthImage { width, height, metres }, rgb };
    let info = FrameInfo {
        number,
        sim_time_s: 12.3,
        received_s: 100.0,
        rate_hz: 20.0,
        depth_range_m: [0.4, 1.2],
        far_plane_m: 3.5,
        base_from_tip: Pose::from_translation_xyzw([0.11, -0.016, 0.847], [0.0, 0.0, 0.0, 1.0]),
        joints_rad: [0.0; 6],
    };
    Event::Frame { info, dropped: 7, images: Some(Arc::new(images)) }
}

#[test]
fn every_state_of_the_connection_says_what_goes_on() {
    let mut built_in = Silent::new(CellSource::BuiltIn);
    built_in.links(&LinkState::StartingCell { why: None });
    assert!(built_in.sees("Starting the built-in cell…"));
    built_in.links(&LinkState::Failed { why: "no scene".to_owned() });
    assert!(built_in.sees("The built-in cell did not start"));
    assert!(built_in.sees("No scene."));
    built_in.links(&connected());
    assert!(built_in.sees("Connected to the built-in cell"));
    assert!(built_in.sees("Waiting for the first picture…"));

    let mut remote = Silent::new(CellSource::Address("tcp://sim:23000".to_owned()));
    let why = Some("nothing answers".to_owned());
    remote.links(&LinkState::Searching { address: "tcp://sim:23000".to_owned(), attempt: 3, why });
    assert!(remote.sees("Searching for tcp://sim:23000…"));
    assert!(remote.sees("Try 3. Nothing answers."));
}

#[test]
fn a_lost_connection_says_since_when_and_why_and_keeps_the_last_picture() {
    let mut silent = Silent::live();
    let why = "the cable is out".to_owned();
    let lost = LinkState::Lost { since_s: 88.0, why: why.clone(), attempt: 0 };
    silent.absorb(Event::Link { link: Link::Camera, state: lost });
    assert!(silent.sees("Camera connection lost 12 s ago"));
    assert!(silent.sees("The cable is out."));
    assert!(silent.harness.query_by_label("Colour picture").is_some());
    let retrying = LinkState::Retrying { since_s: 88.0, why: why.clone(), attempt: 2 };
    silent.absorb(Event::Link { link: Link::Camera, state: retrying });
    assert!(silent.sees("retrying"));
    let later = LinkState::Lost { since_s: 95.0, why, attempt: 0 };
    silent.absorb(Event::Link { link: Link::Control, state: later });
    assert!(silent.sees("Connection lost 12 s ago"), "the first loss counts");
}

#[test]
fn the_pixel_under_the_pointer_is_read_from_both_pictures() {
    for name in ["Colour picture", "Depth picture"] {
        let mut silent = Silent::live();
        assert!(silent.sees("Point at a picture"));
        // In the middle of pixel (20, 30): a swap of the axes or an offset of half a pixel shows.
        let picture = silent.harness.get_by_label(name).rect();
        let part = vec2(20.5 / 64.0, 30.5 / 48.0);
        silent.harness.hover_at(picture.min + part * picture.size());
        silent.steps();
        let point = silent.app().model().cursor.expect("a pixel is pointed at");
        assert_eq!(point, ImagePoint { column: 20, row: 30 });
        let (column, row) = (point.column, point.row);
        assert!(silent.sees(&format!("Pixel {column}, {row}")));
        assert!(silent.sees(&format!("RGB {column} {row} 200")));
        assert!(silent.sees(&format!("Depth {:.3} m", 0.5 + 0.01 * column as f32)));
        silent.harness.hover_at(egui::pos2(5.0, 5.0));
        silent.steps();
        assert_eq!(silent.app().model().cursor, None);
    }
}

#[test]
fn a_pixel_without_surface_has_no_made_up_depth() {
    let mut silent = Silent::live();
    silent.app().apply(Command::PointAt(Some(ImagePoint { column: 0, row: 0 })));
    // Before the next frame of the window takes the pointer away again.
    silent.harness.step();
    assert!(silent.sees("Depth over 3.50 m"));
}

#[test]
fn the_robot_is_shown_in_millimetres_and_degrees() {
    let mut silent = Silent::live();
    assert!(silent.sees("Tip in base, x y z [mm]: 110.0 −16.0 847.0"));
    assert!(silent.sees("Tip in base, roll pitch yaw [deg]: 0.00 0.00 0.00"));
    assert!(silent.sees("Joints 1 to 6 [deg]: 0.0 45.0 −57.3 0.0 0.0 0.0"));
    assert!(silent.sees("Simulation: 12.35 s"));
    assert!(silent.sees("Dropped: 7"));
    silent.harness.get_by_label("quat").click();
    silent.steps();
    assert_eq!(silent.app().model().view.rotation, RotationFormat::Quaternion);
    assert!(silent.sees("Tip in base, quaternion x y z w: 0.0000 0.0000 0.0000 1.0000"));
}

#[test]
fn stop_is_one_click_away_in_every_state() {
    let mut silent = Silent::new(CellSource::BuiltIn);
    for prepare in [LinkState::StartingCell { why: None }, connected()] {
        silent.links(&prepare);
        silent.harness.get_by_label("STOP").click();
        silent.steps();
        assert!(silent.app().model().stop_pending);
        assert!(silent.sees("STOPPING…"));
        silent.absorb(Event::Stopped);
    }
}

#[test]
fn the_theme_is_switched_and_remembered() {
    let mut silent = Silent::live();
    assert!(silent.harness.ctx.global_style().visuals.dark_mode);
    silent.harness.get_by_label("Light theme").click();
    silent.steps();
    assert!(!silent.harness.ctx.global_style().visuals.dark_mode);
    assert_eq!(silent.app().model().view.theme, ThemeChoice::Light);
    assert!(silent.harness.query_by_label("Dark theme").is_some());
}

#[test]
fn a_simulation_that_rests_can_be_started() {
    let mut silent = Silent::live();
    silent.absorb(Event::Robot(robot(Simulation::Stopped)));
    assert!(silent.sees("The simulation is stopped"));
    assert!(silent.harness.query_by_label("Start simulation").is_some());
    silent.absorb(Event::Robot(robot(Simulation::Running)));
    assert!(!silent.sees("The simulation is stopped"));
}

#[test]
fn a_picture_is_uploaded_once_however_often_the_window_is_drawn() {
    let mut silent = Silent::live();
    silent.harness.run_steps(10);
    assert_eq!(silent.harness.state().uploads(), 1);
    silent.absorb(frame(2));
    assert_eq!(silent.harness.state().uploads(), 2);
}

#[test]
fn pictures_that_no_longer_come_are_not_counted_as_a_frame_rate() {
    let mut silent = Silent::live();
    assert!(silent.sees("20 fps"));
    let Event::Frame { mut info, dropped, images } = frame(2) else { unreachable!() };
    info.received_s = 95.0;
    silent.absorb(Event::Frame { info, dropped, images });
    assert!(silent.sees("no new pictures"));
    assert!(silent.sees("Image age: 5.0 s"));
}

#[test]
fn nothing_is_cut_off_at_the_smallest_size() {
    let size = vec2(1024.0, 700.0);
    let mut silent = Silent::of_size(CellSource::BuiltIn, size);
    silent.links(&connected());
    silent.absorb(Event::Robot(robot(Simulation::Running)));
    silent.absorb(frame(1));
    silent.app().apply(Command::SetRotationFormat(RotationFormat::Quaternion));
    silent.steps();
    for label in ["STOP", "Light theme", "Dropped: 7", "Full range", "Colour picture", "Depth picture"] {
        let rect = silent.harness.get_by_label(label).rect();
        assert!(rect.min.x >= 0.0 && rect.max.x <= size.x && rect.max.y <= size.y, "{label}: {rect:?}");
    }
}
