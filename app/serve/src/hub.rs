//! Between the pages and the window: which pages there are, which one drives, the input, and what to show.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use crossbeam_channel::Receiver;
use handeye_workbench::worker::channels::Bell;
use serde::Serialize;
use tokio::sync::watch;

use super::frame::Frame;
use super::input::{Done, Screen};
use super::reading::Control;
use handeye_ui::stop_button::StopPlaces;
use handeye_workbench::motion::grip::{Grip, Times};
use handeye_workbench::worker::StopLine;

/// Pages at a time.
pub const MOST_PAGES: usize = 32;

/// Limit of pending input; a page that sends more than the window takes in is faulty.
const MOST_EVENTS: usize = 10_000;

/// Number of a page.
pub type PageId = u64;

/// Number of the first page.
const FIRST: PageId = 1;

/// The connection between the pages and the window.
pub struct Hub {
    state: Mutex<State>,
    bell: Bell,
    stop: Arc<StopLine>,
    frames: watch::Sender<(u64, Arc<Frame>)>,
    people: watch::Sender<People>,
    words: watch::Sender<Words>,
    controls: watch::Sender<Arc<[Control]>>,
}

/// The users.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct People {
    pub driver: Option<PageId>,
    /// How many pages there are.
    pub pages: usize,
}

/// Texts of the pages themselves, in the language of the window.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
pub struct Words {
    /// The language, as pages name it.
    pub language: &'static str,
    /// Another page drives.
    pub watching: String,
    /// No page drives.
    pub nobody: String,
    /// The button to drive.
    pub drive: String,
    /// The button that stops the arm.
    pub stop: String,
    /// The connection is gone; `{time}` is when the server last answered.
    pub lost: String,
    /// Files are being uploaded.
    pub uploading: String,
    /// The upload failed.
    pub not_uploaded: String,
    /// The button for users of a screen reader.
    pub reads: String,
}

/// What the window requests of the driving page, apart from drawing.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(tag = "t", rename_all = "snake_case")]
pub enum PageRequest {
    /// Text goes to the clipboard.
    Copy { text: String },
    /// An address is opened next to the page.
    Visit {
        /// The address.
        url: String,
    },
}

/// What happened since the window last asked.
#[derive(Debug, Default)]
pub struct News {
    /// The size of the driving page has changed.
    pub screen: Option<Screen>,
    /// The input there.
    pub done: Vec<Done>,
    /// Another page drives, or none: what was held is released.
    pub changed_hands: bool,
    /// Uploads to open.
    pub opened: Vec<PathBuf>,
    /// How often STOP was pressed so far. Input from before the last press is no longer included.
    pub stops: u64,
    /// How often what is held was released so far, including this input.
    pub times: Times,
}

struct State {
    next: PageId,
    pages: BTreeMap<PageId, Page>,
    driver: Option<PageId>,
    /// The name of the page that drove last, and is gone.
    drove: Option<String>,
    news: News,
    /// Where STOP is on the driving page.
    stop_places: StopPlaces,
}

struct Page {
    /// The name that it keeps when it is loaded again or its connection was lost.
    name: String,
    /// The screen of its user.
    screen: Option<Screen>,
    visible: bool,
    /// A screen reader reads it.
    reads: bool,
    /// Whether it has the latest frame and can take another.
    ready: bool,
    requests: tokio::sync::mpsc::Sender<PageRequest>,
}

/// Limit of requests that wait for a page.
const MOST_PAGE_REQUESTS: usize = 16;

impl Hub {
    /// No pages; wake-ups of the window arrive at the second.
    pub fn new(stop: Arc<StopLine>) -> (Self, Receiver<()>) {
        let (bell, rung) = Bell::new();
        let (pages, news, stop_places) = (BTreeMap::new(), News::default(), StopPlaces::default());
        let state = State { next: FIRST, pages, driver: None, drove: None, news, stop_places };
        let hub = Self {
            state: Mutex::new(state),
            bell,
            stop,
            frames: watch::Sender::default(),
            people: watch::Sender::default(),
            words: watch::Sender::default(),
            controls: watch::Sender::new(Arc::default()),
        };
        (hub, rung)
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Wakes the window.
    pub fn wake(&self) {
        self.bell.ring();
    }

    fn tell_people(&self, state: &State) {
        let people = People { driver: state.driver, pages: state.pages.len() };
        self.people.send_if_modified(|before| std::mem::replace(before, people) != people);
    }

    /// A page has connected. It drives if it is the first one, that of the user who has started the program, or if it
    /// did before its connection was lost and no other has since. Others drive when their user requests it.
    pub fn join(&self, name: &str) -> Option<(PageId, tokio::sync::mpsc::Receiver<PageRequest>)> {
        let mut state = self.state();
        // The same page once more: its old connection is no longer needed.
        let before = state.pages.iter().find(|(_, page)| page.name == name).map(|(id, _)| *id);
        if before.is_none() && state.pages.len() >= MOST_PAGES {
            return None;
        }
        let drove = before.is_some_and(|before| {
            state.pages.remove(&before);
            state.driver == Some(before)
        });
        let id = state.next;
        state.next += 1;
        let (page_requests, page_requests_here) = tokio::sync::mpsc::channel(MOST_PAGE_REQUESTS);
        state.pages.insert(
            id,
            Page {
                name: name.to_owned(),
                screen: None,
                visible: true,
                reads: false,
                ready: true,
                requests: page_requests,
            },
        );
        let comes_back = state.driver.is_none() && state.drove.as_deref() == Some(name);
        if drove || comes_back || id == FIRST {
            state.take_over(id, self.stop.grip());
        }
        self.tell_people(&state);
        drop(state);
        self.wake();
        Some((id, page_requests_here))
    }

    /// A page has disconnected.
    pub fn leave(&self, id: PageId) {
        let mut state = self.state();
        let name = state.pages.remove(&id).map(|page| page.name);
        if state.driver == Some(id) {
            state.driver = None;
            state.drove = name;
            state.let_go_all(self.stop.grip());
        }
        self.tell_people(&state);
        drop(state);
        self.wake();
    }

    /// Whether a page is still connected: another connection may have replaced it.
    pub fn has(&self, id: PageId) -> bool {
        self.state().pages.contains_key(&id)
    }

    /// The user wants to drive.
    pub fn drive(&self, id: PageId) {
        let mut state = self.state();
        if state.pages.contains_key(&id) && state.driver != Some(id) {
            state.take_over(id, self.stop.grip());
            self.tell_people(&state);
        }
        drop(state);
        self.wake();
    }

    /// Stops the arm, whichever page requests it. The window is notified when it has time.
    pub fn stop(&self) {
        let number = self.stop.press_outside();
        self.state().stopped(number, self.stop.grip());
        self.wake();
    }

    /// Where STOP is on the driving page.
    pub fn stops_at(&self, places: StopPlaces) {
        self.state().stop_places = places;
    }

    /// The driving page has reported.
    pub fn held(&self, id: PageId) {
        if self.state().driver == Some(id) {
            self.stop.grip().hear(Instant::now());
        }
    }

    /// Nothing is held at a page any more.
    pub fn let_go(&self, id: PageId) {
        let mut state = self.state();
        if state.driver == Some(id) {
            state.let_go_all(self.stop.grip());
            drop(state);
            self.wake();
        }
    }

    /// The user's input. It only counts on the driving page.
    ///
    /// # Errors
    /// When more arrives than is taken in.
    pub fn done(&self, id: PageId, done: Vec<Done>) -> Result<(), TooMuch> {
        let mut state = self.state();
        if state.driver == Some(id) {
            self.stop.grip().hear(Instant::now());
            if state.news.done.len() + done.len() > MOST_EVENTS {
                return Err(TooMuch);
            }
            for done in done {
                if done.stops(&state.stop_places) {
                    let number = self.stop.press_outside();
                    state.stopped(number, self.stop.grip());
                }
                if done.lets_go() {
                    self.stop.grip().let_go();
                }
                state.news.done.push(done);
            }
            drop(state);
            self.wake();
        }
        Ok(())
    }

    /// The size of a page.
    pub fn screen(&self, id: PageId, screen: Screen) {
        let mut state = self.state();
        let is_driver = state.driver == Some(id);
        let Some(page) = state.pages.get_mut(&id) else { return };
        page.screen = Some(screen);
        if is_driver {
            state.news.screen = Some(screen);
            drop(state);
            self.wake();
        }
    }

    /// Whether a page is visible, and whether it can take another frame.
    pub fn sees(&self, id: PageId, visible: Option<bool>, ready: Option<bool>) {
        let mut state = self.state();
        let Some(page) = state.pages.get_mut(&id) else { return };
        let waited = page.visible && page.ready;
        page.visible = visible.unwrap_or(page.visible);
        page.ready = ready.unwrap_or(page.ready);
        let waits = page.visible && page.ready;
        drop(state);
        if waits && !waited {
            self.wake();
        }
    }

    /// A screen reader reads a page, or no more.
    pub fn reads(&self, id: PageId, reads: bool) {
        let mut state = self.state();
        let Some(page) = state.pages.get_mut(&id) else { return };
        page.reads = reads;
        drop(state);
        // The controls, for a page that has just started reading.
        self.controls.send_modify(|_controls| {});
        self.wake();
    }

    /// Whether a screen reader reads a page.
    pub fn is_read(&self, id: PageId) -> bool {
        self.state().pages.get(&id).is_some_and(|page| page.reads)
    }

    /// Whether a screen reader reads any page.
    pub fn is_read_at_all(&self) -> bool {
        self.state().pages.values().any(|page| page.reads)
    }

    /// Updates the controls for screen readers.
    pub fn send_controls(&self, controls: Vec<Control>) {
        self.controls.send_if_modified(|before| {
            let is_new = **before != *controls;
            if is_new {
                *before = controls.into();
            }
            is_new
        });
    }

    /// The controls, for screen readers.
    pub fn controls(&self) -> watch::Receiver<Arc<[Control]>> {
        self.controls.subscribe()
    }

    /// An upload to open; only from the driving page.
    pub fn open(&self, id: PageId, folder: PathBuf) {
        let mut state = self.state();
        if state.driver == Some(id) {
            state.news.opened.push(folder);
            drop(state);
            self.wake();
        }
    }

    /// Whether a page waits for a frame.
    pub fn is_watched(&self) -> bool {
        self.state().pages.values().any(|page| page.visible && page.ready)
    }

    /// What happened since the last time.
    pub fn news(&self) -> News {
        let mut state = self.state();
        let next = News { stops: state.news.stops, ..News::default() };
        let news = std::mem::replace(&mut state.news, next);
        News { times: self.stop.grip().times(Instant::now()), ..news }
    }

    /// Sends a frame to all pages.
    pub fn show(&self, frame: Arc<Frame>) {
        self.frames.send_modify(|(number, shown)| {
            *number += 1;
            *shown = frame;
        });
    }

    /// A request for the driving page.
    pub fn send(&self, request: PageRequest) {
        let state = self.state();
        let driver = state.driver.and_then(|id| state.pages.get(&id));
        if driver.is_some_and(|page| page.requests.try_send(request).is_err()) {
            tracing::debug!("a page takes no requests");
        }
    }

    /// Sets the texts of the pages themselves.
    pub fn say(&self, words: Words) {
        self.words.send_if_modified(|before| {
            let is_new = *before != words;
            *before = words;
            is_new
        });
    }

    /// The frames, by number.
    pub fn frames(&self) -> watch::Receiver<(u64, Arc<Frame>)> {
        self.frames.subscribe()
    }

    /// The users.
    pub fn people(&self) -> watch::Receiver<People> {
        self.people.subscribe()
    }

    /// The texts of the pages themselves.
    pub fn words(&self) -> watch::Receiver<Words> {
        self.words.subscribe()
    }
}

impl State {
    fn take_over(&mut self, id: PageId, grip: &Grip) {
        self.driver = Some(id);
        self.let_go_all(grip);
        grip.hear(Instant::now());
        self.news.screen = self.pages.get(&id).and_then(|page| page.screen);
    }

    /// Nothing is held any more, and earlier input is dropped.
    fn let_go_all(&mut self, grip: &Grip) {
        grip.let_go();
        self.news.done.clear();
        self.news.changed_hands = true;
    }

    /// STOP was pressed, this many times by now: what was requested before it does not begin after it.
    fn stopped(&mut self, number: u64, grip: &Grip) {
        self.let_go_all(grip);
        self.news.stops = self.news.stops.max(number);
    }
}

/// A page sends more than the window takes in.
#[derive(Debug, PartialEq, Eq, thiserror::Error)]
#[error("more comes from a page than can be done")]
pub struct TooMuch;

#[cfg(test)]
mod tests {
    use super::*;

    fn hub() -> Hub {
        Hub::new(Arc::default()).0
    }

    fn join(hub: &Hub, name: &str) -> PageId {
        hub.join(name).expect("there is room").0
    }

    fn driver(hub: &Hub) -> Option<PageId> {
        hub.people().borrow().driver
    }

    #[test]
    fn the_first_page_drives_others_watch_and_one_click_takes_over() {
        let hub = hub();
        let (first, second) = (join(&hub, "a"), join(&hub, "b"));
        assert_eq!(driver(&hub), Some(first));
        hub.done(second, vec![Done::Leave]).expect("ignored");
        assert!(hub.news().done.is_empty(), "who watches does nothing");
        hub.drive(second);
        assert_eq!(driver(&hub), Some(second));
        let news = hub.news();
        assert!(news.changed_hands && news.done.is_empty());
        hub.done(second, vec![Done::Leave]).expect("room");
        assert_eq!(hub.news().done, [Done::Leave]);
    }

    #[test]
    fn everybody_stops_the_arm_also_who_only_watches() {
        let hub = hub();
        let (_first, _second) = (join(&hub, "a"), join(&hub, "b"));
        assert!(!hub.stop.is_pressed());
        hub.stop();
        assert!(hub.stop.is_pressed(), "and waits for no window");
        assert_eq!((hub.news().stops, hub.news().stops), (1, 1));
    }

    #[test]
    fn what_was_done_before_a_stop_is_not_done_after_it() {
        let hub = hub();
        let page = join(&hub, "a");
        hub.news();
        hub.done(page, vec![Done::Copy]).expect("room");
        hub.stop();
        hub.done(page, vec![Done::Leave]).expect("room");
        let news = hub.news();
        assert_eq!((news.done, news.changed_hands, news.stops), (vec![Done::Leave], true, 1));
        // STOP on the page itself is recognised where it is drawn, and what comes before it in the same message does not count.
        let rects = vec![egui::Rect::from_min_size(egui::Pos2::ZERO, egui::Vec2::splat(10.0))];
        hub.stops_at(StopPlaces { rects, ..StopPlaces::default() });
        let press = Done::Button { at: [5.0, 5.0], button: 0, down: true, modifiers: 0 };
        hub.done(page, vec![Done::Copy, press.clone()]).expect("room");
        let news = hub.news();
        assert_eq!((news.done, news.stops), (vec![press], 2));
    }

    #[test]
    fn a_page_that_comes_back_drives_again_and_its_old_connection_does_not_count() {
        let hub = hub();
        let (first, second) = (join(&hub, "a"), join(&hub, "b"));
        let again = join(&hub, "a");
        assert_eq!(driver(&hub), Some(again));
        assert!(!hub.has(first) && hub.has(second));
        hub.leave(first);
        assert_eq!(driver(&hub), Some(again));
        // No page starts to drive automatically when the driver leaves: the user has to choose to move an arm.
        hub.leave(again);
        assert_eq!(driver(&hub), None);
        assert!(hub.news().changed_hands);
    }

    #[test]
    fn a_page_that_joins_while_nobody_drives_watches_until_its_person_asks() {
        let hub = hub();
        let first = join(&hub, "a");
        hub.leave(first);
        let other = join(&hub, "b");
        assert_eq!(driver(&hub), None);
        hub.done(other, vec![Done::Leave]).expect("ignored");
        assert!(hub.news().done.is_empty());
        // The page whose connection was gone for a while, with no other driver since.
        let again = join(&hub, "a");
        assert_eq!(driver(&hub), Some(again));
        hub.leave(again);
        hub.drive(other);
        assert_eq!(driver(&hub), Some(other));
        hub.leave(other);
        join(&hub, "a");
        assert_eq!(driver(&hub), None, "somebody else has driven since");
    }

    #[test]
    fn pages_and_events_are_bounded() {
        let hub = hub();
        for page in 0..MOST_PAGES {
            join(&hub, &page.to_string());
        }
        assert!(hub.join("one more").is_none());
        assert_eq!(hub.done(1, vec![Done::Leave; MOST_EVENTS]), Ok(()));
        assert_eq!(hub.done(1, vec![Done::Leave]), Err(TooMuch));
    }

    #[test]
    fn a_page_that_cannot_be_seen_or_is_slow_asks_for_no_frames() {
        let hub = hub();
        assert!(!hub.is_watched());
        let page = join(&hub, "a");
        assert!(hub.is_watched());
        hub.sees(page, None, Some(false));
        assert!(!hub.is_watched());
        hub.sees(page, Some(false), Some(true));
        assert!(!hub.is_watched());
        hub.sees(page, Some(true), None);
        assert!(hub.is_watched());
    }
}
