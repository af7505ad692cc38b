//! The option `--rerun` of every command that has something to show, and the recording: started as requested, ended after
//! the result.

use std::ffi::OsString;
use std::time::Duration;

use anyhow::anyhow;
use clap::Args;
use handeye_geometry::progress::CancelToken;

use crate::{Failure, out};
use handeye_record::{Pace, Recorder, RecorderOptions, RerunChoice, WebViewer, record};
use handeye_ui::opening::Begin;
use handeye_workbench::arguments::heading;
use handeye_workbench::messages;
use handeye_workbench::model::ViewerState;
use handeye_workbench::recording::Recording as _;
use handeye_workbench::text::Language;

/// How long a command waits at its end for pending writes. A pipe to a viewer elsewhere may be slow.
const DEADLINE: Duration = Duration::from_secs(20);

/// Between two checks of the viewer.
const LOOK: Duration = Duration::from_millis(50);

/// The option `--rerun`.
#[derive(Debug, Clone, Default, Args)]
pub struct RerunArg {
    /// Show it in Rerun: in the native viewer (spawn), in a browser (web), or in a viewer that runs (connect URL); or
    /// record it into a file (save FILE), or not at all (off).
    // One value: the second word is joined to the first before anything is parsed, see `joined`.
    #[arg(long, value_name = "spawn|web|connect URL|save FILE|off", value_parser = RerunChoice::parse, help_heading = heading::OUTPUT)]
    rerun: Option<RerunChoice>,
}

impl RerunArg {
    /// The requested choice, or else the default of the command.
    pub fn choice(&self, otherwise: RerunChoice) -> RerunChoice {
        self.rerun.clone().unwrap_or(otherwise)
    }

    /// The requested choice.
    pub fn asked(&self) -> Option<&RerunChoice> {
        self.rerun.as_ref()
    }
}

/// The arguments with `--rerun save FILE` and `--rerun connect URL` as one argument each, so that `--rerun web PATH` does
/// not take PATH as well.
pub fn joined(arguments: impl IntoIterator<Item = OsString>) -> Vec<OsString> {
    let mut joined: Vec<OsString> = Vec::new();
    let mut arguments = arguments.into_iter().peekable();
    while let Some(argument) = arguments.next() {
        if argument == "--" {
            joined.push(argument);
            joined.extend(arguments);
            return joined;
        }
        let word = if argument == "--rerun" {
            if let Some(word) = arguments.next_if(|next| !is_option(next)) {
                word
            } else {
                joined.push(argument);
                continue;
            }
        } else if let Some(word) = argument.to_str().and_then(|argument| argument.strip_prefix("--rerun=")) {
            OsString::from(word)
        } else {
            joined.push(argument);
            continue;
        };
        let mut value = OsString::from("--rerun=");
        value.push(&word);
        if (word == "save" || word == "connect")
            && let Some(second) = arguments.next_if(|next| !is_option(next))
        {
            value.push(" ");
            value.push(second);
        }
        joined.push(value);
    }
    joined
}

fn is_option(argument: &OsString) -> bool {
    argument.to_string_lossy().starts_with('-')
}

/// Checks that the named file can be written.
///
/// # Errors
/// When it cannot.
fn check(argument: &RerunArg) -> Result<(), Failure> {
    let Some(RerunChoice::Save(file)) = argument.asked() else { return Ok(()) };
    let opened = std::fs::OpenOptions::new().create(true).append(true).open(file);
    opened.map(drop).map_err(|error| {
        let file = file.display();
        Failure::unusable(anyhow!("{file} cannot be written: {error}; name a file in a folder that is there"))
    })
}

/// Records a window, next to its session if nothing else was requested.
///
/// # Errors
/// When the named file cannot be written.
pub fn of_window(argument: &RerunArg, web: WebViewer) -> Result<Begin, Failure> {
    check(argument)?;
    let choice = argument.choice(RerunChoice::Record);
    Ok(Box::new(move |app| Ok(record(app, choice, web)?)))
}

/// Starts the recording of a command that ends.
///
/// # Errors
/// When the named file cannot be written.
pub fn start(
    argument: &RerunArg,
    otherwise: RerunChoice,
    pace: Pace,
    beside_session: bool,
) -> Result<Recorder, Failure> {
    check(argument)?;
    let recorder = Recorder::start(RecorderOptions {
        choice: argument.choice(otherwise),
        pace,
        beside_session,
        web: WebViewer::AtAddress,
        waker: std::sync::Arc::new(|| {}),
    })
    .map_err(Failure::failed)?;
    if argument.asked() == Some(&RerunChoice::Web)
        && let ViewerState::Web { url } = opened(&recorder, &CancelToken::default())
    {
        out::note(format_args!("the recording is shown at {url}"));
    }
    Ok(recorder)
}

/// Waits until the viewer is open, or has failed.
fn opened(recorder: &Recorder, cancel: &CancelToken) -> ViewerState {
    loop {
        let viewer = recorder.state().viewer;
        if viewer != ViewerState::Opening || cancel.is_cancelled() {
            return viewer;
        }
        std::thread::sleep(LOOK);
    }
}

/// Ends the recording of a command, after its result was printed. A viewer reads from this program, so it keeps running
/// until the viewer is closed, or until Ctrl-C.
///
/// # Errors
/// When the requested viewer is not open.
pub fn finish(mut recorder: Recorder, cancel: &CancelToken) -> Result<(), Failure> {
    let mut failed = None;
    match opened(&recorder, cancel) {
        ViewerState::Web { url } => {
            out::note(format_args!("the recording is shown at {url} until Ctrl-C"));
            while !cancel.is_cancelled() {
                std::thread::sleep(LOOK);
            }
        }
        ViewerState::Native => {
            out::note("the recording is shown until the viewer is closed, or Ctrl-C");
            while recorder.state().viewer == ViewerState::Native && !cancel.is_cancelled() {
                std::thread::sleep(LOOK);
            }
        }
        ViewerState::Failed(why) => failed = Some(why),
        ViewerState::Closed | ViewerState::Opening | ViewerState::Connected { .. } => {}
    }
    let mut reported = Vec::new();
    let deadline = if failed.is_some() { Duration::from_secs(2) } else { DEADLINE };
    recorder.drain(&mut |event| reported.push(event));
    let complete = recorder.finish(deadline);
    for event in reported {
        if let handeye_workbench::command::Event::Messages(messages::Event::Notice { text, .. }) = event {
            tracing::warn!("{}", text.in_language(Language::English));
        }
    }
    match failed {
        Some(why) => Err(Failure::failed(anyhow!("{}", why.in_language(Language::English)))),
        None if complete => Ok(()),
        None => Err(Failure::failed(anyhow!(
            "the recording for Rerun was not written within {} s; the result is complete",
            deadline.as_secs()
        ))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn joined_words(line: &str) -> Vec<String> {
        let words = line.split(' ').map(OsString::from);
        joined(words).into_iter().map(|word| word.into_string().expect("UTF-8")).collect()
    }

    #[test]
    fn the_second_word_belongs_to_save_and_connect_and_to_nothing_else() {
        assert_eq!(joined_words("handeye calibrate --rerun web PATH"), ["handeye", "calibrate", "--rerun=web", "PATH"]);
        assert_eq!(
            joined_words("handeye calibrate --rerun save out.rrd PATH"),
            ["handeye", "calibrate", "--rerun=save out.rrd", "PATH"]
        );
        assert_eq!(joined_words("handeye auto --rerun=save out.rrd"), ["handeye", "auto", "--rerun=save out.rrd"]);
        assert_eq!(
            joined_words("handeye --rerun connect rerun+http://a:1/proxy")[1],
            "--rerun=connect rerun+http://a:1/proxy"
        );
    }

    #[test]
    fn what_is_missing_is_left_for_the_parser_to_complain_about() {
        assert_eq!(joined_words("handeye auto --rerun save --quiet"), ["handeye", "auto", "--rerun=save", "--quiet"]);
        assert_eq!(joined_words("handeye auto --rerun"), ["handeye", "auto", "--rerun"]);
        assert_eq!(joined_words("handeye auto --rerun --quiet"), ["handeye", "auto", "--rerun", "--quiet"]);
        assert_eq!(
            joined_words("handeye calibrate -- --rerun save"),
            ["handeye", "calibrate", "--", "--rerun", "save"]
        );
    }
}
