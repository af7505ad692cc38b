//! Wrong keys, by the address that they come from.
//!
//! A page that was left open shows the same old key again and again: that is no guess. A client that sends many
//! different ones has to wait, and what it sends meanwhile is not checked, right or not.

use std::collections::HashMap;
use std::net::{IpAddr, Ipv6Addr};
use std::time::{Duration, Instant};

/// Different wrong keys before a client has to wait.
const FREE: usize = 10;

/// How long, after each further one.
const WAIT: Duration = Duration::from_mins(1);

/// Addresses that are remembered; the one with the oldest wrong key is dropped first.
const MOST: usize = 1024;

/// Wrong keys so far.
#[derive(Debug, Default)]
pub struct Guesses(HashMap<IpAddr, Wrong>);

#[derive(Debug)]
struct Wrong {
    /// The latest of them.
    keys: Vec<String>,
    last: Instant,
}

/// The outcome of a check of a key.
#[derive(Debug, PartialEq, Eq)]
pub enum Look {
    /// It is the right one.
    Right,
    /// It is not.
    Wrong,
    /// It was not checked.
    Late,
}

impl Guesses {
    /// Checks a text as long as the key, unless too many were wrong.
    pub fn look(&mut self, shown: &str, from: IpAddr, now: Instant, is_right: impl FnOnce(&str) -> bool) -> Look {
        let from = network(from);
        let wrong = self.0.get(&from);
        if wrong.is_some_and(|wrong| wrong.keys.iter().any(|key| key == shown)) {
            return Look::Wrong;
        }
        if wrong.is_some_and(|wrong| wrong.keys.len() >= FREE && now.duration_since(wrong.last) < WAIT) {
            return Look::Late;
        }
        if is_right(shown) {
            return Look::Right;
        }
        if wrong.is_none() && self.0.len() >= MOST {
            let oldest = self.0.iter().min_by_key(|(_, wrong)| wrong.last).map(|(from, _)| *from);
            oldest.map(|oldest| self.0.remove(&oldest));
        }
        let wrong = self.0.entry(from).or_insert_with(|| Wrong { keys: Vec::new(), last: now });
        if wrong.keys.len() >= FREE {
            wrong.keys.remove(0);
        }
        wrong.keys.push(shown.to_owned());
        wrong.last = now;
        if wrong.keys.len() == FREE {
            tracing::warn!(%from, "many wrong keys come from one address; it has to wait after each");
        }
        Look::Wrong
    }
}

/// The owner of an IPv6 address has all of its network.
fn network(address: IpAddr) -> IpAddr {
    match address.to_canonical() {
        IpAddr::V6(address) => {
            let bits = address.to_bits() & !u128::from(u64::MAX);
            IpAddr::V6(Ipv6Addr::from_bits(bits))
        }
        address @ IpAddr::V4(_) => address,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn address(number: u32) -> IpAddr {
        IpAddr::from(number.to_be_bytes())
    }

    #[test]
    fn one_guess_a_minute_is_left_after_the_free_ones() {
        let (mut guesses, began) = (Guesses::default(), Instant::now());
        let mut looked = 0;
        // An hour of a hundred guesses a second.
        for tick in 0..360_000_u32 {
            let now = began + Duration::from_millis(10) * tick;
            looked += usize::from(guesses.look(&tick.to_string(), address(1), now, |_| false) == Look::Wrong);
        }
        assert!((FREE..=FREE + 60).contains(&looked), "{looked}");
    }

    #[test]
    fn many_addresses_take_no_more_memory_and_one_network_counts_once() {
        let (mut guesses, now) = (Guesses::default(), Instant::now());
        for number in 0..10 * MOST as u32 {
            guesses.look("x", address(number), now, |_| false);
        }
        assert_eq!(guesses.0.len(), MOST);
        let mut looked = 0;
        for number in 0..1000_u64 {
            let own = IpAddr::V6(Ipv6Addr::from_bits(0x2001_0db8 << 96 | u128::from(number)));
            looked += usize::from(guesses.look(&number.to_string(), own, now, |_| false) == Look::Wrong);
        }
        assert_eq!(looked, FREE);
    }
}
