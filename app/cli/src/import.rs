//! `handeye import`: recordings of other tools as dataset folders.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::anyhow;
use clap::Args;
use handeye_files::bounds::Bounds;
use handeye_files::budget::{Budget, Limits};
use handeye_geometry::progress::CancelToken;
use handeye_geometry::targets::TargetSpec;
use handeye_import::{self as import, Hypothesis, ImportError, Judgement, Recording, Settings, Verdict, write};
use handeye_wording::{English, Text};
use serde_json::json;

use super::output::Output;
use crate::{Failure, out, solve};
use handeye_workbench::arguments::heading;
use handeye_workbench::import::understand::{self, NotUnderstood};

/// At the end of its help.
pub fn after_help() -> String {
    let formats: Vec<String> =
        understand::formats_text().iter().map(|line| format!("  {}", line.in_language(English))).collect();
    let formats = formats.join("\n") + "\n";
    format!(
        "What is read:\n{formats}\nKeys of --set:\n{}\n\nExamples, on a recording without a description of what its files mean:\n  \
         handeye sample --out recording && rm recording/dataset.toml\n  \
         handeye import recording --target 10x7x15 --set mode=eye_in_hand\n  \
         handeye import recording --target 10x7x15 --set mode=eye_in_hand \\\n      --out my_robot_images",
        import::KEYS
    )
}

/// Options of `handeye import`.
#[derive(Debug, Args)]
pub struct ImportArgs {
    /// Folder or file of the recording.
    path: PathBuf,
    /// Write a dataset folder here; it must not be there yet, or be empty. Without it the hypotheses are only listed.
    #[arg(long, value_name = "DIR", help_heading = heading::OUTPUT)]
    out: Option<PathBuf>,
    /// The target in the images: 10x7x15 is a chessboard of 10 × 7 inner corners with squares of 15 mm; others as `handeye target`
    /// names them, kind=charuco,columns=4,rows=6,square=33,marker=20,dictionary=6x6_250.
    #[arg(long, value_name = "SPEC", help_heading = heading::MEANING)]
    target: Option<String>,
    /// Take one of several hypotheses that explain the recording: `best` for the first, or its number in the list.
    #[arg(long, value_name = "best|N", help_heading = heading::MEANING)]
    take: Option<Take>,
    /// Fix a convention that the files do not state; may be given several times.
    #[arg(long, value_name = "KEY=VALUE", help_heading = heading::MEANING)]
    set: Vec<String>,
    /// Leave the images where they are; the data set names them there.
    #[arg(long, help_heading = heading::OUTPUT)]
    link: bool,
    /// Stop reading the files after this many seconds. Detection in images does not count: its progress is reported, and Ctrl-C
    /// ends it.
    #[arg(long, value_name = "SECONDS", default_value_t = 20.0, value_parser = seconds, help_heading = heading::LIMITS)]
    time: f64,
    /// Stop reading where compressed files unpack to more than this many GiB.
    #[arg(long, value_name = "GIB", default_value_t = 4, value_parser = clap::value_parser!(u64).range(1..=1 << 20), help_heading = heading::LIMITS)]
    unpack: u64,
    /// Write what was found as JSON to this file; `-` for standard output instead of the text.
    #[arg(long, value_name = "FILE", help_heading = heading::OUTPUT)]
    json: Option<Output>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Take {
    Best,
    Number(usize),
}

impl std::str::FromStr for Take {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match (text, text.parse()) {
            ("best", _) => Ok(Self::Best),
            (_, Ok(number)) if number > 0 => Ok(Self::Number(number)),
            _ => Err("`best`, or the number of a hypothesis in the list".into()),
        }
    }
}

pub fn run(args: &ImportArgs) -> Result<(), Failure> {
    let cancel = solve::cancel_on_ctrl_c();
    let mut settings = Settings::default();
    for assignment in &args.set {
        settings.set(assignment).map_err(Failure::unusable)?;
    }
    if let Some(folder) = &args.out {
        write::check_out(folder).map_err(Failure::unusable)?;
    }
    let given =
        args.target.as_deref().map(handeye_workbench::arguments::of_text).transpose().map_err(Failure::unusable)?;
    let recording = Arc::new(open(args, &cancel).map_err(Failure::unusable)?);
    let mut summary = Summary { text: found(&recording), notes: Vec::new() };
    let outcome = import(args, &recording, given, &settings, &mut summary, &cancel);
    // What was found is reported in any case: a refusal refers to it.
    let findings = match &outcome {
        Ok(done) => done.findings.clone(),
        Err(refused) => refused.findings.clone().unwrap_or(serde_json::Value::Null),
    };
    summary.publish(args, &recording, &findings)?;
    outcome.map(|_| ()).map_err(|refused| refused.failure)
}

fn seconds(text: &str) -> Result<f64, String> {
    let is_some = |seconds: &f64| (1e-3..=1e6).contains(seconds);
    text.parse().ok().filter(is_some).ok_or_else(|| "seconds, from 0.001 to 1000000".to_owned())
}

/// Reads the files within the allowed time and size.
fn open(args: &ImportArgs, cancel: &CancelToken) -> Result<Recording, ImportError> {
    let begun = Instant::now();
    let elapsed = || begun.elapsed();
    let limits = Limits { time: Duration::from_secs_f64(args.time), unpacked_bytes: args.unpack << 30 };
    import::open_within(&args.path, &Bounds::ANYWHERE, &Budget::new(limits, &elapsed, cancel))
}

struct Done {
    findings: serde_json::Value,
}

struct Refused {
    failure: Failure,
    findings: Option<serde_json::Value>,
}

impl From<Failure> for Refused {
    fn from(failure: Failure) -> Self {
        Self { failure, findings: None }
    }
}

/// What is reported on standard output.
struct Summary {
    text: String,
    notes: Vec<String>,
}

impl Summary {
    fn note(&mut self, note: impl std::fmt::Display) {
        let note = note.to_string();
        self.line(format_args!("note: {note}"));
        self.notes.push(note);
    }

    fn line(&mut self, line: impl std::fmt::Display) {
        // Writing to a string cannot fail.
        let _ok = writeln!(self.text, "{line}").is_ok();
    }

    fn publish(&self, args: &ImportArgs, recording: &Recording, findings: &serde_json::Value) -> Result<(), Failure> {
        if let Some(output) = &args.json {
            let document = json!({
                "format": "handeye-import",
                "version": 1,
                "found": in_english(&recording.beliefs),
                "warnings": in_english(&recording.warnings),
                "notes": self.notes,
                "judgement": findings,
            });
            let text = serde_json::to_string_pretty(&document).map_err(Failure::failed)?;
            output.write(format!("{text}\n").as_bytes())?;
        }
        if args.json.as_ref().is_some_and(Output::is_standard) { Ok(()) } else { out::print(&self.text) }
    }
}

fn import(
    args: &ImportArgs,
    recording: &Arc<Recording>,
    given: Option<TargetSpec>,
    settings: &Settings,
    summary: &mut Summary,
    cancel: &CancelToken,
) -> Result<Done, Refused> {
    let refused = |error: NotUnderstood| match error {
        NotUnderstood::Import(ImportError::NoPoses { .. }) if !recording.streams.is_empty() => {
            Failure::failed(anyhow!(
                "{error}. A camera without a robot is calibrated by `handeye calibrate` on the folder, with a dataset.toml that has \
             no [robot]"
            ))
        }
        NotUnderstood::Import(
            ImportError::NoPoses { .. } | ImportError::NoViews { .. } | ImportError::DidNotMove { .. },
        ) => Failure::failed(error),
        NotUnderstood::Import(error) => Failure::unusable(error),
        NotUnderstood::Target(_) if given.is_some() => Failure::failed(anyhow!("nothing was written: {error}")),
        NotUnderstood::Target(_) => Failure::failed(anyhow!("nothing was written: {error}; --target gives it")),
        NotUnderstood::Observe(error) => Failure::failed(error),
    };
    let looked = understand::look(recording, given, settings, &looked_at, cancel).map_err(refused)?;
    for (stream, seen, images) in &looked.seen {
        let target = looked.target.as_ref().map(|(target, _)| target.to_string()).unwrap_or_default();
        summary.line(format_args!("{target} found in {seen} of {images} images {stream}"));
    }
    looked.notes.iter().for_each(|note| summary.note(note.in_language(English)));
    let recording = &*looked.recording;
    for clocks in &recording.clocks {
        summary.line(format_args!("Clocks: {}", clocks.text().in_language(English)));
    }
    let judgement = looked.judge(settings, cancel).map_err(refused)?;
    let is_open_in_mode = settings.mode.is_none() && judgement.is_open_in_mode_alone();
    summary.text.push_str(&listed(recording, &judgement, if is_open_in_mode { 2 } else { SHOWN }));
    if judgement.untried + judgement.sources_untried > 0 {
        summary.note(understand::untried_text(&judgement).in_language(English));
    }
    if is_open_in_mode && args.out.is_none() {
        summary.line(asked_for_mode(args));
    }
    let mut findings = as_json(recording, &judgement);
    let refuse = |failure: Failure, findings: serde_json::Value| Refused { failure, findings: Some(findings) };
    let Some(folder) = &args.out else { return Ok(Done { findings }) };
    let (index, is_taken) = match choose(&judgement, args.take) {
        Ok(chosen) => chosen,
        Err(_) if is_open_in_mode && args.take.is_none() => {
            return Err(refuse(
                Failure::failed(anyhow!(
                    "nothing was written. {}\n  either one:    --take N, by its number in the list",
                    asked_for_mode(args)
                )),
                findings,
            ));
        }
        Err(failure) => return Err(refuse(failure, findings)),
    };
    let h = &judgement.hypotheses[index];
    let known = looked.context(&judgement, settings, h, is_taken);
    if args.link {
        // Names are relative to the folder, which has to exist to be resolved.
        std::fs::create_dir_all(folder).map_err(|e| Failure::unusable(anyhow!("{}: {e}", folder.display())))?;
    }
    let plan = import::plan(h, &known, args.link.then_some(folder.as_path()));
    let progress = |done: usize, of: usize| {
        if done == of || done.is_multiple_of(50) {
            tracing::info!("{done} of {of} images copied");
        }
    };
    write::write(&plan, folder, progress).map_err(Failure::failed)?;
    for line in &plan.left_out {
        summary.note(format_args!("not written: {line}"));
    }
    summary.line(format_args!(
        "Wrote {} to {}. Solve it with: handeye calibrate {}",
        out::counted(plan.views, "view", "views"),
        folder.display(),
        folder.display()
    ));
    findings["written"] = json!({ "hypothesis": index + 1, "views": plan.views, "left_out": plan.left_out });
    Ok(Done { findings })
}

/// The hypothesis to write, and whether the user chose it out of several.
fn choose(judgement: &Judgement, take: Option<Take>) -> Result<(usize, bool), Failure> {
    let nothing = |what: String| Err(Failure::failed(anyhow!("nothing was written: {what}")));
    match (take, &judgement.verdict) {
        (None | Some(Take::Best | Take::Number(1)), Verdict::Decided) => Ok((0, false)),
        (Some(Take::Number(n)), _) => match judgement.hypotheses.get(n - 1) {
            Some(_) => Ok((n - 1, true)),
            None => nothing(format!("there are {} hypotheses", judgement.hypotheses.len())),
        },
        (Some(Take::Best), Verdict::Ambiguous(_)) => Ok((0, true)),
        (None, Verdict::Ambiguous(1)) => nothing(
            "which pose belongs to which image was found from the images themselves: check the pairing, then take it with \
             --take 1"
                .into(),
        ),
        (None, Verdict::Ambiguous(count)) => nothing(format!(
            "{count} hypotheses explain the recording and differ: fix what you know with --set KEY=VALUE, or take one with \
             --take N or --take best"
        )),
        (_, Verdict::Unexplained) => {
            let why = judgement.hypotheses.first().and_then(|best| best.contradictions.first());
            let why = why.map_or_else(
                || "images and poses may not belong together, or the target may be a different one".to_owned(),
                Text::to_string,
            );
            nothing(format!("no hypothesis explains the recording: {why}; --take N takes one all the same"))
        }
    }
}

fn looked_at(done: usize, of: usize) {
    if done.is_multiple_of(20) {
        tracing::info!("{done} of {of} images looked at");
    }
}

/// What is in the folder.
fn found(recording: &Recording) -> String {
    let mut text = String::from("Found:\n");
    for belief in &recording.beliefs {
        text.extend(["  ", &belief.in_language(English), "\n"]);
    }
    for warning in &recording.warnings {
        text.extend(["  note: ", &warning.in_language(English), "\n"]);
    }
    text
}

/// Hypotheses that are shown.
const SHOWN: usize = 12;

fn listed(recording: &Recording, judgement: &Judgement, most: usize) -> String {
    let shown: Vec<&Hypothesis> = judgement.hypotheses.iter().take(most).collect();
    let all: Vec<Vec<import::Convention>> = shown.iter().map(|h| h.conventions(recording)).collect();
    let value = |of: &[import::Convention], key: &str| of.iter().find(|c| c.key == key).map(|c| c.value.clone());
    let differs = |key: &str| all.iter().any(|of| value(of, key) != value(&all[0], key));
    let mut text = String::new();
    let mut line = |line: String| {
        text.push_str(&line);
        text.push('\n');
    };
    if let Some(first) = all.first() {
        line(String::new());
        line("What all hypotheses below share:".into());
        for convention in first.iter().filter(|c| !differs(c.key)) {
            line(format!("  {} = {} ({})", convention.key, convention.value, convention.means));
        }
    }
    line(String::new());
    line(format!(
        "{} tried; the error that each leaves (median distance and angle), the best first:",
        out::counted(judgement.tried, "hypothesis", "hypotheses")
    ));
    for (number, (h, conventions)) in shown.iter().zip(&all).enumerate() {
        let fit = h.fit.as_ref().map_or_else(
            || "no solution".to_owned(),
            |fit| format!("{:>9.2} mm {:>8.3}°  {} views", fit.median_m * 1e3, fit.median_rad.to_degrees(), fit.views),
        );
        let different: Vec<String> =
            conventions.iter().filter(|c| differs(c.key)).map(|c| format!("{}={}", c.key, c.value)).collect();
        line(format!("{:>3}. {fit}  {}", number + 1, different.join(" ")));
        if let Some(fit) = &h.fit {
            if differs("mode") && !different.is_empty() {
                let (camera, target) = (fit.camera_at_m * 1e3, fit.target_at_m * 1e3);
                let (carries_camera, carries_target) = match h.mode {
                    handeye_estimate::handeye::Mode::EyeInHand => ("tip", "base"),
                    handeye_estimate::handeye::Mode::EyeToHand => ("base", "tip"),
                };
                line(format!(
                    "       the camera {camera:.0} mm from the {carries_camera}, the target {target:.0} mm from the {carries_target}"
                ));
            }
            if !fit.disagreeing.is_empty() {
                let views = out::counted(fit.disagreeing.len(), "view disagrees", "views disagree");
                line(format!("       {views} with the others"));
            }
        }
        for same in &h.same_as {
            line(format!("       the same poses: {same}"));
        }
        for why in &h.contradictions {
            line(format!("       contradicted: {why}"));
        }
    }
    if judgement.hypotheses.len() > most && most == SHOWN {
        line(format!("     and {} more", judgement.hypotheses.len() - most));
    }
    line(String::new());
    line(match &judgement.verdict {
        Verdict::Decided => "The first is the only one that explains the recording.".into(),
        Verdict::Ambiguous(1) => {
            "The first alone explains the recording, with a pairing that was found from the images \
                                  themselves: check it before it is taken."
                .into()
        }
        Verdict::Ambiguous(count) => {
            format!("The first {count} explain the recording; the data cannot tell which is right.")
        }
        Verdict::Unexplained => "None explains the recording.".into(),
    });
    text
}

/// Asks for the place of the camera, if only that is open, with both commands ready to run.
fn asked_for_mode(args: &ImportArgs) -> String {
    let command = |mode: &str| {
        let mut words = vec!["handeye".to_owned(), "import".to_owned(), args.path.display().to_string()];
        let mut option = |name: &str, value: Option<String>| {
            words.extend(value.into_iter().flat_map(|value| [format!("--{name}"), value]));
        };
        option("target", args.target.clone());
        for assignment in &args.set {
            option("set", Some(assignment.clone()));
        }
        option("set", Some(format!("mode={mode}")));
        option("out", args.out.as_ref().map(|folder| folder.display().to_string()));
        option(
            "json",
            args.json.as_ref().map(|output| match output {
                Output::Standard => "-".to_owned(),
                Output::Direct(path) | Output::File(path) => path.display().to_string(),
            }),
        );
        words.extend(args.link.then(|| "--link".to_owned()));
        words.iter().map(|word| quoted(word)).collect::<Vec<_>>().join(" ")
    };
    format!(
        "Everything is determined except where the camera is mounted, which the data cannot show: on the robot, or beside it with the target on the robot?\n  on \
         the robot:  {}\n  beside it:     {}",
        command("eye_in_hand"),
        command("eye_to_hand")
    )
}

/// A word quoted for a shell.
fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_alphanumeric() || "-_=./,:+@%".contains(c);
    if !word.is_empty() && word.chars().all(is_plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', "'\\''"))
    }
}

fn in_english(reported: &[Text]) -> Vec<String> {
    reported.iter().map(|text| text.in_language(English)).collect()
}

fn as_json(recording: &Recording, judgement: &Judgement) -> serde_json::Value {
    let one = |(number, h): (usize, &Hypothesis)| {
        let conventions: BTreeMap<&str, String> =
            h.conventions(recording).into_iter().map(|c| (c.key, c.value)).collect();
        let samples = &recording.tracks[h.robot].samples;
        let fit = h.fit.as_ref().map(|fit| {
            json!({
                "median_mm": fit.median_m * 1e3,
                "median_deg": fit.median_rad.to_degrees(),
                "views": fit.views,
                "camera_mm": fit.camera_at_m * 1e3,
                "target_mm": fit.target_at_m * 1e3,
                "disagreeing": fit.disagreeing.iter().map(|(sample, misfit_m)| {
                    json!({ "pose": samples[*sample].place.in_language(English), "mm": misfit_m * 1e3 })
                }).collect::<Vec<_>>(),
            })
        });
        json!({
            "number": number + 1,
            "conventions": conventions,
            "fit": fit,
            "same_as": h.same_as,
            "contradictions": in_english(&h.contradictions),
        })
    };
    let verdict = match &judgement.verdict {
        Verdict::Decided => "decided",
        Verdict::Ambiguous(_) => "ambiguous",
        Verdict::Unexplained => "unexplained",
    };
    json!({
        "verdict": verdict,
        "tried": judgement.tried,
        "untried": judgement.untried,
        "series_untried": judgement.sources_untried,
        "distance_mm": judgement.distance_m * 1e3,
        "clocks": recording.clocks.iter().map(|clocks| json!({
            "images": clocks.images,
            "poses": clocks.poses,
            "offset_s": clocks.offset.offset_s,
            "sigma_s": clocks.offset.sigma_s,
        })).collect::<Vec<_>>(),
        "hypotheses": judgement.hypotheses.iter().enumerate().map(one).collect::<Vec<_>>(),
    })
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        args: ImportArgs,
    }

    /// What is printed to be copied is what was typed, with the choice, quoted so that a shell splits it as before.
    #[test]
    fn the_question_for_the_mode_gives_both_commands_ready_to_run() {
        let typed =
            ["handeye", "my data/it's", "--target", "10x7x15", "--set", "length_unit=mm", "--out", "set", "--link"];
        let asked = asked_for_mode(&Line::parse_from(typed).args);
        assert_eq!(asked.lines().count(), 3, "{asked}");
        for mode in ["eye_in_hand", "eye_to_hand"] {
            let command = format!(
                "handeye import 'my data/it'\\''s' --target 10x7x15 --set length_unit=mm --set mode={mode} --out set --link"
            );
            assert!(asked.contains(&command), "{asked}");
        }
        let plain = asked_for_mode(&Line::parse_from(["handeye", "recording"]).args);
        assert!(plain.contains("handeye import recording --set mode=eye_in_hand\n"), "{plain}");
    }
}
