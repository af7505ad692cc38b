//! When drivers that are gone are started again, and when no longer: a program that always ends at once would otherwise keep
//! the machine busy without any report.

use std::time::Duration;

/// A driver that runs for this long \[s\] works: what ends it later is another fault than before.
const STEADY_S: f64 = 10.0;
/// Pauses \[s\] after one, two, … failed starts in a row. The first is for a user who corrects a cable; the last does not disturb
/// a controller that boots for minutes.
const PAUSES_S: [f64; 6] = [0.5, 1.0, 2.0, 4.0, 8.0, 15.0];
/// The longest pause \[s\] where no driver listens at an address: a connection attempt costs little, and a person who starts the
/// driver by hand waits for it.
const KNOCKING_S: f64 = 2.0;
/// Most starts in a row of drivers that never worked: more would not help.
const MOST_AT_FIRST: u32 = 6;
/// Most starts in a row of drivers that have worked, half an hour: a controller that is switched off comes back.
const MOST_LATER: u32 = 120;

/// Why a start failed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Failure {
    /// The driver ended, or did not become ready.
    Ended,
    /// No driver listens at its address: nothing was started.
    Nobody,
    /// It cannot work before a person changes something.
    Hopeless,
}

/// Whether to start now.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Permit {
    /// Yes.
    Now,
    /// Not before that.
    In(Duration),
    /// Not before [`Starts::again`].
    No,
}

/// Counts starts. No clock: times are given, in seconds on any steady one.
#[derive(Debug, Default)]
pub struct Starts {
    /// Starts in a row that failed.
    failures: u32,
    /// Times in a row that no driver listened; none of them is a start.
    knocks: u32,
    began_s: Option<f64>,
    has_worked: bool,
    not_before_s: Option<f64>,
    is_over: bool,
}

impl Starts {
    /// Number of attempts in a row that failed.
    pub fn tries(&self) -> u32 {
        self.failures.saturating_add(self.knocks)
    }

    /// Whether to start at this time.
    pub fn permit(&self, now_s: f64) -> Permit {
        match self.not_before_s {
            _ if self.is_over => Permit::No,
            Some(not_before_s) if now_s < not_before_s => Permit::In(Duration::from_secs_f64(not_before_s - now_s)),
            _ => Permit::Now,
        }
    }

    /// A start went well.
    pub fn began(&mut self, now_s: f64) {
        self.began_s = Some(now_s);
        self.not_before_s = None;
    }

    /// What had begun is gone. It is started again at once where it had worked for a while, or where no start before failed.
    pub fn ended(&mut self, now_s: f64) {
        let Some(began_s) = self.began_s.take() else { return };
        if now_s - began_s >= STEADY_S {
            (self.failures, self.knocks, self.has_worked) = (0, 0, true);
        } else {
            self.count(now_s, Failure::Ended);
            if self.failures == 1 {
                self.not_before_s = None;
            }
        }
    }

    /// A start failed.
    pub fn failed(&mut self, now_s: f64, why: Failure) {
        self.count(now_s, why);
    }

    /// The user requests a start.
    pub fn again(&mut self) {
        (self.failures, self.knocks, self.not_before_s, self.is_over) = (0, 0, None, false);
    }

    fn count(&mut self, now_s: f64, why: Failure) {
        let (count, longest_s, most) = match why {
            Failure::Nobody => (&mut self.knocks, KNOCKING_S, u32::MAX),
            Failure::Ended if self.has_worked => (&mut self.failures, f64::INFINITY, MOST_LATER),
            Failure::Ended => (&mut self.failures, f64::INFINITY, MOST_AT_FIRST),
            Failure::Hopeless => (&mut self.failures, 0.0, 0),
        };
        *count = count.saturating_add(1);
        let index = (*count as usize).min(PAUSES_S.len()) - 1;
        self.is_over = *count >= most;
        self.not_before_s = Some(now_s + PAUSES_S[index].min(longest_s));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Starts whenever it is permitted, with a driver that runs for `lives_s` each time: how many starts there are, and how long
    /// it takes until there are no more.
    fn tried(starts: &mut Starts, lives_s: f64, most: u32) -> (u32, f64) {
        let (mut now_s, mut count) = (0.0, 0);
        while count < most {
            match starts.permit(now_s) {
                Permit::Now => {
                    count += 1;
                    starts.began(now_s);
                    now_s += lives_s;
                    starts.ended(now_s);
                }
                Permit::In(pause) => now_s += pause.as_secs_f64() + 1e-6,
                Permit::No => break,
            }
        }
        (count, now_s)
    }

    #[test]
    fn a_driver_that_ends_at_once_each_time_is_started_a_few_times_with_pauses_and_then_no_more() {
        let mut starts = Starts::default();
        let (count, took_s) = tried(&mut starts, 0.01, 1000);
        assert_eq!((count, starts.permit(1e9)), (MOST_AT_FIRST, Permit::No));
        assert!(took_s > 10.0, "{took_s} s");
        starts.again();
        assert_eq!(starts.permit(took_s), Permit::Now, "a person may always ask");
    }

    #[test]
    fn a_driver_that_worked_is_started_again_at_once_and_for_half_an_hour() {
        let mut starts = Starts::default();
        starts.began(0.0);
        starts.ended(3600.0);
        assert_eq!((starts.permit(3600.0), starts.tries()), (Permit::Now, 0));
        let mut now_s = 3600.0;
        while let Permit::Now | Permit::In(_) = starts.permit(now_s) {
            starts.failed(now_s, Failure::Ended);
            if let Permit::In(pause) = starts.permit(now_s) {
                now_s += pause.as_secs_f64() + 1e-6;
            }
        }
        let minutes = (now_s - 3600.0) / 60.0;
        assert!((25.0..40.0).contains(&minutes), "{minutes} min");
    }

    #[test]
    fn a_driver_that_works_between_its_ends_is_started_for_ever() {
        assert_eq!(tried(&mut Starts::default(), 60.0, 1000).0, 1000);
    }

    #[test]
    fn an_address_is_knocked_at_for_ever_and_not_seldom() {
        let mut starts = Starts::default();
        for i in 0..1000 {
            let now_s = 100.0 * f64::from(i);
            assert_eq!(starts.permit(now_s), Permit::Now);
            starts.failed(now_s, Failure::Nobody);
            let Permit::In(pause) = starts.permit(now_s) else { panic!("{:?}", starts.permit(now_s)) };
            assert!(pause.as_secs_f64() <= KNOCKING_S);
        }
    }

    #[test]
    fn waiting_for_an_address_takes_no_start_from_the_driver_that_comes_up_there() {
        let mut starts = Starts::default();
        for i in 0..1000 {
            starts.failed(f64::from(i), Failure::Nobody);
        }
        starts.failed(1e4, Failure::Ended);
        assert!(matches!(starts.permit(1e4), Permit::In(_)), "{:?}", starts.permit(1e4));
        assert_eq!(starts.tries(), 1001);
    }

    #[test]
    fn what_a_person_has_to_change_is_tried_once() {
        let mut starts = Starts::default();
        starts.failed(0.0, Failure::Hopeless);
        assert_eq!(starts.permit(1e6), Permit::No);
    }
}
