//! What the doctor says of constructed sessions: forty that are degenerate or hostile, healthy ones, and nine faults.
//!
//! `cargo run --release -p handeye_core --example doctor_cases -- [HEALTHY SESSIONS] [SEEDS PER FAULT] [FAULT]`, or
//! `… -- TEXT` for the whole report on every case whose name has that text; `… -- as-met [SESSIONS] [FIRST]` for the healthy
//! sessions with an arm whose error depends on where it stands; one alone with its report.

mod cases;
mod faults;

use std::collections::BTreeMap;

use handeye_core::diagnose::findings::Severity;
use handeye_core::wording::English;

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
            println!("{}", diagnosis.report());
        }
        let named: Vec<_> =
            diagnosis.findings.iter().filter(|finding| faults::names_a_cause(finding, &setup)).collect();
        alarmed += usize::from(!named.is_empty());
        for finding in named {
            *alarms.entry(format!("{:?}", finding.code)).or_default() += 1;
            println!("as met {seed}, {setup}: {finding}");
        }
    }
    println!("a cause named in {alarmed} of {sessions} healthy sessions as they are met: {alarms:?}\n");
}

fn main() {
    let mut arguments = std::env::args().skip(1).peekable();
    if arguments.next_if(|a| a == "as-met").is_some() {
        let sessions = number(arguments.next(), 200);
        as_met(number(arguments.next(), 0), sessions);
        return;
    }
    if let Some(text) = arguments.next_if(|a| a.parse::<u64>().is_err()) {
        for case in cases::cases().iter().filter(|c| c.name.contains(&text)) {
            println!("{}\n{}", case.name, faults::examined(&case.observations).report());
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
            let said: Vec<String> = grave.map(|f| format!("{:?}: {}", f.code, f)).collect();
            println!(
                "healthy {seed}, {} views: {} {:?}",
                observations.views.len(),
                said.join(" | "),
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
            let (observations, code) = faults::faulty(fault, 5000 + seed);
            let diagnosis = faults::examined(&observations);
            let best = diagnosis.hypotheses.first();
            if best.is_some_and(|h| h.code == code && h.accepted) {
                first += 1;
            } else {
                println!("  {name}, seed {seed}: {:?}", best.map(|h| (h.code, h.accepted, h.text.say(English))));
            }
        }
        println!("{name}: first in {first} of {seeds}");
    }
}
