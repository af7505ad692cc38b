//! Checks of what a driver reports: its clock, its states, its images.

use std::time::Duration;

use super::super::limits;
use super::super::message::Ability;
use super::super::placement::{ChainPlacement, NEED as PLACES_NEEDED};
use super::super::shared::Inner;
use super::super::states::Reading;
use super::{Check, Run, gone, passed, skipped, warning, wrong};

/// How long clock and states are watched.
const WATCHED: Duration = Duration::from_millis(1500);
/// A driver's seconds may differ from ours by this part: pongs of a second and a half come with some milliseconds.
const RATE_TOLERANCE: f64 = 0.05;
/// A stamp that is this much in the future \[s\] is of another clock.
const FUTURE_S: f64 = 0.05;
/// States a second that the protocol asks for, with what one and a half seconds can tell.
const FEWEST_HZ: f64 = 8.0;
const MOST_HZ: f64 = 600.0;

impl Run<'_> {
    pub(super) fn clock(&self) -> Result<Check, Check> {
        const NAME: &str = "clock";
        let shared = self.driver.shared();
        let heard = |inner: &mut Inner| inner.last_pong;
        let no_pong = || wrong(NAME, "no `ping` is answered");
        let (first_s, first) = gone(NAME, shared.wait(WATCHED, Some(self.cancel), heard))?.ok_or_else(no_pong)?;
        self.wait(NAME, WATCHED)?;
        let Some((last_s, last)) = shared.lock().last_pong.filter(|(last_s, _)| *last_s > first_s) else {
            return Err(wrong(NAME, "only the first `ping` is answered: each has to be, five times a second"));
        };
        let rate = (last - first) / (last_s - first_s);
        if (rate - 1.0).abs() > RATE_TOLERANCE {
            let why = match rate {
                ..=0.0 => "stamps of `pong` do not go on".to_owned(),
                500.0..=2000.0 => "stamps of `pong` are in milliseconds, seconds are needed".to_owned(),
                _ => format!("stamps of `pong` go on by {rate:.3} s a second"),
            };
            return Err(wrong(NAME, why));
        }
        let Some(offset) = self.driver.clock() else { return Err(no_pong()) };
        if offset.jumps > 0 {
            return Err(wrong(NAME, "stamps of `pong` jump: take them from a steady clock, while the pong is written"));
        }
        let text = format!("related to ours to ± {:.2} ms", offset.uncertainty_s * 1e3);
        if offset.uncertainty_s > 0.01 {
            return Ok(warning(NAME, format!("{text}: pings are answered late, read them in a thread of their own")));
        }
        Ok(passed(NAME, text))
    }

    pub(super) fn states(&self) -> Result<Check, Check> {
        const NAME: &str = "states";
        if !self.can(Ability::State) {
            return Ok(skipped(NAME, "it sends none: poses have to be given by hand"));
        }
        let first = gone(NAME, self.driver.first_state(limits::FIRST, self.cancel))?;
        self.in_range(NAME, &first.reading)?;
        let count = |inner: &mut Inner| (inner.state_count, inner.states.newest().map_or(0.0, |newest| newest.stamp_s));
        let (before, before_s) = self.driver.shared().update(count);
        self.wait(NAME, WATCHED)?;
        let (after, after_s) = self.driver.shared().update(count);
        let rate_hz = (after - before) as f64 / WATCHED.as_secs_f64();
        if rate_hz < FEWEST_HZ {
            return Err(wrong(NAME, format!("{rate_hz:.1} a second, at least 10 are needed, also at rest")));
        }
        if after_s <= before_s {
            return Err(wrong(
                NAME,
                format!("all have the stamp {after_s}: each has the time at which it was measured"),
            ));
        }
        let now = gone(NAME, self.driver.state())?;
        let Some(newest) = now else { return Err(wrong(NAME, "none has come")) };
        self.in_range(NAME, &newest.reading)?;
        self.of_this_clock(NAME, newest.reading.stamp_s)?;
        let text = format!("{rate_hz:.0} a second");
        if rate_hz > MOST_HZ {
            return Ok(warning(NAME, format!("{text}: 500 are enough")));
        }
        Ok(passed(NAME, text))
    }

    /// Whether joints and poses belong together, as far as one place of the arm tells.
    pub(super) fn chain(&self) -> Result<Check, Check> {
        const NAME: &str = "chain";
        let placement = self.driver.chain_placement();
        let flange = "send `base_from_flange` beside it, and the first state at rest tells";
        match placement {
            ChainPlacement::Unnamed => Ok(skipped(
                NAME,
                "no `arm` in hello, or no joints: poses are not chosen and driven to by the workbench",
            )),
            ChainPlacement::Open { places: 0 } => Ok(skipped(NAME, "the arm moves: let it stand to have it compared")),
            ChainPlacement::Open { .. } => Ok(passed(
                NAME,
                format!(
                    "{PLACES_NEEDED} places turned about two axes are needed to compare it with the poses; {flange}"
                ),
            )),
            ChainPlacement::Known(_) => Ok(passed(NAME, "it has the flange where the states have it")),
            ChainPlacement::Foreign { distance_m, angle_rad } => Err(wrong(
                NAME,
                format!(
                    "by joints_rad the flange is {:.1} mm and {:.2}° from where the states have it: look at `arm`, at \
                     `base_from_arm` and at the units of the joints",
                    distance_m * 1e3,
                    angle_rad.to_degrees()
                ),
            )),
        }
    }

    /// Joint values within what `hello` says; degrees are the usual reason for others.
    fn in_range(&self, name: &'static str, reading: &Reading) -> Result<(), Check> {
        let Some(values) = &reading.joints else { return Ok(()) };
        for (joint, value) in self.driver.hello().joints.iter().zip(values) {
            let (min, max) = (joint.min.unwrap_or(f64::NEG_INFINITY), joint.max.unwrap_or(f64::INFINITY));
            // Calibrated arms stand a little past their limits at the stops.
            if !(min - 0.01..=max + 0.01).contains(value) {
                let why =
                    format!("{} is at {value}, outside {min} to {max}: radians and metres are needed", joint.name);
                return Err(wrong(name, why));
            }
        }
        Ok(())
    }

    /// A stamp is near the present on the clock of the pongs.
    pub(super) fn of_this_clock(&self, name: &'static str, stamp_s: f64) -> Result<f64, Check> {
        let Some(offset) = self.driver.clock() else { return Err(wrong(name, "no pong has related the clocks")) };
        let age_s = self.driver.timebase().now_s() - offset.offset_s - stamp_s;
        if (-FUTURE_S..=limits::IMAGE_AGE_S).contains(&age_s) {
            return Ok(age_s);
        }
        let when = if age_s > 0.0 { "before" } else { "after" };
        Err(wrong(
            name,
            format!(
                "the newest stamp is {:.3} s {when} the present by the stamps of `pong`: all are of one clock, and new",
                age_s.abs()
            ),
        ))
    }

    pub(super) fn images(&self) -> Result<Check, Check> {
        const NAME: &str = "images";
        if !self.can(Ability::Image) {
            return Ok(skipped(NAME, "it has none"));
        }
        let mut after = None;
        let mut ages_s = Vec::new();
        for _ in 0..3 {
            let patience = if after.is_none() { limits::FIRST } else { limits::IMAGE_WAIT };
            let image = gone(NAME, self.driver.image(after, patience, self.cancel))?;
            let Some(image) = image else {
                let after = after.map_or_else(|| "null".to_owned(), |stamp: f64| stamp.to_string());
                let seconds = patience.as_secs();
                return Err(wrong(NAME, format!("`next_image` with after {after} is not answered within {seconds} s")));
            };
            ages_s.push(self.of_this_clock(NAME, image.stamp_s)?);
            if let Some(depth) = &image.depth
                && !depth.metres.iter().any(|&metres| metres > 0.0)
            {
                return Err(wrong(NAME, "no pixel of the depth image has a depth over 0"));
            }
            after = Some(image.stamp_s);
        }
        let oldest_s = ages_s.iter().copied().fold(0.0, f64::max);
        Ok(passed(NAME, format!("three of three, {:.0} ms old at the most when they are here", oldest_s * 1e3)))
    }
}
