//! The address at which a server listens.

use std::fmt;
use std::str::FromStr;

/// Port of CoppeliaSim's remote API unless another was chosen.
pub const DEFAULT_PORT: u16 = 23000;

/// An address that cannot be used.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error, handeye_wording::Localized)]
#[error("{text:?} is not an address of a server: {reason}; write HOST:PORT, for example 127.0.0.1:23000")]
pub struct BadEndpoint {
    /// The text as given.
    pub text: String,
    /// What is wrong with it.
    pub reason: &'static str,
}

/// A TCP address of a remote API server.
///
/// Parses from `tcp://HOST:PORT`, `HOST:PORT` or `HOST` (port [`DEFAULT_PORT`]); an IPv6 address is written in
/// brackets.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Endpoint {
    host: String,
    port: u16,
}

impl Endpoint {
    /// From a host name or address, IPv6 without brackets, and a port.
    ///
    /// # Errors
    /// [`BadEndpoint`] when the host is empty or has characters that no host name has, or the port is 0.
    pub(crate) fn new(host: &str, port: u16) -> Result<Self, BadEndpoint> {
        let bad = |reason| Err(BadEndpoint { text: format!("{host}:{port}"), reason });
        if host.is_empty() {
            return bad("the host is missing");
        }
        if !host.chars().all(|c| c.is_ascii_alphanumeric() || "-._:%".contains(c)) {
            return bad("the host has a character that no host name has");
        }
        if port == 0 {
            return bad("port 0 cannot be connected to");
        }
        Ok(Self { host: host.to_owned(), port })
    }

    /// Port `port` of this machine.
    pub fn local(port: u16) -> Self {
        Self { host: "127.0.0.1".to_owned(), port }
    }

    /// TCP port.
    pub fn port(&self) -> u16 {
        self.port
    }

    pub(super) fn is_ipv6(&self) -> bool {
        self.host.contains(':')
    }
}

impl Default for Endpoint {
    fn default() -> Self {
        Self::local(DEFAULT_PORT)
    }
}

impl fmt::Display for Endpoint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.is_ipv6() {
            write!(f, "tcp://[{}]:{}", self.host, self.port)
        } else {
            write!(f, "tcp://{}:{}", self.host, self.port)
        }
    }
}

handeye_wording::plain_values!(Endpoint);

impl FromStr for Endpoint {
    type Err = BadEndpoint;

    fn from_str(text: &str) -> Result<Self, BadEndpoint> {
        let bad = |reason| BadEndpoint { text: text.to_owned(), reason };
        let rest = match text.trim().split_once("://") {
            Some(("tcp", rest)) => rest,
            Some(_) => return Err(bad("only tcp:// is spoken")),
            None => text.trim(),
        };
        let (host, port) = if let Some(bracketed) = rest.strip_prefix('[') {
            let (host, tail) = bracketed.split_once(']').ok_or_else(|| bad("a ] is missing"))?;
            (host, tail.strip_prefix(':'))
        } else {
            match rest.split_once(':') {
                Some((_, port)) if port.contains(':') => return Err(bad("an IPv6 address stands in brackets")),
                Some((host, port)) => (host, Some(port)),
                None => (rest, None),
            }
        };
        let port = match port {
            Some(digits) => digits.parse().ok().ok_or_else(|| bad("the port is not a number from 1 to 65535"))?,
            None => DEFAULT_PORT,
        };
        Self::new(host, port)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_usual_ways_to_write_an_address_are_read() {
        for (text, shown) in [
            ("tcp://127.0.0.1:23004", "tcp://127.0.0.1:23004"),
            ("localhost:23001", "tcp://localhost:23001"),
            ("robot-cell.lan", "tcp://robot-cell.lan:23000"),
            ("[::1]:23000", "tcp://[::1]:23000"),
            ("[::1]", "tcp://[::1]:23000"),
        ] {
            assert_eq!(text.parse::<Endpoint>().expect(text).to_string(), shown);
        }
    }

    #[test]
    fn an_address_that_cannot_work_is_refused_with_its_text() {
        for text in ["", "tcp://", "http://localhost:80", "host:0", "host:port", "host:99999", "::1", "a b:1", "x\0:1"]
        {
            assert!(text.parse::<Endpoint>().is_err(), "{text}");
        }
    }
}
