//! The option `--rerun`: where the recording goes and how it is viewed.

use std::path::PathBuf;
use std::str::FromStr as _;

/// Where the recording goes.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub enum RerunChoice {
    /// Into a file next to the session, if there is a session; a viewer is opened on request.
    #[default]
    Record,
    /// The native viewer is opened as well.
    Spawn,
    /// The web viewer is served as well.
    Web,
    /// It also goes to a viewer or proxy that runs already.
    Connect(String),
    /// Into this file instead of one next to the session.
    Save(PathBuf),
    /// Nothing is recorded.
    Off,
}

/// The value of `--rerun` cannot be used.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error, handeye_wording::Localized)]
pub enum ChoiceError {
    /// No such word.
    #[error(
        "{0:?} is none of spawn, web, connect URL, save FILE, off; for example `--rerun web` or `--rerun save out.rrd`"
    )]
    Unknown(String),
    /// `save` without a file.
    #[error("save needs a file: `--rerun save recording.rrd`")]
    NoFile,
    /// `connect` without an address.
    #[error("connect needs the address of a viewer: `--rerun connect rerun+http://127.0.0.1:9876/proxy`")]
    NoUrl,
    /// `connect` with something else.
    #[error(
        "{url:?} is not the address of a viewer ({why}); it looks like rerun+http://127.0.0.1:9876/proxy, and `rerun` prints it when it starts"
    )]
    BadUrl {
        /// What was given.
        url: String,
        /// What is wrong with it.
        why: String,
    },
}

impl RerunChoice {
    /// From the words after `--rerun`, joined by a space.
    ///
    /// # Errors
    /// [`ChoiceError`], which states what to write instead.
    pub fn parse(words: &str) -> Result<Self, ChoiceError> {
        let (word, rest) = words.split_once(' ').unwrap_or((words, ""));
        match (word, rest) {
            ("spawn", "") => Ok(Self::Spawn),
            ("web", "") => Ok(Self::Web),
            ("off", "") => Ok(Self::Off),
            ("save", "") => Err(ChoiceError::NoFile),
            ("save", file) => Ok(Self::Save(PathBuf::from(file))),
            ("connect", "") => Err(ChoiceError::NoUrl),
            ("connect", url) => match rerun::external::re_uri::ProxyUri::from_str(url) {
                Ok(_) => Ok(Self::Connect(url.to_owned())),
                Err(error) => Err(ChoiceError::BadUrl { url: url.to_owned(), why: error.to_string() }),
            },
            _ => Err(ChoiceError::Unknown(words.to_owned())),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_choice_can_be_written_and_a_bad_one_says_what_to_write() {
        let url = "rerun+http://127.0.0.1:9876/proxy";
        assert_eq!(RerunChoice::parse("spawn"), Ok(RerunChoice::Spawn));
        assert_eq!(RerunChoice::parse("web"), Ok(RerunChoice::Web));
        assert_eq!(RerunChoice::parse("off"), Ok(RerunChoice::Off));
        assert_eq!(RerunChoice::parse("save my file.rrd"), Ok(RerunChoice::Save(PathBuf::from("my file.rrd"))));
        assert_eq!(RerunChoice::parse(&format!("connect {url}")), Ok(RerunChoice::Connect(url.to_owned())));
        for (words, advice) in [
            ("sav", "spawn, web, connect URL, save FILE, off"),
            ("", "spawn, web"),
            ("web 9090", "spawn, web"),
            ("save", "--rerun save recording.rrd"),
            ("connect", "rerun+http://127.0.0.1:9876/proxy"),
            ("connect 127.0.0.1:9876", "rerun+http://127.0.0.1:9876/proxy"),
        ] {
            let reported = RerunChoice::parse(words).expect_err(words).to_string();
            assert!(reported.contains(advice), "{words:?}: {reported}");
        }
    }
}
