//! The address of a driver: a command or a network address.

use std::fmt;
use std::str::FromStr;

/// How a driver is reached.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum DriverSpec {
    /// A program that is started, and its arguments.
    Command(Vec<String>),
    /// `HOST:PORT`, where a driver listens.
    Tcp(String),
}

/// A text that names no driver.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error, handeye_wording::Localized)]
#[non_exhaustive]
pub enum BadSpec {
    /// Nothing but spaces.
    #[error("no driver is named: a command such as `python3 my_driver.py`, or tcp://HOST:PORT")]
    Empty,
    /// A quote without its end.
    #[error("{text}: a quote is not closed")]
    Quote {
        /// The text as given.
        text: String,
    },
    /// No port.
    #[error("{text}: tcp://HOST:PORT needs host and port, for example tcp://127.0.0.1:7000")]
    Address {
        /// The text as given.
        text: String,
    },
}

impl FromStr for DriverSpec {
    type Err = BadSpec;

    fn from_str(text: &str) -> Result<Self, BadSpec> {
        let text = text.trim();
        if let Some(address) = text.strip_prefix("tcp://") {
            let parts = address.rsplit_once(':').filter(|(host, port)| !host.is_empty() && port.parse::<u16>().is_ok());
            return match parts {
                Some(_) => Ok(Self::Tcp(address.to_owned())),
                None => Err(BadSpec::Address { text: text.to_owned() }),
            };
        }
        match shlex::split(text) {
            None => Err(BadSpec::Quote { text: text.to_owned() }),
            Some(words) if words.is_empty() => Err(BadSpec::Empty),
            Some(words) => Ok(Self::Command(words)),
        }
    }
}

impl fmt::Display for DriverSpec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Command(words) => {
                // Only a word with a NUL has no quoted form, and no command line has one.
                let joined = shlex::try_join(words.iter().map(String::as_str));
                f.write_str(&joined.unwrap_or_else(|_| words.join(" ")))
            }
            Self::Tcp(address) => write!(f, "tcp://{address}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_is_split_as_a_shell_does_and_shown_so_that_it_can_be_given_again() {
        let spec: DriverSpec = r#"python3 "my driver.py" --name 'a $HOME b'"#.parse().expect("a command");
        let words = ["python3", "my driver.py", "--name", "a $HOME b"].map(str::to_owned).to_vec();
        assert_eq!(spec, DriverSpec::Command(words));
        assert_eq!(spec.to_string().parse(), Ok(spec));
    }

    #[test]
    fn what_names_no_driver_is_refused_with_what_to_write() {
        assert_eq!("  ".parse::<DriverSpec>(), Err(BadSpec::Empty));
        assert!(matches!("python3 'x".parse::<DriverSpec>(), Err(BadSpec::Quote { .. })));
        for address in ["tcp://", "tcp://host", "tcp://host:", "tcp://:70", "tcp://host:99999"] {
            assert!(matches!(address.parse::<DriverSpec>(), Err(BadSpec::Address { .. })), "{address}");
        }
        assert_eq!("tcp://[::1]:7000".parse(), Ok(DriverSpec::Tcp("[::1]:7000".to_owned())));
    }
}
