//! Who may in.
//!
//! At 127.0.0.1 whoever uses this machine may, by a name of this machine, as for the desktop window. At any other address
//! only those who have the key, which the address that is printed at the start has in it: the browser gets it as a cookie
//! and shows it to nobody else. In either case pages of other sites are refused.

use std::io;
use std::net::{IpAddr, Ipv4Addr, SocketAddr, UdpSocket};

use hyper::header::{COOKIE, HOST, ORIGIN};
use hyper::{Request, StatusCode};

use crate::http::names;

/// Name of the cookie and of the key in the first address.
const KEY: &str = "handeye_key";

/// Why a request is refused.
pub const REFUSED: &str = "Open the address that `handeye serve` printed: it has the key in it.\n";

/// A page of another site.
pub const FOREIGN: &str = "This is asked for by a page of another site.\n";

/// Who may in.
#[derive(Debug, Clone)]
pub enum Access {
    /// Whoever uses this machine.
    Here,
    /// Whoever has the key.
    Key(String),
}

/// What becomes of a request.
#[derive(Debug, PartialEq, Eq)]
pub enum Verdict {
    /// It is answered.
    Enter,
    /// The key is in its address: it becomes this cookie.
    Welcome(String),
    /// It is not answered.
    Refuse(StatusCode, &'static str),
}

impl Access {
    /// As an address needs it.
    ///
    /// # Errors
    /// When the system has no random numbers for a key.
    pub fn of(bind: IpAddr) -> io::Result<Self> {
        if bind.is_loopback() {
            return Ok(Self::Here);
        }
        let mut key = [0; 16];
        getrandom::fill(&mut key).map_err(io::Error::other)?;
        Ok(Self::Key(format!("{:032x}", u128::from_be_bytes(key))))
    }

    /// What a person opens.
    pub fn url(&self, address: SocketAddr) -> String {
        let address = named(address);
        match self {
            Self::Here => format!("http://{address}/"),
            Self::Key(key) => format!("http://{address}/?{KEY}={key}"),
        }
    }

    /// What becomes of a request.
    pub fn judge<B>(&self, request: &Request<B>) -> Verdict {
        if !is_of_this_site(request) {
            return Verdict::Refuse(StatusCode::FORBIDDEN, FOREIGN);
        }
        match self {
            Self::Here if names::are_of_this_machine(request) => Verdict::Enter,
            Self::Here => Verdict::Refuse(StatusCode::FORBIDDEN, names::REFUSAL),
            Self::Key(key) => {
                let cookies = request.headers().get_all(COOKIE).iter().filter_map(|cookies| cookies.to_str().ok());
                let shown = cookies.flat_map(|cookies| cookies.split(';')).filter_map(|cookie| {
                    let (name, value) = cookie.trim().split_once('=')?;
                    (name == KEY).then_some(value)
                });
                if shown.into_iter().any(|shown| is_same(shown, key)) {
                    return Verdict::Enter;
                }
                let query = request.uri().query().unwrap_or_default();
                let told = query.split('&').filter_map(|pair| pair.split_once('='));
                if request.uri().path() == "/"
                    && told.into_iter().any(|(name, value)| name == KEY && is_same(value, key))
                {
                    return Verdict::Welcome(format!("{KEY}={key}; HttpOnly; SameSite=Strict; Path=/"));
                }
                Verdict::Refuse(StatusCode::UNAUTHORIZED, REFUSED)
            }
        }
    }
}

/// An address that others can use: one that stands for all of this machine is replaced by the one that it has in the
/// network.
fn named(address: SocketAddr) -> SocketAddr {
    if !address.ip().is_unspecified() {
        return address;
    }
    // To connect sends nothing here: it only chooses the way to an address, which nobody has.
    let own = UdpSocket::bind((Ipv4Addr::UNSPECIFIED, 0)).and_then(|socket| {
        socket.connect((Ipv4Addr::new(192, 0, 2, 1), 9))?;
        socket.local_addr()
    });
    SocketAddr::new(own.map_or(IpAddr::V4(Ipv4Addr::LOCALHOST), |own| own.ip()), address.port())
}

/// Whether a request comes from a page of the very server that it goes to, or from no page. A browser says where the page
/// is from with everything but plain reading, which by itself changes nothing and cannot be read by other sites.
fn is_of_this_site<B>(request: &Request<B>) -> bool {
    let Some(host) = request.headers().get(HOST) else {
        return request.headers().get(ORIGIN).is_none();
    };
    request.headers().get_all(ORIGIN).iter().all(|origin| {
        let authority = origin.to_str().ok().and_then(|origin| origin.strip_prefix("http://"));
        authority.is_some_and(|authority| authority.as_bytes().eq_ignore_ascii_case(host.as_bytes()))
    })
}

/// Whether two texts are the same, in a time that does not tell how much of them is.
fn is_same(one: &str, other: &str) -> bool {
    one.len() == other.len() && one.bytes().zip(other.bytes()).fold(0, |unlike, (a, b)| unlike | (a ^ b)) == 0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn judged(access: &Access, uri: &str, headers: &[(&str, &str)]) -> Verdict {
        let mut request = Request::builder().uri(uri);
        for (name, value) in headers {
            request = request.header(*name, *value);
        }
        access.judge(&request.body(()).expect("a request"))
    }

    fn is_refused(verdict: &Verdict) -> bool {
        matches!(verdict, Verdict::Refuse(..))
    }

    #[test]
    fn at_this_machine_its_names_enter_and_pages_of_other_sites_do_not() {
        let here = Access::of("127.0.0.1".parse().expect("an address")).expect("no key");
        let host = ("host", "127.0.0.1:8600");
        assert_eq!(judged(&here, "/", &[host]), Verdict::Enter);
        assert_eq!(judged(&here, "/ws", &[host, ("origin", "http://127.0.0.1:8600")]), Verdict::Enter);
        for origin in ["http://evil.example", "null", "http://127.0.0.1:1", "https://127.0.0.1:8600", ""] {
            assert!(is_refused(&judged(&here, "/ws", &[host, ("origin", origin)])), "{origin:?}");
        }
        assert!(is_refused(&judged(&here, "/", &[("host", "evil.example:8600")])));
        assert!(is_refused(&judged(&here, "/", &[])));
    }

    #[test]
    fn elsewhere_the_key_is_needed_once_and_is_then_a_cookie() {
        let access = Access::of("0.0.0.0".parse().expect("an address")).expect("a key");
        let Access::Key(key) = &access else { panic!("no key") };
        let host = ("host", "cell.example:8600");
        assert!(is_refused(&judged(&access, "/", &[host])));
        let Verdict::Welcome(cookie) = judged(&access, &format!("/?handeye_key={key}"), &[host]) else {
            panic!("not welcome")
        };
        assert!(cookie.contains("HttpOnly") && cookie.contains("SameSite=Strict"), "{cookie}");
        let shown = format!("other=1; handeye_key={key}");
        assert_eq!(judged(&access, "/ws", &[host, ("cookie", &shown)]), Verdict::Enter);
        let foreign = [host, ("cookie", shown.as_str()), ("origin", "http://evil.example")];
        assert!(is_refused(&judged(&access, "/ws", &foreign)));
        let wrong = "0".repeat(key.len());
        for uri in [format!("/?handeye_key={wrong}"), "/?handeye_key=".to_owned(), format!("/ws?handeye_key={key}")] {
            assert!(is_refused(&judged(&access, &uri, &[host])), "{uri}");
        }
        assert!(is_refused(&judged(&access, "/", &[host, ("cookie", &format!("handeye_key={wrong}"))])));
        let another = Access::of("0.0.0.0".parse().expect("an address")).expect("a key");
        assert!(matches!(another, Access::Key(other) if other != *key));
    }
}
