//! From one try to the next: the states of a connection that comes and goes.

use std::time::Duration;

use crate::connect::state::LinkState;
use crate::text::Text;
use handeye_link::CellSource;
use handeye_link::PortError;

/// Pauses between tries. The user who starts the simulator waits for the first ones; a machine that is off for the
/// night should not be contacted more often than the last.
const PAUSES: [Duration; 4] =
    [Duration::from_millis(250), Duration::from_millis(500), Duration::from_secs(1), Duration::from_secs(2)];

/// Follows one connection. No thread, no clock: the worker reports what happened and when.
#[derive(Debug)]
pub struct Reconnect {
    source: CellSource,
    attempt: u32,
    why: Option<Text>,
    /// Since when a connection that once worked is gone.
    lost_since_s: Option<f64>,
    /// There is no next try before the user asks.
    waits_for_user: bool,
    /// The pause that the cell itself requests.
    wanted_pause: Option<Duration>,
}

impl Reconnect {
    /// Before the first try.
    pub fn new(source: CellSource) -> Self {
        Self { source, attempt: 0, why: None, lost_since_s: None, waits_for_user: false, wanted_pause: None }
    }

    /// A try begins.
    pub fn trying(&mut self) -> LinkState {
        self.attempt += 1;
        self.waits_for_user = false;
        self.wanted_pause = None;
        match self.lost_since_s {
            Some(since_s) => LinkState::Retrying { since_s, why: self.reason(), attempt: self.attempt },
            None => self.searching(),
        }
    }

    /// The try succeeded.
    pub fn connected(&mut self, address: String, server: String) -> LinkState {
        self.attempt = 0;
        self.why = None;
        self.lost_since_s = None;
        LinkState::Connected { address, server }
    }

    /// The try failed.
    pub fn failed(&mut self, error: &PortError, now_s: f64) -> LinkState {
        self.why = Some(error.why().clone());
        self.waits_for_user = matches!(error, PortError::Hopeless(_) | PortError::Rests(_));
        if let &PortError::Later { tries, pause, .. } = error {
            (self.attempt, self.wanted_pause) = (tries, Some(pause));
        }
        match (error, self.lost_since_s) {
            (PortError::Hopeless(why), _) => LinkState::Failed { why: why.clone() },
            (PortError::Rests(why), _) => LinkState::Resting { why: why.clone() },
            (_, Some(since_s)) => {
                let next_s = now_s + self.pause().unwrap_or_default().as_secs_f64();
                LinkState::Lost { since_s, why: self.reason(), attempt: self.attempt, next_s }
            }
            (_, None) => self.searching(),
        }
    }

    /// A connection that worked broke.
    pub fn lost(&mut self, error: &PortError, now_s: f64) -> LinkState {
        self.lost_since_s = Some(now_s);
        self.failed(error, now_s)
    }

    /// How long to wait before the next try; `None`: until the user asks.
    pub fn pause(&self) -> Option<Duration> {
        let index = (self.attempt.saturating_sub(1) as usize).min(PAUSES.len() - 1);
        (!self.waits_for_user).then(|| self.wanted_pause.unwrap_or(PAUSES[index]))
    }

    fn searching(&self) -> LinkState {
        match &self.source {
            CellSource::BuiltIn(_) => LinkState::StartingCell { why: self.why.clone() },
            CellSource::Address(address) => {
                LinkState::Searching { address: address.clone(), attempt: self.attempt, why: self.why.clone() }
            }
            CellSource::Drivers(drivers) => {
                LinkState::Searching { address: drivers.to_string(), attempt: self.attempt, why: self.why.clone() }
            }
        }
    }

    fn reason(&self) -> Text {
        self.why.clone().unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gone() -> PortError {
        PortError::Lost(Text::verbatim("nothing answers"))
    }

    #[test]
    fn a_server_that_is_not_there_yet_is_searched_for_and_the_reason_is_shown() {
        let mut reconnect = Reconnect::new(CellSource::Address("tcp://cell:1".to_owned()));
        assert!(matches!(reconnect.trying(), LinkState::Searching { attempt: 1, why: None, .. }));
        assert!(matches!(reconnect.failed(&gone(), 20.0), LinkState::Searching { attempt: 1, why: Some(_), .. }));
        assert!(matches!(reconnect.trying(), LinkState::Searching { attempt: 2, why: Some(_), .. }));
        assert!(reconnect.connected("tcp://cell:1".to_owned(), "sim".to_owned()).is_connected());
    }

    #[test]
    fn a_loss_keeps_the_time_when_it_began_over_all_retries() {
        let mut reconnect = Reconnect::new(CellSource::default());
        reconnect.trying();
        reconnect.connected(String::new(), String::new());
        assert!(matches!(reconnect.lost(&gone(), 12.5), LinkState::Lost { since_s: 12.5, .. }));
        for expected in 1..5 {
            let LinkState::Retrying { since_s, attempt, .. } = reconnect.trying() else { panic!("not retrying") };
            assert_eq!((since_s, attempt), (12.5, expected));
            assert!(matches!(reconnect.failed(&gone(), 20.0), LinkState::Lost { since_s: 12.5, .. }));
        }
        reconnect.connected(String::new(), String::new());
        assert!(matches!(reconnect.lost(&gone(), 99.0), LinkState::Lost { since_s: 99.0, .. }));
    }

    #[test]
    fn pauses_grow_and_stay_bounded() {
        let mut reconnect = Reconnect::new(CellSource::default());
        let mut before = Duration::ZERO;
        for _ in 0..10 {
            reconnect.trying();
            reconnect.failed(&gone(), 20.0);
            let pause = reconnect.pause().expect("it tries again");
            assert!(pause >= before && pause <= PAUSES[3]);
            before = pause;
        }
    }

    #[test]
    fn a_cell_that_says_when_it_may_be_tried_is_not_tried_before_that_and_its_tries_are_shown() {
        let mut reconnect = Reconnect::new(CellSource::default());
        reconnect.trying();
        reconnect.connected(String::new(), String::new());
        reconnect.lost(&gone(), 12.5);
        reconnect.trying();
        let later = PortError::Later { why: Text::verbatim("it ends"), tries: 7, pause: Duration::from_secs(15) };
        let state = reconnect.failed(&later, 20.0);
        let why = Text::verbatim("it ends");
        assert_eq!(state, LinkState::Lost { since_s: 12.5, why, attempt: 7, next_s: 35.0 });
        assert_eq!(reconnect.pause(), Some(Duration::from_secs(15)));
        assert!(matches!(reconnect.trying(), LinkState::Retrying { attempt: 8, .. }));
    }

    #[test]
    fn whoever_has_had_enough_is_not_bothered_by_further_tries() {
        let mut reconnect = Reconnect::new(CellSource::default());
        reconnect.trying();
        let state = reconnect.failed(&PortError::Rests(Text::verbatim("it ends")), 20.0);
        assert_eq!((state, reconnect.pause()), (LinkState::Resting { why: Text::verbatim("it ends") }, None));
    }

    #[test]
    fn what_cannot_work_waits_for_the_user() {
        let mut reconnect = Reconnect::new(CellSource::default());
        reconnect.trying();
        let state = reconnect.failed(&PortError::Hopeless(Text::verbatim("no memory")), 20.0);
        assert_eq!(state, LinkState::Failed { why: Text::verbatim("no memory") });
        assert_eq!(reconnect.pause(), None);
        assert_eq!(reconnect.trying(), LinkState::StartingCell { why: Some(Text::verbatim("no memory")) });
    }
}
