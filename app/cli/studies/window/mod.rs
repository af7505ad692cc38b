//! The window drawn as on a screen of 60 Hz, without a graphics card: events, panes, tessellation, and the wall time of each
//! frame on the drawing thread, including processor time taken by other threads.

use std::path::PathBuf;
use std::sync::Arc;
use std::thread;
use std::time::{Duration, Instant};

use handeye_coppeliasim::cell::CellPaths;
use handeye_record::{RerunChoice, WebViewer, record};
use handeye_ui::{Layout, Window};
use handeye_workbench::app::{App, Connect, Start};
use handeye_workbench::model::{CellSource, ViewSettings};
use handeye_workbench::settings::SettingsFile;
use handeye_workbench::worker::{Clock, Waker};

/// Refresh of a usual screen.
const PERIOD: Duration = Duration::from_micros(16_667);

/// A window on a session of its own, which is deleted with it.
pub struct Drawn {
    window: Window,
    ctx: egui::Context,
    began: Instant,
    sessions: PathBuf,
    /// How long the frames took [ms].
    pub times_ms: Vec<f64>,
    /// How many shapes the last frame had.
    pub shapes: usize,
}

impl Drawn {
    /// Opens it. There is a session from the start, so that there is a file to record into.
    pub fn open(source: CellSource, rerun: RerunChoice) -> anyhow::Result<Self> {
        let sessions = std::env::temp_dir().join(format!("handeye-frames-{}", std::process::id()));
        let began = Instant::now();
        let clock: Clock = Arc::new(move || began.elapsed().as_secs_f64());
        let waker: Waker = Arc::new(|| {});
        let connect: Connect = Arc::new(CellSource::cell);
        let start = Start {
            source,
            view: ViewSettings::default(),
            addresses: Vec::new(),
            drivers: Vec::new(),
            objects: CellPaths::default(),
            keep_out: None,
            open: Some(sessions.join("session")),
            sessions: sessions.clone(),
            in_browser: None,
        };
        let mut app = App::start(start, connect, clock, waker)?;
        record(&mut app, rerun, WebViewer::Here)?;
        let ctx = egui::Context::default();
        let window = Window::new(app, Layout::default(), SettingsFile::default(), &ctx);
        Ok(Self { window, ctx, began, sessions, times_ms: Vec::new(), shapes: 0 })
    }

    /// The application behind it.
    pub fn app(&mut self) -> &mut App {
        self.window.app_mut()
    }

    /// How long it has been open.
    pub fn age(&self) -> Duration {
        self.began.elapsed()
    }

    /// Draws one frame, and waits until the next is due.
    pub fn draw(&mut self) {
        let frame = Instant::now();
        let input = egui::RawInput {
            screen_rect: Some(egui::Rect::from_min_size(egui::Pos2::ZERO, egui::vec2(1440.0, 900.0))),
            time: Some(self.began.elapsed().as_secs_f64()),
            ..egui::RawInput::default()
        };
        self.window.collect(&self.ctx);
        let window = &mut self.window;
        let mut output = self.ctx.run_ui(input, |ui| window.window_ui(ui));
        // There is no graphics card that needs them.
        output.textures_delta.clear();
        self.shapes = output.shapes.len();
        std::hint::black_box(self.ctx.tessellate(output.shapes, output.pixels_per_point).len());
        self.times_ms.push(frame.elapsed().as_secs_f64() * 1e3);
        thread::sleep(PERIOD.saturating_sub(frame.elapsed()));
    }

    /// Median, 99th percentile and worst of the frames [ms].
    pub fn summary(&self) -> String {
        let mut times_ms = self.times_ms.clone();
        times_ms.sort_by(f64::total_cmp);
        let last = times_ms.len().saturating_sub(1) as f64;
        let at = |part: f64| times_ms.get((last * part).round() as usize).copied().unwrap_or(0.0);
        format!("{:>8.2} {:>8.2} {:>8.2}", at(0.5), at(0.99), at(1.0))
    }
}

impl Drop for Drawn {
    fn drop(&mut self) {
        let _gone = std::fs::remove_dir_all(&self.sessions).is_ok();
    }
}
