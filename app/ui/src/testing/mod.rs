//! The window for tests, driven by the labels of its controls.

use std::sync::Arc;
use std::time::{Duration, Instant};

use egui::{Vec2, vec2};
use egui_kittest::kittest::Queryable as _;
use egui_kittest::{Harness, HarnessBuilder};
use handeye_coppeliasim::cell::CellPaths;
use handeye_geometry::depth::DepthImage;
use handeye_geometry::frames::Pose;
use image::{Rgb, RgbImage};

use super::shell::layout::Layout;
use super::window::Window;
use handeye_workbench::app::{App, Connect, Start};
use handeye_workbench::command::{Command, Event};
use handeye_workbench::model::{
    CellSource, ColouredDepth, FrameImages, FrameInfo, Link, LinkState, Model, Pane, RobotState, Simulation,
    ViewSettings,
};
use handeye_workbench::settings::SettingsFile;
use handeye_workbench::text::Text;
use handeye_workbench::worker::fake::FakeCell;
use handeye_workbench::worker::{Cell, Clock, PortError, Waker};
use handeye_workbench::{connect, live, shell};

/// The window over workers that report nothing: only the tests report.
pub struct Silent {
    /// The window, driven by labels.
    pub harness: Harness<'static, Window>,
    woken: crossbeam_channel::Receiver<()>,
    _release: crossbeam_channel::Sender<()>,
    _sessions: tempfile::TempDir,
}

/// Size of the window \[points\].
pub const SIZE: Vec2 = vec2(1440.0, 900.0);

impl Silent {
    /// With a cell that is not connected yet.
    pub(crate) fn new(source: CellSource) -> Self {
        Self::of_size(source, SIZE)
    }

    /// The same in another size.
    pub(crate) fn of_size(source: CellSource, size: Vec2) -> Self {
        Self::built(source, Harness::builder().with_size(size))
    }

    /// The same in a harness with another set-up, such as for images.
    pub(crate) fn built(source: CellSource, builder: HarnessBuilder<Window>) -> Self {
        let (cell, release) = FakeCell::that_never_answers();
        // The workers fail once and then wait for the user, so that nothing comes from them.
        cell.script().refusals = vec![PortError::Hopeless(Text::verbatim("not in this test")); 2];
        let connect: Connect = Arc::new(move |_source, _objects| Arc::new(cell.clone()) as Arc<dyn Cell>);
        let clock: Clock = Arc::new(|| 100.0);
        let (wake, woken) = crossbeam_channel::bounded(1);
        let waker: Waker = wakes(wake);
        let folder = tempfile::tempdir().expect("a folder");
        let start = Start {
            source,
            view: ViewSettings::default(),
            addresses: Vec::new(),
            drivers: Vec::new(),
            objects: CellPaths::default(),
            keep_out: None,
            sessions: folder.path().to_path_buf(),
            open: None,
            in_browser: None,
        };
        let mut app = App::start(start, connect, clock, waker).expect("threads");
        // The fake's connection for motions is never refused; it has nothing to report once connected.
        let settled = |app: &App| {
            let failed = |link| matches!(app.model().link(link), LinkState::Failed { .. });
            let prepared = !app.model().document().meta.created.is_empty();
            failed(Link::Control) && failed(Link::Camera) && app.model().mover.is_connected() && prepared
        };
        while !settled(&app) {
            woken.recv_timeout(std::time::Duration::from_secs(20)).expect("the workers report");
            app.collect();
        }
        let harness = builder.build_ui_state(
            |ui, window: &mut Window| {
                let ctx = ui.ctx().clone();
                window.collect(&ctx);
                window.window_ui(ui);
            },
            Window::new(app, Layout::default(), SettingsFile::default(), &egui::Context::default()),
        );
        let mut silent = Self { harness, woken, _release: release, _sessions: folder };
        silent.steps();
        silent
    }

    /// Draws until the change is visible.
    pub(crate) fn steps(&mut self) {
        self.harness.run_steps(3);
    }

    /// Waits until the work of the archive and the other threads is visible in the model.
    pub(crate) fn until(&mut self, what: &str, is_so: impl Fn(&Model) -> bool) {
        let deadline = Instant::now() + Duration::from_secs(30);
        loop {
            self.steps();
            if is_so(self.app().model()) {
                return;
            }
            let left = deadline.saturating_duration_since(Instant::now());
            assert!(!left.is_zero(), "waiting for {what}");
            // A report may have come between the check and the wait: the next check is soon in any case.
            let _woken = self.woken.recv_timeout(left.min(Duration::from_millis(50))).is_ok();
        }
    }

    /// The application.
    pub(crate) fn app(&mut self) -> &mut App {
        self.harness.state_mut().app()
    }

    /// Shows something else.
    pub(crate) fn show_model(&mut self, model: Model) {
        self.app().replace_model(model);
        self.steps();
    }

    /// Lets something happen.
    pub(crate) fn absorb(&mut self, event: impl Into<Event>) {
        self.app().absorb(event);
        self.steps();
    }

    /// Both connections are in a state.
    pub(crate) fn links(&mut self, state: &LinkState) {
        for link in [Link::Control, Link::Camera] {
            self.absorb(connect::Event::Link { link, state: state.clone() });
        }
    }

    /// Whether a text is on the screen.
    pub(crate) fn sees(&self, part: &str) -> bool {
        self.harness.query_all_by_label_contains(part).count() > 0
    }

    /// Sends a command as a pane would.
    pub(crate) fn command(&mut self, command: impl Into<Command>) {
        self.harness.state_mut().apply(command);
        self.steps();
    }

    /// Brings a pane to the front.
    pub(crate) fn show(&mut self, pane: Pane) {
        self.command(shell::Command::ShowPane(pane));
    }

    /// Presses keys.
    pub(crate) fn press(&mut self, modifiers: egui::Modifiers, key: egui::Key) {
        self.harness.key_press_modifiers(modifiers, key);
        self.steps();
    }

    /// Clicks the widget with a label.
    pub(crate) fn click(&mut self, label: &str) {
        self.harness.get_by_label(label).scroll_to_me();
        self.steps();
        self.harness.get_by_label(label).click();
        self.steps();
    }

    /// Connected, with a robot and an image.
    pub(crate) fn live() -> Self {
        let mut silent = Self::new(CellSource::default());
        silent.links(&connected());
        silent.absorb(connect::Event::Robot(robot(Simulation::Running)));
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

/// A connection that works.
pub fn connected() -> LinkState {
    LinkState::Connected { address: "tcp://127.0.0.1:1".to_owned(), server: "built-in cell".to_owned() }
}

/// The robot at a pose whose numbers tests know.
pub fn robot(simulation: Simulation) -> RobotState {
    RobotState {
        base_from_tip: Pose::from_translation_xyzw([0.11, -0.016, 0.847], [0.0, 0.0, 0.0, 1.0]),
        joints_rad: [0.0, std::f64::consts::FRAC_PI_4, -1.0, 0.0, 0.0, 0.0].into(),
        sim_time_s: 12.35,
        simulation,
        is_armed: true,
    }
}

/// Column and row are in the colours, and the column is in the depth.
pub fn frame(number: u64) -> Event {
    let (width, height) = (64, 48);
    let rgb = RgbImage::from_fn(width, height, |column, row| Rgb([column as u8, row as u8, 200]));
    let mut metres: Vec<f32> = (0..width * height).map(|i| 0.5 + 0.01 * (i % width) as f32).collect();
    metres[0] = 3.5;
    let depth = ColouredDepth { metres: DepthImage { width, height, metres }, colours: rgb.clone() };
    let images = FrameImages { rgb, depth: Some(depth) };
    let info = FrameInfo {
        number,
        sim_time_s: 12.3,
        image_age_s: 0.0,
        image_off_m: 0.0,
        no_pose: None,
        received_s: 100.0,
        rate_hz: 20.0,
        depth_range_m: [0.4, 1.2],
        far_plane_m: 3.5,
        base_from_tip: Some(Pose::from_translation_xyzw([0.11, -0.016, 0.847], [0.0, 0.0, 0.0, 1.0])),
        joints_rad: [0.0; 6].into(),
        base_from_target_true: None,
        clocks: None,
    };
    Event::Live(live::Event::Frame { info, dropped: 7, images: Some(Arc::new(images)) })
}

#[cfg(test)]
pub mod driven;
#[cfg(test)]
pub(crate) mod pane_harness;
