//! Checks of what a driver reports: its clock, its states, its images.

use std::time::Duration;

use super::super::limits;
use super::super::placement::{ChainPlacement, NEED as PLACES_NEEDED};
use super::super::shared::Inner;
use super::super::states::Reading;
use super::{Checked, Found, Run, Wrong, wrong};

/// How long clock and states are observed.
const WATCHED: Duration = Duration::from_millis(1500);
/// A driver's seconds may differ from ours by this part: pongs of a second and a half come with some milliseconds.
const RATE_TOLERANCE: f64 = 0.05;
/// A clock that is related worse than this \[s\] has pings that are answered late.
const RELATED_S: f64 = 0.01;
/// A stamp that is this much in the future \[s\] is of another clock.
const FUTURE_S: f64 = 0.05;
/// Rate of states that the protocol requires, with the resolution of one and a half seconds.
const FEWEST_HZ: f64 = 8.0;
const MOST_HZ: f64 = 600.0;
/// Calibrated arms are a little past their limits at the stops \[rad, m\].
const PAST_LIMIT: f64 = 0.01;

impl Run {
    pub(super) fn clock(&self) -> Checked {
        const NO_PONG: &str = "no `ping` is answered";
        let shared = self.driver.shared();
        let first = shared.wait(WATCHED, Some(&self.cancel), |inner| inner.last_pong)?;
        let Some((first_s, first)) = first else { return wrong(NO_PONG) };
        self.wait(WATCHED)?;
        let Some((last_s, last)) = shared.lock().last_pong.filter(|(last_s, _)| *last_s > first_s) else {
            return wrong("only the first `ping` is answered: each has to be, five times a second");
        };
        let rate = (last - first) / (last_s - first_s);
        match rate {
            _ if (rate - 1.0).abs() <= RATE_TOLERANCE => {}
            ..=0.0 => return wrong("stamps of `pong` do not go on"),
            500.0..=2000.0 => return wrong("stamps of `pong` are in milliseconds, seconds are needed"),
            _ => return wrong(format!("stamps of `pong` go on by {rate:.3} s a second")),
        }
        let Some(offset) = self.driver.clock() else { return wrong(NO_PONG) };
        if offset.jumps > 0 {
            return wrong("stamps of `pong` jump: take them from a steady clock, while the pong is written");
        }
        let text = format!("related to ours to ± {:.2} ms", offset.uncertainty_s * 1e3);
        if offset.uncertainty_s > RELATED_S {
            return Ok(Found::Warning(format!("{text}: pings are answered late, read them in a thread of their own")));
        }
        Ok(Found::Passed(text))
    }

    pub(super) fn states(&self) -> Checked {
        self.in_range(&self.driver.first_state(limits::FIRST, &self.cancel)?.reading)?;
        let count = |inner: &mut Inner| (inner.state_count, inner.states.newest().map_or(0.0, |newest| newest.stamp_s));
        let (before, before_s) = self.driver.shared().update(count);
        self.wait(WATCHED)?;
        let (after, after_s) = self.driver.shared().update(count);
        let rate_hz = (after - before) as f64 / WATCHED.as_secs_f64();
        if rate_hz < FEWEST_HZ {
            return wrong(format!("{rate_hz:.1} a second, at least 10 are needed, also at rest"));
        }
        if after_s <= before_s {
            return wrong(format!("all have the stamp {after_s}: each has the time at which it was measured"));
        }
        let Some(newest) = self.driver.state()? else { return wrong("none has come") };
        self.in_range(&newest.reading)?;
        self.of_this_clock(newest.reading.stamp_s)?;
        let text = format!("{rate_hz:.0} a second");
        Ok(if rate_hz > MOST_HZ { Found::Warning(format!("{text}: 500 are enough")) } else { Found::Passed(text) })
    }

    /// Whether joints and poses belong together, as far as one place of the arm shows.
    pub(super) fn chain(&self) -> Checked {
        match self.driver.chain_placement() {
            ChainPlacement::Unnamed => Ok(Found::Skipped(
                "no `arm` in hello, or no joints: poses are not chosen and driven to by the workbench",
            )),
            ChainPlacement::Open { places: 0 } => Ok(Found::Skipped("the arm moves: let it stand to have it compared")),
            ChainPlacement::Open { .. } => Ok(Found::Passed(format!(
                "{PLACES_NEEDED} places turned about two axes are needed to compare it with the poses; send `base_from_flange` \
                 beside it, and the first state at rest tells"
            ))),
            ChainPlacement::Known(_) => Ok(Found::Passed("it has the flange where the states have it".into())),
            ChainPlacement::Foreign { distance_m, angle_rad } => wrong(format!(
                "by joints_rad the flange is {:.1} mm and {:.2}° from where the states have it: look at `arm`, at \
                 `base_from_arm` and at the units of the joints",
                distance_m * 1e3,
                angle_rad.to_degrees()
            )),
        }
    }

    /// Joint values within the ranges of `hello`; degrees are the usual reason for others.
    fn in_range(&self, reading: &Reading) -> Result<(), Wrong> {
        let Some(values) = &reading.joints else { return Ok(()) };
        for (joint, value) in self.driver.hello().joints.iter().zip(values) {
            let (min, max) = (joint.min.unwrap_or(f64::NEG_INFINITY), joint.max.unwrap_or(f64::INFINITY));
            if !(min - PAST_LIMIT..=max + PAST_LIMIT).contains(value) {
                let name = &joint.name;
                return wrong(format!("{name} is at {value}, outside {min} to {max}: radians and metres are needed"));
            }
        }
        Ok(())
    }

    /// Age of a timestamp, which must be near the present on the clock of the pongs.
    pub(super) fn of_this_clock(&self, stamp_s: f64) -> Result<f64, Wrong> {
        let Some(offset) = self.driver.clock() else { return wrong("no pong has related the clocks") };
        let age_s = self.driver.timebase().now_s() - offset.offset_s - stamp_s;
        if (-FUTURE_S..=limits::IMAGE_AGE_S).contains(&age_s) {
            return Ok(age_s);
        }
        let (off_s, when) = (age_s.abs(), if age_s > 0.0 { "before" } else { "after" });
        wrong(format!(
            "the newest stamp is {off_s:.3} s {when} the present by the stamps of `pong`: all are of one clock, and new"
        ))
    }

    pub(super) fn images(&self) -> Checked {
        let (mut after, mut oldest_s) = (None, 0.0_f64);
        for _ in 0..3 {
            let patience = if after.is_none() { limits::FIRST } else { limits::IMAGE_WAIT };
            let Some(image) = self.driver.image(after, patience, &self.cancel)? else {
                let after = after.map_or_else(|| "null".to_owned(), |stamp: f64| stamp.to_string());
                let seconds = patience.as_secs();
                return wrong(format!("`next_image` with after {after} is not answered within {seconds} s"));
            };
            oldest_s = oldest_s.max(self.of_this_clock(image.stamp_s)?);
            if image.depth.is_some_and(|depth| depth.metres.iter().all(|&metres| metres.is_nan() || metres <= 0.0)) {
                return wrong("no pixel of the depth image has a depth over 0");
            }
            after = Some(image.stamp_s);
        }
        Ok(Found::Passed(format!("three of three, {:.0} ms old at the most when they are here", oldest_s * 1e3)))
    }
}
