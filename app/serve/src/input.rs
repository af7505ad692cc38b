//! The messages of a page, and the egui events made from them.

use egui::{
    Event, ImeEvent, Key, Modifiers, MouseWheelUnit, PointerButton, Pos2, TouchDeviceId, TouchId, TouchPhase, Vec2,
};
use serde::Deserialize;

use super::reading;
use handeye_ui::actions::STOP_KEY;
use handeye_ui::stop_button::StopPlaces;

/// Supported sizes of a page \[points\].
const SIZES: std::ops::RangeInclusive<f32> = 100.0..=8192.0;

/// Supported pixels per point.
const SCALES: std::ops::RangeInclusive<f32> = 0.5..=4.0;

#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(tag = "t", rename_all = "snake_case", deny_unknown_fields)]
pub enum PageMessage {
    /// The user's input, in order.
    Input { events: Vec<Done> },
    /// The size of the page.
    Screen(Screen),
    /// A frame is on the screen.
    Shown { number: u64 },
    /// Whether the page can be seen.
    Visible {
        /// It can.
        visible: bool,
    },
    /// A screen reader reads the page, or no more.
    Reads {
        /// It does.
        reads: bool,
    },
    /// A button, key or finger is still down.
    Held,
    /// Stop the arm.
    Stop,
    /// The user wants to drive.
    Drive,
    /// Uploaded files to open.
    Open {
        /// Name of the upload.
        upload: String,
    },
}

/// The size of a page.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Screen {
    /// Width \[points\].
    pub width: f32,
    /// Height \[points\].
    pub height: f32,
    /// Pixels per point.
    pub scale: f32,
    /// Whether it has touch input instead of a pointer.
    #[serde(default)]
    pub touch: bool,
}

impl Screen {
    /// Whether it is supported.
    pub fn is_sensible(&self) -> bool {
        SIZES.contains(&self.width) && SIZES.contains(&self.height) && SCALES.contains(&self.scale)
    }
}

/// Input of the user. Places are in points of the frame that the page shows, from the top left corner.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(tag = "e", rename_all = "snake_case", deny_unknown_fields)]
pub enum Done {
    /// The pointer has moved.
    Move {
        /// Where.
        at: [f32; 2],
    },
    /// A button of the pointer was pressed or released.
    Button {
        /// Where.
        at: [f32; 2],
        /// 0 primary, 1 middle, 2 secondary, as in browsers.
        button: u8,
        /// Pressed.
        down: bool,
        /// See [`modifiers`].
        modifiers: u8,
    },
    /// The pointer left the page.
    Leave,
    /// The wheel was turned.
    Wheel {
        /// How far the content moves.
        by: [f32; 2],
        /// In lines, not in points.
        lines: bool,
        /// See [`modifiers`].
        modifiers: u8,
    },
    /// A touch.
    Touch {
        /// Which one.
        id: u32,
        /// Where.
        at: [f32; 2],
        /// Its phase.
        phase: Phase,
        /// Whether it is the first one, which also acts as a pointer.
        first: bool,
    },
    /// A key was pressed or released.
    Key {
        /// Its name in browsers.
        key: String,
        /// Pressed.
        down: bool,
        /// See [`modifiers`].
        modifiers: u8,
    },
    /// Text was typed.
    Text { text: String },
    /// Text is being composed.
    Compose {
        /// As it is so far.
        text: String,
    },
    /// Text was composed.
    Composed { text: String },
    /// Text comes from the clipboard.
    Paste { text: String },
    /// Copy the selection.
    Copy,
    /// Cut the selection.
    Cut,
    /// A control was reached by a screen reader, or pressed.
    Control {
        /// Its number.
        id: String,
        /// It was pressed.
        press: bool,
    },
    /// The page has gained or lost the keyboard focus.
    Focus {
        /// It has.
        focused: bool,
    },
}

/// Phase of a touch.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Phase {
    /// It started.
    Start,
    Move,
    /// It ended.
    End,
    /// The browser used it for a gesture of its own.
    Cancel,
}

/// Bits: 1 Alt, 2 Ctrl, 4 Shift, 8 the command key of a Mac.
fn modifiers(bits: u8) -> Modifiers {
    let (alt, ctrl, shift, mac_cmd) = (bits & 1 != 0, bits & 2 != 0, bits & 4 != 0, bits & 8 != 0);
    Modifiers { alt, ctrl, shift, mac_cmd, command: ctrl || mac_cmd }
}

fn place([x, y]: [f32; 2]) -> Option<Pos2> {
    (x.is_finite() && y.is_finite()).then(|| Pos2::new(x.clamp(-1e5, 1e5), y.clamp(-1e5, 1e5)))
}

impl Done {
    /// Whether it presses STOP, wherever that is. It counts when it goes down: a release is not needed to stop the arm.
    pub fn stops(&self, stop: &StopPlaces) -> bool {
        let is_there = |at: [f32; 2]| place(at).is_some_and(|at| stop.rects.iter().any(|rect| rect.contains(at)));
        match self {
            Self::Button { at, button: 0, down: true, .. } | Self::Touch { at, phase: Phase::Start, .. } => {
                is_there(*at)
            }
            Self::Control { id, press: true } => stop.controls.contains(id),
            Self::Key { key, down: true, .. } => {
                named(key) == Some(STOP_KEY) || stop.has_keyboard && matches!(named(key), Some(Key::Enter | Key::Space))
            }
            _ => false,
        }
    }

    /// Whether it may end what was held.
    pub fn lets_go(&self) -> bool {
        match self {
            Self::Button { down, .. } | Self::Key { down, .. } => !down,
            Self::Touch { phase, .. } => matches!(phase, Phase::End | Phase::Cancel),
            Self::Leave | Self::Focus { focused: false } => true,
            _ => false,
        }
    }

    /// Adds the events that it stands for. Invalid input is ignored.
    pub fn add_to(self, events: &mut Vec<Event>) {
        match self {
            Self::Move { at } => events.extend(place(at).map(Event::PointerMoved)),
            Self::Button { at, button, down, modifiers: bits } => {
                let button = match button {
                    0 => PointerButton::Primary,
                    1 => PointerButton::Middle,
                    2 => PointerButton::Secondary,
                    _ => return,
                };
                let Some(pos) = place(at) else { return };
                events.push(Event::PointerMoved(pos));
                events.push(Event::PointerButton { pos, button, pressed: down, modifiers: modifiers(bits) });
            }
            Self::Leave => events.push(Event::PointerGone),
            Self::Control { id, press } => events.extend(reading::event(&id, press)),
            Self::Wheel { by: [x, y], lines, modifiers: bits } => {
                if x.is_finite() && y.is_finite() {
                    events.push(Event::MouseWheel {
                        unit: if lines { MouseWheelUnit::Line } else { MouseWheelUnit::Point },
                        delta: Vec2::new(x.clamp(-1e4, 1e4), y.clamp(-1e4, 1e4)),
                        phase: TouchPhase::Move,
                        modifiers: modifiers(bits),
                    });
                }
            }
            Self::Touch { id, at, phase, first } => touch(id, at, phase, first, events),
            Self::Key { key, down, modifiers: bits } => {
                if let Some(key) = named(&key) {
                    let modifiers = modifiers(bits);
                    events.push(Event::Key { key, physical_key: None, pressed: down, repeat: false, modifiers });
                }
            }
            Self::Text { text } => {
                let text: String = text.chars().filter(|letter| !letter.is_control()).collect();
                if !text.is_empty() {
                    events.push(Event::Text(text));
                }
            }
            Self::Compose { text } => events.push(Event::Ime(ImeEvent::Preedit { text, active_range_chars: None })),
            Self::Composed { text } => events.push(Event::Ime(ImeEvent::Commit(text))),
            Self::Paste { text } => events.push(Event::Paste(text)),
            Self::Copy => events.push(Event::Copy),
            Self::Cut => events.push(Event::Cut),
            Self::Focus { focused } => events.push(Event::WindowFocused(focused)),
        }
    }
}

/// A finger, and what it does as a pointer.
fn touch(id: u32, at: [f32; 2], phase: Phase, first: bool, events: &mut Vec<Event>) {
    let Some(pos) = place(at) else { return };
    let egui_phase = match phase {
        Phase::Start => TouchPhase::Start,
        Phase::Move => TouchPhase::Move,
        Phase::End => TouchPhase::End,
        Phase::Cancel => TouchPhase::Cancel,
    };
    let id = TouchId(u64::from(id));
    events.push(Event::Touch { device_id: TouchDeviceId(0), id, phase: egui_phase, pos, force: None });
    if !first {
        return;
    }
    let button =
        |pressed| Event::PointerButton { pos, button: PointerButton::Primary, pressed, modifiers: Modifiers::NONE };
    match phase {
        Phase::Start => events.extend([Event::PointerMoved(pos), button(true)]),
        Phase::Move => events.push(Event::PointerMoved(pos)),
        Phase::End => events.extend([button(false), Event::PointerGone]),
        Phase::Cancel => events.push(Event::PointerGone),
    }
}

fn named(key: &str) -> Option<Key> {
    match key {
        " " => Some(Key::Space),
        // Letters arrive as typed, with or without Shift.
        key if key.len() == 1 => Key::from_name(&key.to_ascii_uppercase()),
        key => Key::from_name(key),
    }
}

/// What is held down, so that it can be released when the page is silent.
#[derive(Debug, Default)]
pub struct Held {
    buttons: Vec<PointerButton>,
    keys: Vec<Key>,
    touches: Vec<TouchId>,
}

impl Held {
    /// Whether something is.
    pub fn is_any(&self) -> bool {
        !(self.buttons.is_empty() && self.keys.is_empty() && self.touches.is_empty())
    }

    /// Takes note of events.
    pub fn heed(&mut self, events: &[Event]) {
        for event in events {
            match event {
                Event::PointerButton { button, pressed, .. } => note(&mut self.buttons, *button, *pressed),
                Event::Key { key, pressed, .. } => note(&mut self.keys, *key, *pressed),
                Event::Touch { id, phase, .. } => {
                    note(&mut self.touches, *id, matches!(phase, TouchPhase::Start | TouchPhase::Move));
                }
                _ => {}
            }
        }
    }

    /// Releases the keys; otherwise each would repeat its action when the page reports again.
    pub fn release_keys(&mut self) -> Vec<Event> {
        let released = |key| {
            let modifiers = Modifiers::NONE;
            Event::Key { key, physical_key: None, pressed: false, repeat: false, modifiers }
        };
        std::mem::take(&mut self.keys).into_iter().map(released).collect()
    }

    /// Releases everything without further effect: a button that is released far away is not clicked.
    pub fn release(&mut self) -> Vec<Event> {
        const NOWHERE: Pos2 = Pos2::new(-1e4, -1e4);
        let mut events = self.release_keys();
        let Self { buttons, touches, .. } = std::mem::take(self);
        if !(buttons.is_empty() && touches.is_empty()) {
            events.push(Event::PointerMoved(NOWHERE));
        }
        for id in touches {
            let (device_id, phase) = (TouchDeviceId(0), TouchPhase::Cancel);
            events.push(Event::Touch { device_id, id, phase, pos: NOWHERE, force: None });
        }
        for button in buttons {
            events.push(Event::PointerButton { pos: NOWHERE, button, pressed: false, modifiers: Modifiers::NONE });
        }
        if !events.is_empty() {
            events.push(Event::PointerGone);
        }
        events
    }
}

/// Whether an event may end what was held, as the window receives it.
pub fn lets_go(event: &Event) -> bool {
    match event {
        Event::PointerButton { pressed, .. } | Event::Key { pressed, .. } => !pressed,
        Event::Touch { phase, .. } => matches!(phase, TouchPhase::End | TouchPhase::Cancel),
        Event::PointerGone | Event::WindowFocused(false) => true,
        _ => false,
    }
}

fn note<T: PartialEq>(held: &mut Vec<T>, what: T, is_down: bool) {
    held.retain(|held| *held != what);
    if is_down {
        held.push(what);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reported(json: &str) -> PageMessage {
        serde_json::from_str(json).expect("a message")
    }

    fn events(json: &str) -> Vec<Event> {
        let PageMessage::Input { events: done } = reported(json) else { panic!("no input: {json}") };
        let mut events = Vec::new();
        for done in done {
            done.add_to(&mut events);
        }
        events
    }

    #[test]
    fn a_click_with_control_is_one() {
        let events = events(
            r#"{"t":"input","events":[{"e":"button","at":[3,4],"button":0,"down":true,"modifiers":2},
                {"e":"button","at":[3,4],"button":0,"down":false,"modifiers":2}]}"#,
        );
        let Some(Event::PointerButton { pos, button, pressed, modifiers }) = events.get(1) else {
            panic!("{events:?}")
        };
        assert_eq!((*pos, *button, *pressed), (Pos2::new(3.0, 4.0), PointerButton::Primary, true));
        assert!(modifiers.ctrl && modifiers.command && !modifiers.shift);
    }

    #[test]
    fn stop_is_recognised_by_its_place_its_number_and_its_keys() {
        let places = StopPlaces {
            rects: vec![egui::Rect::from_min_size(Pos2::new(10.0, 10.0), Vec2::splat(20.0))],
            controls: vec!["17".to_owned()],
            has_keyboard: false,
        };
        let stops = |json: &str, places: &StopPlaces| {
            let PageMessage::Input { events } = reported(&format!(r#"{{"t":"input","events":[{json}]}}"#)) else {
                panic!("{json}")
            };
            events.iter().any(|done| done.stops(places))
        };
        for (json, is_stop) in [
            (r#"{"e":"button","at":[12,12],"button":0,"down":true,"modifiers":0}"#, true),
            (r#"{"e":"button","at":[12,12],"button":0,"down":false,"modifiers":0}"#, false),
            (r#"{"e":"button","at":[12,12],"button":2,"down":true,"modifiers":0}"#, false),
            (r#"{"e":"button","at":[12,31],"button":0,"down":true,"modifiers":0}"#, false),
            (r#"{"e":"touch","id":4,"at":[29,29],"phase":"start","first":false}"#, true),
            (r#"{"e":"touch","id":4,"at":[29,29],"phase":"move","first":true}"#, false),
            (r#"{"e":"control","id":"17","press":true}"#, true),
            (r#"{"e":"control","id":"17","press":false}"#, false),
            (r#"{"e":"key","key":"Escape","down":true,"modifiers":4}"#, true),
            (r#"{"e":"key","key":"Enter","down":true,"modifiers":0}"#, false),
        ] {
            assert_eq!(stops(json, &places), is_stop, "{json}");
        }
        let focused = StopPlaces { has_keyboard: true, ..places };
        assert!(stops(r#"{"e":"key","key":"Enter","down":true,"modifiers":0}"#, &focused));
    }

    #[test]
    fn keys_are_known_by_the_names_of_browsers() {
        for (name, key) in [
            ("a", Key::A),
            ("A", Key::A),
            (" ", Key::Space),
            ("Escape", Key::Escape),
            ("ArrowLeft", Key::ArrowLeft),
            ("Delete", Key::Delete),
            ("F1", Key::F1),
            ("Enter", Key::Enter),
            ("Backspace", Key::Backspace),
            ("?", Key::Questionmark),
            ("7", Key::Num7),
            ("PageDown", Key::PageDown),
        ] {
            assert_eq!(named(name), Some(key), "{name}");
        }
        assert_eq!(named("Dead"), None);
    }

    #[test]
    fn what_makes_no_sense_means_nothing() {
        for json in [
            r#"{"t":"input","events":[{"e":"button","at":[3,4],"button":9,"down":true,"modifiers":0}]}"#,
            r#"{"t":"input","events":[{"e":"key","key":"Hyper","down":true,"modifiers":255}]}"#,
            r#"{"t":"input","events":[{"e":"text","text":"\n\u0007"}]}"#,
        ] {
            assert!(events(json).is_empty(), "{json}");
        }
        let huge = events(r#"{"t":"input","events":[{"e":"move","at":[1e30,-1e30]}]}"#);
        assert_eq!(huge, [Event::PointerMoved(Pos2::new(1e5, -1e5))]);
        for refused in [r#"{"t":"input","events":[{"e":"move"}]}"#, r#"{"t":"fly"}"#, "[]"] {
            assert!(serde_json::from_str::<PageMessage>(refused).is_err(), "{refused}");
        }
    }

    #[test]
    fn a_million_broken_messages_are_refused_or_mean_something_finite() {
        const MESSAGES: [&str; 6] = [
            r#"{"t":"input","events":[{"e":"button","at":[30.5,40],"button":0,"down":true,"modifiers":2}]}"#,
            r#"{"t":"input","events":[{"e":"touch","id":3,"at":[5,6],"phase":"move","first":true}]}"#,
            r#"{"t":"input","events":[{"e":"wheel","by":[0,-120],"lines":false,"modifiers":0},{"e":"leave"}]}"#,
            r#"{"t":"input","events":[{"e":"key","key":"Escape","down":true,"modifiers":0},{"e":"text","text":"ä"}]}"#,
            r#"{"t":"screen","width":1440,"height":900,"scale":1.5,"touch":false}"#,
            r#"{"t":"shown","number":17}"#,
        ];
        const BYTES: &[u8] = b"0123456789-+.eE{}[]:,tfn\\u\"\xff";
        // Steele and Vigna's SplitMix64; the same numbers every time.
        let mut state = 7_u64;
        let mut next = |below: usize| {
            state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let mut mixed = (state ^ (state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            ((mixed ^ (mixed >> 31)) % below as u64) as usize
        };
        let (mut understood, mut events) = (0, Vec::new());
        for _ in 0..1_000_000 {
            let mut message = MESSAGES[next(MESSAGES.len())].as_bytes().to_vec();
            for _ in 0..=next(3) {
                let (at, byte) = (next(message.len()), BYTES[next(BYTES.len())]);
                match next(3) {
                    0 => message[at] = byte,
                    1 => message.insert(at, byte),
                    _ => drop(message.remove(at)),
                }
            }
            let Ok(reported) = serde_json::from_slice::<PageMessage>(&message) else { continue };
            understood += 1;
            match reported {
                PageMessage::Input { events: done } => {
                    events.clear();
                    for done in done {
                        done.add_to(&mut events);
                    }
                    for event in &events {
                        if let Event::PointerMoved(at) | Event::PointerButton { pos: at, .. } = event {
                            assert!(at.x.abs() <= 1e5 && at.y.abs() <= 1e5, "{}", String::from_utf8_lossy(&message));
                        }
                    }
                }
                PageMessage::Screen(screen) if screen.is_sensible() => {
                    assert!(screen.width * screen.scale <= 4.0 * 8192.0);
                }
                _ => {}
            }
        }
        assert!(understood > 1000, "the mutations break everything");
    }

    #[test]
    fn a_page_that_is_heard_of_no_more_holds_nothing() {
        let down = events(
            r#"{"t":"input","events":[{"e":"button","at":[30,40],"button":0,"down":true,"modifiers":0},
                {"e":"key","key":"ArrowUp","down":true,"modifiers":0}]}"#,
        );
        let mut held = Held::default();
        held.heed(&down);
        assert!(held.is_any());
        let released = held.release();
        assert!(!held.is_any());
        let far = |event: &Event| matches!(event, Event::PointerButton { pressed: false, pos, .. } if pos.x < -1e3);
        assert!(released.iter().any(far));
        assert!(released.iter().any(|event| matches!(event, Event::Key { key: Key::ArrowUp, pressed: false, .. })));
        // Released by the user: nothing is left to release.
        held.heed(&down);
        held.heed(&released);
        assert_eq!(held.release(), []);
    }

    #[test]
    fn the_first_finger_is_a_pointer_and_others_are_not() {
        let finger = |first: bool, phase: &str| {
            events(&format!(
                r#"{{"t":"input","events":[{{"e":"touch","id":1,"at":[5,6],"phase":"{phase}","first":{first}}}]}}"#
            ))
        };
        assert!(finger(true, "start").iter().any(|event| matches!(event, Event::PointerButton { pressed: true, .. })));
        assert_eq!(finger(true, "end").last(), Some(&Event::PointerGone));
        assert_eq!(finger(false, "start").len(), 1);
        assert!(!finger(true, "cancel").iter().any(|event| matches!(event, Event::PointerButton { .. })));
    }
}
