//! What the doctor reports for constructed sessions: forty that are degenerate or hostile, healthy ones, and nine
//! faults.
//!
//! `cargo run --release -p handeye_studies --example doctor_cases -- [HEALTHY SESSIONS] [SEEDS PER FAULT] [FAULT]`, or `… -- TEXT`
//! for the whole report on every case whose name has that text; `… -- as-met [SESSIONS] [FIRST]` for the healthy sessions with an
//! arm whose error depends on where it is; a single one with its report; `… -- servo [SESSIONS] [FIRST]` for those of an arm of
//! servo motors, and for a board that slipped in them; `… -- lenses [GROUPS] [FIRST]` for lenses that are reported to differ among
//! eleven sessions of one camera on such arms; `… -- limits [SESSIONS]` for the sizes from which faults are found.

mod cases;
mod faults;

use std::collections::BTreeMap;

use handeye_estimate::Options;
use handeye_estimate::diagnose::doctor::Detail;
use handeye_estimate::diagnose::findings::Severity;
use handeye_estimate::shared_lens::{NamedSession, calibrate_sharing_lens};
use handeye_geometry::progress::CancelToken;
use handeye_simulate::session::{Setup, observed};
use handeye_wording::English;

fn number(argument: Option<String>, otherwise: u64) -> u64 {
    argument.and_then(|a| a.parse().ok()).unwrap_or(otherwise)
}

/// False alarms in healthy sessions whose arm, board and corners are not ideal.
fn as_met(first: u64, sessions: u64) {
    let (mut alarmed, mut alarms) = (0, BTreeMap::<String, usize>::new());
    for seed in first..first + sessions {
        let (observations, setup) = faults::as_met(20_000 + seed);
        let diagnosis = faults::examined(&observations);
        if sessions == 1 {
            println!("{}", diagnosis.report(Detail::All));
        }
        let named: Vec<_> =
            diagnosis.findings.iter().filter(|finding| faults::names_a_cause(finding, &setup)).collect();
        alarmed += usize::from(!named.is_empty());
        for finding in named {
            *alarms.entry(format!("{:?}", finding.code)).or_default() += 1;
            println!("as met {seed}, {setup:?}: {finding}");
        }
    }
    println!("a cause named in {alarmed} of {sessions} healthy sessions as they are met: {alarms:?}\n");
}

/// Moves that are reported in sessions of an arm of servo motors: in healthy ones, and where the board slipped by this many
/// millimetres in the middle.
fn servo(first: u64, sessions: u64) {
    for slip_m in [0.0, 0.01, 0.02] {
        let mut codes = BTreeMap::<String, usize>::new();
        let mut named = 0;
        for seed in first..first + sessions {
            let mut setup = faults::servo(seed);
            if slip_m > 0.0 {
                let twist = [slip_m * 0.6, -slip_m * 0.8, 0.0, 0.0, 0.0, 0.0].into();
                setup.fault.board_moved = Some((setup.views / 2, twist));
            }
            let diagnosis = faults::examined(&observed(&setup));
            let moves: Vec<_> = diagnosis.findings.iter().filter(|finding| faults::names_a_move(finding)).collect();
            named += usize::from(!moves.is_empty());
            for finding in moves {
                *codes.entry(format!("{:?}", finding.code)).or_default() += 1;
                if slip_m == 0.0 {
                    println!("servo {seed}, {setup:?}: {finding}");
                }
            }
        }
        println!("board slipped by {} mm: a move named in {named} of {sessions} sessions: {codes:?}", slip_m * 1e3);
    }
}

/// Groups of eleven sessions of one camera on an arm of servo motors: lenses that are reported to differ.
fn lenses(first: u64, groups: u64) {
    for group in first..first + groups {
        let sessions: Vec<_> =
            (0..11).map(|k| observed(&Setup { estimated: true, ..faults::servo(11 * group + k) })).collect();
        let names: Vec<String> = (0..11).map(|k| k.to_string()).collect();
        let named: Vec<_> =
            names.iter().zip(&sessions).map(|(name, observations)| NamedSession { name, observations }).collect();
        match calibrate_sharing_lens(&named, Options::default(), &CancelToken::default()) {
            Ok(found) => {
                let shared = found[0].shared_lens.as_ref();
                let odd = shared.map_or(0, |shared| shared.odd.len());
                let another = shared.map_or(0, |shared| shared.odd.iter().filter(|odd| odd.is_another_lens()).count());
                println!("group {group}: {odd} of 11 differ, {another} of them are other lenses");
                for odd in shared.iter().flat_map(|shared| &shared.odd) {
                    println!("  {odd:?}");
                }
            }
            Err(error) => println!("group {group}: {error}"),
        }
    }
}

/// Whether a fault is the first explanation and accepted, or what is reported instead.
fn first_message(fault: usize, times: f64, seed: u64) -> Result<(), String> {
    let (observations, code) = faults::faulty(fault, times, seed);
    let diagnosis = faults::examined(&observations);
    match diagnosis.hypotheses.first() {
        Some(best) if best.code == code && best.accepted => Ok(()),
        best => Err(format!("{:?}", best.map(|h| (h.code, h.accepted, h.text.in_language(English))))),
    }
}

/// How sessions with a fault are made, by the remainder of their seed.
const SET_UPS: [&str; 4] =
    ["in hand, lens given", "to hand, lens given", "in hand, lens estimated", "to hand, lens estimated"];
/// How many of the faults have a variable size; they are first.
const SIZED: usize = 4;

/// The size from which faults are found, separately for every set-up: the size at which half of all sessions have it found, and
/// their share at twice that.
fn limits(sessions: u64) {
    for (fault, name) in faults::FAULTS.iter().enumerate().take(SIZED) {
        let mut at_twice = 0;
        for (kind, set_up) in SET_UPS.iter().enumerate() {
            let found = |times: f64, first: u64| {
                let seeds = (0..sessions).map(|k| first + SET_UPS.len() as u64 * k + kind as u64);
                seeds.filter(|seed| first_message(fault, times, *seed).is_ok()).count()
            };
            let share = |times: f64| found(times, 6000) as f64 / sessions as f64;
            let (mut times, mut larger) = (4.0, share(4.0));
            let limit = loop {
                let smaller = share(times / 2.0);
                if smaller < 0.5 && larger >= 0.5 {
                    // Interpolated between the two in the logarithm of the size.
                    break Some(times / 2.0 * 2f64.powf((0.5 - smaller) / (larger - smaller)));
                }
                (times, larger) = (times / 2.0, smaller);
                if times < 1e-2 {
                    break None;
                }
            };
            let Some(limit) = limit else {
                println!("{name}, {set_up}: no size between where it is found in half of all sessions");
                continue;
            };
            let first = found(2.0 * limit, 60_000);
            at_twice += first;
            println!(
                "{name}, {set_up}: limit {limit:.3} times that, at twice the limit first in {first} of {sessions}"
            );
        }
        println!("{name}: at twice the limit first in {at_twice} of {}", 4 * sessions);
    }
}

fn main() {
    let mut arguments = std::env::args().skip(1).peekable();
    if arguments.next_if(|a| a == "as-met").is_some() {
        let sessions = number(arguments.next(), 200);
        as_met(number(arguments.next(), 0), sessions);
        return;
    }
    if arguments.next_if(|a| a == "servo").is_some() {
        let sessions = number(arguments.next(), 200);
        servo(number(arguments.next(), 0), sessions);
        return;
    }
    if arguments.next_if(|a| a == "lenses").is_some() {
        let groups = number(arguments.next(), 10);
        lenses(number(arguments.next(), 0), groups);
        return;
    }
    if arguments.next_if(|a| a == "limits").is_some() {
        limits(number(arguments.next(), 60));
        return;
    }
    if let Some(text) = arguments.next_if(|a| a.parse::<u64>().is_err()) {
        for case in cases::cases().iter().filter(|c| c.name.contains(&text)) {
            println!("{}\n{}", case.name, faults::examined(&case.observations).report(Detail::All));
        }
        return;
    }
    let sessions = number(arguments.next(), 200);
    let seeds = number(arguments.next(), 50);
    let mut right = 0;
    let cases = cases::cases();
    for case in &cases {
        let verdict = case.verdict(faults::examined_alone);
        right += usize::from(verdict.is_ok());
        println!("{:<60} {}", case.name, verdict.unwrap_or_else(|why| format!("WRONG: {why}")));
    }
    println!("{right} of {} cases answered right\n", cases.len());

    let mut alarms = 0;
    for seed in 0..sessions {
        let observations = faults::healthy(1000 + seed);
        let diagnosis = faults::examined(&observations);
        if !diagnosis.is_healthy() {
            alarms += 1;
            let grave = diagnosis.findings.iter().filter(|f| f.severity >= Severity::Warning);
            let reported: Vec<String> = grave.map(|f| format!("{:?}: {}", f.code, f)).collect();
            println!(
                "healthy {seed}, {} views: {} {:?}",
                observations.views.len(),
                reported.join(" | "),
                diagnosis.untested
            );
        }
    }
    println!("{alarms} false alarms in {sessions} healthy sessions\n");

    as_met(0, sessions);

    for estimated in [false, true] {
        let squares: Vec<f64> = (0..2 * seeds).filter_map(|seed| faults::scale_error(estimated, 9000 + seed)).collect();
        let mean = squares.iter().sum::<f64>() / squares.len().max(1) as f64;
        println!("scale, lens estimated {estimated}: mean squared error over uncertainty {mean:.2} of 1");
    }

    let only = arguments.next();
    for (fault, name) in faults::FAULTS.iter().enumerate() {
        if only.as_ref().is_some_and(|only| !name.contains(only.as_str())) {
            continue;
        }
        let mut first = 0;
        for seed in 0..seeds {
            match first_message(fault, 1.0, 5000 + seed) {
                Ok(()) => first += 1,
                Err(otherwise) => println!("  {name}, seed {seed}: {otherwise}"),
            }
        }
        println!("{name}: first in {first} of {seeds}");
    }
}
