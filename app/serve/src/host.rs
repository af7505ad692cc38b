//! The thread that owns the window: it takes in the input, draws, and sends the frames to the pages.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use crossbeam_channel::Receiver;
use egui::{Event, OutputCommand, Pos2, RawInput, Rect, Vec2, ViewportCommand, ViewportId};

use super::chunks;
use super::frame::{Frame, Typing, cursor_name};
use super::hub::{Hub, PageRequest, Words};
use super::input::{Held, Screen, lets_go};
use super::memory::Memory;
use super::reading;
use super::textures::Textures;
use handeye_ui::opening::Opening;
use handeye_ui::signals::Signals;
use handeye_ui::stop_button::stop_places;
use handeye_ui::style::theme;
use handeye_ui::{LEAST_SIZE, SIZE, Window, typed};
use handeye_workbench::app::InBrowser;
use handeye_workbench::motion::grip::{Grip, SILENCE, Times};
use handeye_workbench::session;
use handeye_workbench::text::Language;
use handeye_workbench::tr;

/// Minimum time between two frames: a screen shows no more.
const PERIOD: Duration = Duration::from_millis(16);

/// Interval of updates for screen readers: speech is not faster.
const TELL: Duration = Duration::from_millis(400);

/// Minimum time between two frames after input.
const PERIOD_OF_INPUT: Duration = Duration::from_millis(8);

/// Events are taken in at least this often, also when no page is open.
const COLLECT: Duration = Duration::from_millis(250);

/// A press and release within this time is a click \[s\]. A release may be delayed by a retransmission in the network.
const CLICK_S: f64 = 2.5;

/// Between two checks of what has to be remembered.
const REMEMBER: Duration = Duration::from_secs(10);

/// Widest texture that every browser supports.
const TEXTURE_SIDE: usize = 4096;

/// A window that is shown in pages.
pub struct Host {
    ctx: egui::Context,
    window: Window,
    hub: Arc<Hub>,
    wakes: Receiver<()>,
    signals: Arc<Signals>,
    memory: Memory,
    /// When the next frame is wanted.
    due: Arc<Mutex<Option<Instant>>>,
    began: Instant,
    drawn: Option<Instant>,
    collected: Instant,
    remembered: Instant,
    /// When screen readers were last updated.
    reported: Instant,
    screen: Option<Screen>,
    held: Held,
    /// Something is held at a page that was silent for too long.
    is_silent: bool,
    /// It was silent for too long since a frame was drawn.
    was_silent: bool,
    grip: Arc<Grip>,
    /// How often what is held was released, as of the input taken in.
    times: Times,
    /// How often STOP was pressed, as of the input taken in.
    stops: u64,
    must_draw: bool,
    events: Vec<Event>,
    textures: Textures,
    shown: Arc<Frame>,
    language: Option<Language>,
}

impl Host {
    /// Opens the window.
    ///
    /// # Errors
    /// As for the window of a desktop, except that no screen is needed.
    pub fn open(
        opening: Opening,
        shown: InBrowser,
        hub: Arc<Hub>,
        wakes: Receiver<()>,
        signals: Arc<Signals>,
    ) -> anyhow::Result<Self> {
        let ctx = egui::Context::default();
        let due = Arc::new(Mutex::new(Some(Instant::now())));
        ctx.options_mut(|options| options.input_options.max_click_duration = CLICK_S);
        let (asked, woken) = (Arc::clone(&due), Arc::clone(&hub));
        ctx.set_request_repaint_callback(move |info| {
            if sooner(&asked, info.delay) {
                woken.wake();
            }
        });
        let memory = Memory::open();
        let (remembered, layout) = memory.last();
        let mut window = opening.window(&ctx, remembered, layout, Some(shown))?;
        let app = window.app_mut();
        signals.lead_to(Arc::clone(app.stop_line()), Arc::clone(app.waker()));
        let grip = Arc::clone(app.stop_line().grip());
        let now = Instant::now();
        Ok(Self {
            ctx,
            window,
            hub,
            wakes,
            signals,
            memory,
            due,
            began: now,
            drawn: None,
            collected: now,
            remembered: now,
            reported: now,
            screen: None,
            held: Held::default(),
            is_silent: false,
            was_silent: false,
            grip,
            times: Times::default(),
            stops: 0,
            must_draw: false,
            events: Vec::new(),
            textures: Textures::default(),
            shown: Arc::default(),
            language: None,
        })
    }

    /// Draws until the program is requested to end.
    pub fn run(mut self) {
        loop {
            let wait = self.wait();
            let _woken = self.wakes.recv_timeout(wait).is_ok();
            if self.signals.is_asked() {
                break;
            }
            if self.take_in().is_break() {
                break;
            }
        }
        self.window.app_mut().begin_to_leave();
        let written = self.memory.keep(self.window.remembered()).map(|write| write.perform());
        if let Some(Err(warning)) = written {
            tracing::warn!("{}", warning.0.in_language(Language::English));
        }
    }

    /// How long nothing has to be done.
    fn wait(&self) -> Duration {
        let now = Instant::now();
        let mut until = self.collected + COLLECT;
        if self.must_draw || (self.wants_frame() && !self.events.is_empty()) {
            // It came right after a frame was drawn.
            until = until.min(self.earliest());
        } else if self.wants_frame()
            && let Some(due) = *self.due.lock().unwrap_or_else(PoisonError::into_inner)
        {
            until = until.min(due.max(self.earliest()));
        }
        if self.held.is_any() {
            until = until.min(now + SILENCE / 4);
        }
        until.saturating_duration_since(now)
    }

    /// When the next frame may be drawn.
    fn earliest(&self) -> Instant {
        let period = if self.events.is_empty() { PERIOD } else { PERIOD_OF_INPUT };
        self.drawn.map_or(self.began, |drawn| drawn + period)
    }

    /// Before a page has reported its size, there is nothing to draw for.
    fn wants_frame(&self) -> bool {
        self.screen.is_some() && (!self.events.is_empty() || self.hub.is_watched())
    }

    fn take_in(&mut self) -> std::ops::ControlFlow<()> {
        let news = self.hub.news();
        if let Some(screen) = news.screen {
            if self.screen.is_some_and(|before| before.touch) != screen.touch {
                theme::for_fingers(&self.ctx, screen.touch);
            }
            self.screen = Some(screen);
            sooner(&self.due, Duration::ZERO);
        }
        if news.changed_hands {
            self.events.clear();
            self.events.extend(self.held.release());
            sooner(&self.due, Duration::ZERO);
        }
        if news.stops > self.stops {
            self.stops = news.stops;
            self.window.app_mut().note_stops(news.stops);
        }
        // A silence that is over by now has released it all the same, and a frame has to show that.
        self.was_silent |= self.held.is_any() && news.times.silent > self.times.silent;
        self.times = news.times;
        let is_silent = self.held.is_any() && (self.was_silent || self.grip.is_silent(Instant::now()));
        if is_silent != self.is_silent {
            tracing::debug!(is_silent, "something is held at a page");
            self.is_silent = is_silent;
            self.events.extend(self.held.release_keys());
            self.must_draw = true;
        }
        let before = self.events.len();
        for done in news.done {
            done.add_to(&mut self.events);
        }
        self.held.heed(&self.events[before..]);
        for folder in news.opened {
            self.window.app_mut().apply(session::Command::Open(folder));
            sooner(&self.due, Duration::ZERO);
        }
        let now = Instant::now();
        let is_due = {
            let due = self.due.lock().unwrap_or_else(PoisonError::into_inner);
            due.is_some_and(|due| due <= now)
        };
        let is_wanted = self.must_draw || (self.wants_frame() && (is_due || !self.events.is_empty()));
        if is_wanted && now >= self.earliest() {
            return self.draw();
        }
        if now >= self.collected + COLLECT {
            self.collect();
        }
        std::ops::ControlFlow::Continue(())
    }

    fn collect(&mut self) {
        self.window.collect(&self.ctx);
        self.collected = Instant::now();
        let language = self.window.app_mut().model().view.language;
        if self.language != Some(language) {
            self.language = Some(language);
            self.hub.say(words(language));
        }
        if self.remembered.elapsed() > REMEMBER {
            self.remembered = Instant::now();
            if let Some(write) = self.memory.keep(self.window.remembered()) {
                self.window.app_mut().write_settings(write);
            }
        }
    }

    fn draw(&mut self) -> std::ops::ControlFlow<()> {
        self.collect();
        self.drawn = Some(Instant::now());
        self.must_draw = false;
        *self.due.lock().unwrap_or_else(PoisonError::into_inner) = None;
        let input = self.input();
        if !self.events.is_empty() {
            sooner(&self.due, Duration::ZERO);
        }
        if !self.events.iter().any(lets_go) {
            self.grip.know(self.times);
        }
        self.was_silent = false;
        let window = &mut self.window;
        let is_read = self.hub.is_read_at_all();
        if is_read {
            self.ctx.enable_accesskit();
        } else {
            self.ctx.disable_accesskit();
        }
        let mut output = self.ctx.run_ui(input, |ui| window.window_ui(ui));
        self.hub.stops_at(stop_places(&self.ctx));
        self.textures.change(&mut output.textures_delta);
        let platform = output.platform_output;
        if is_read && let Some(update) = &platform.accesskit_update {
            let next = self.reported + TELL;
            if Instant::now() >= next {
                self.reported = Instant::now();
                self.hub.send_controls(reading::controls(update));
            } else {
                sooner(&self.due, next.saturating_duration_since(Instant::now()));
            }
        }
        for command in platform.commands {
            match command {
                OutputCommand::CopyText(text) => self.hub.send(PageRequest::Copy { text }),
                OutputCommand::OpenUrl(open) => self.hub.send(PageRequest::Visit { url: open.url }),
                OutputCommand::CopyImage(_) => tracing::debug!("images are not copied into browsers"),
            }
        }
        let mut ends = false;
        if let Some(viewport) = output.viewport_output.get(&ViewportId::ROOT) {
            ends = viewport.commands.contains(&ViewportCommand::Close);
            sooner(&self.due, viewport.repaint_delay);
        }
        let frame = Frame {
            size: self.size().0.into(),
            pixels_per_point: output.pixels_per_point,
            chunks: chunks::of(&self.ctx, output.shapes, output.pixels_per_point),
            textures: self.textures.clone(),
            cursor: cursor_name(platform.cursor_icon),
            typing: platform.ime.map(|ime| {
                let Rect { min, .. } = ime.cursor_rect;
                Typing { cursor: [min.x, min.y, ime.cursor_rect.width(), ime.cursor_rect.height()] }
            }),
        };
        if !frame.is_same(&self.shown) {
            self.shown = Arc::new(frame);
            self.hub.show(Arc::clone(&self.shown));
        }
        if ends { std::ops::ControlFlow::Break(()) } else { std::ops::ControlFlow::Continue(()) }
    }

    /// Size of the window \[points\], and pixels per point. On a page that is too small for the panes, everything is
    /// drawn smaller.
    fn size(&self) -> (Vec2, f32) {
        let usual = Screen { width: SIZE[0], height: SIZE[1], scale: 1.0, touch: false };
        let Screen { width, height, scale, .. } = self.screen.unwrap_or(usual);
        let shrink = (width / LEAST_SIZE[0]).min(height / LEAST_SIZE[1]).min(1.0);
        (Vec2::new(width, height) / shrink, scale * shrink)
    }

    fn input(&mut self) -> RawInput {
        let (size, scale) = self.size();
        let mut input = RawInput {
            screen_rect: Some(Rect::from_min_size(Pos2::ZERO, size)),
            max_texture_side: Some(TEXTURE_SIDE),
            time: Some(self.began.elapsed().as_secs_f64()),
            events: up_to_a_press(&mut self.events),
            // As for a window that has lost the focus: what is held moves nothing, and a late click still counts.
            focused: !self.is_silent,
            ..RawInput::default()
        };
        typed::bound(&mut input);
        if let Some(viewport) = input.viewports.get_mut(&ViewportId::ROOT) {
            viewport.native_pixels_per_point = Some(scale);
            viewport.inner_rect = input.screen_rect;
        }
        input
    }
}

/// Requests a frame after a delay; returns whether that is sooner than one was wanted before.
fn sooner(due: &Mutex<Option<Instant>>, delay: Duration) -> bool {
    let mut due = due.lock().unwrap_or_else(PoisonError::into_inner);
    let Some(wanted) = Instant::now().checked_add(delay) else { return false };
    let is_sooner = due.is_none_or(|due| wanted < due);
    if is_sooner {
        *due = Some(wanted);
    }
    is_sooner
}

/// Takes the events up to the first press. What was pressed has to be drawn once before it is released: a touch that has
/// ended by the end of a frame has no effect in it.
fn up_to_a_press(events: &mut Vec<Event>) -> Vec<Event> {
    let press = events.iter().position(|event| matches!(event, Event::PointerButton { pressed: true, .. }));
    let rest = press.map_or(events.len(), |press| press + 1);
    events.drain(..rest).collect()
}

fn words(language: Language) -> Words {
    let say = |english: &'static str| english.to_owned();
    Words {
        language: match language {
            Language::English => "en",
            Language::Chinese => "zh-CN",
        },
        watching: say(tr!(language, "You are watching: somebody else drives")),
        nobody: say(tr!(language, "Nobody drives")),
        drive: say(tr!(language, "Drive")),
        stop: say(tr!(language, "STOP")),
        lost: say(tr!(
            language,
            "The connection to the workbench is lost. What is shown is of {time}, and STOP does not act from here: use the emergency \
             stop of the robot"
        )),
        uploading: say(tr!(language, "Uploading…")),
        not_uploaded: say(tr!(language, "The files could not be uploaded")),
        reads: say(tr!(language, "Controls for a screen reader")),
    }
}
