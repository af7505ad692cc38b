//! The path of a held jog button to the arm: a dead man's switch. No thread, no clock: the caller passes the time.

use handeye_link::Jog;
use handeye_link::JogRequest;

/// A button counts as held for this long \[s\] after the window last reported it: a few frames of a busy window, and
/// short enough for an arm that nobody holds.
pub const HELD_S: f64 = 0.3;

/// State of the button.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Held {
    /// It is held; this is the share of the fastest speed.
    Yes(f64),
    /// It was released, or another one is held instead.
    Released,
    /// No report that it is held.
    Forgotten {
        /// For this long \[s\].
        after_s: f64,
    },
}

/// The button that is held, and one that may do nothing more until it is released.
#[derive(Debug, Default)]
pub struct JogLine {
    held: Option<Hold>,
    barred: Option<Bar>,
}

#[derive(Debug)]
struct Hold {
    request: JogRequest,
    until_s: f64,
}

#[derive(Debug)]
struct Bar {
    /// Which button; any while `None`.
    jog: Option<Jog>,
    until_s: f64,
}

impl JogLine {
    /// The button is held now. `false` when that has no effect, because the same press has ended before.
    pub fn hold(&mut self, request: JogRequest, now_s: f64) -> bool {
        let until_s = now_s + HELD_S;
        match &mut self.barred {
            Some(bar) if now_s <= bar.until_s && bar.jog.is_none_or(|jog| jog == request.jog) => {
                bar.until_s = until_s;
                return false;
            }
            _ => self.barred = None,
        }
        self.held = Some(Hold { request, until_s });
        true
    }

    /// Every button is released.
    pub fn release(&mut self) {
        (self.held, self.barred) = (None, None);
    }

    /// Ends what the held button does; it has to be released before it has an effect again.
    pub fn bar(&mut self, now_s: f64) {
        self.held = None;
        self.barred = Some(Bar { jog: None, until_s: now_s + HELD_S });
    }

    /// Ends one jog, if it is still held.
    pub fn bar_jog(&mut self, jog: Jog, now_s: f64) {
        if self.held.as_ref().is_some_and(|held| held.request.jog == jog) {
            self.bar(now_s);
            if let Some(bar) = &mut self.barred {
                bar.jog = Some(jog);
            }
        }
    }

    /// What is held.
    pub fn request(&mut self, now_s: f64) -> Option<JogRequest> {
        self.held.take_if(|held| now_s > held.until_s);
        self.held.as_ref().map(|held| held.request)
    }

    /// Whether a jog is still held.
    pub fn is_held(&mut self, jog: Jog, now_s: f64) -> Held {
        if self.held.take_if(|held| now_s > held.until_s).is_some() {
            return Held::Forgotten { after_s: HELD_S };
        }
        match &self.held {
            Some(held) if held.request.jog == jog => Held::Yes(held.request.speed),
            _ => Held::Released,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn request(index: usize) -> JogRequest {
        JogRequest { jog: Jog::Joint { index, forward: true }, tip_from_camera: None, speed: 0.5 }
    }

    #[test]
    fn a_button_that_nobody_speaks_of_any_more_is_let_go() {
        let mut line = JogLine::default();
        assert!(line.hold(request(0), 1.0));
        assert!(line.hold(request(0), 1.2), "it is extended");
        assert_eq!(line.is_held(request(0).jog, 1.49), Held::Yes(0.5));
        assert_eq!(line.is_held(request(0).jog, 1.51), Held::Forgotten { after_s: HELD_S });
        assert_eq!(line.is_held(request(0).jog, 1.52), Held::Released);
    }

    #[test]
    fn a_press_that_was_ended_stays_ended_until_the_button_is_let_go() {
        let mut line = JogLine::default();
        line.hold(request(0), 0.0);
        line.bar(0.1);
        for i in 1..20 {
            assert!(!line.hold(request(0), 0.1 + 0.2 * f64::from(i)), "it was held all the time");
            assert!(!line.hold(request(1), 0.1 + 0.2 * f64::from(i)), "and a stop holds for every button");
        }
        line.release();
        assert!(line.hold(request(0), 4.0));
    }

    #[test]
    fn another_button_works_where_one_has_reached_its_end() {
        let mut line = JogLine::default();
        line.hold(request(0), 0.0);
        line.bar_jog(request(0).jog, 0.0);
        assert!(!line.hold(request(0), 0.1));
        assert!(line.hold(request(1), 0.2));
        assert_eq!(line.is_held(request(0).jog, 0.2), Held::Released);
    }

    #[test]
    fn a_press_whose_release_was_lost_works_again_after_a_while() {
        let mut line = JogLine::default();
        line.bar(0.0);
        assert!(line.hold(request(0), 1.0), "nobody held it in between");
    }
}
