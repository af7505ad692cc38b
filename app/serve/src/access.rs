//! Access control.
//!
//! At 127.0.0.1 every user of this machine has access, under a host name of this machine, as for the desktop window. At
//! any other address access needs the key, which is part of the address that is printed at the start: the browser gets it
//! as a cookie and sends it to no other site. Guessing is rate limited. In either case pages of other sites are refused.

use std::io;
use std::net::{IpAddr, Ipv4Addr, SocketAddr, UdpSocket};
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

use axum::http::header::{COOKIE, HOST, ORIGIN};
use axum::http::{Request, StatusCode};

use super::guesses::{Guesses, Look};
use handeye_http::names;

/// Name of the cookie and of the key in the first address.
const KEY: &str = "handeye_key";

/// What browsers send about a request: how the site of the page is related to the requested one, the mode, and the
/// destination.
const SITE: &str = "sec-fetch-site";
const MODE: &str = "sec-fetch-mode";
const DEST: &str = "sec-fetch-dest";

/// Why a request is refused.
pub const REFUSED: &str = "Open the address that `handeye serve` printed: it has the key in it.\n";

/// Too many keys were wrong.
pub const GUESSED: &str = "Too many wrong keys came from this address: wait for a minute.\n";

/// A page of another site.
pub const FOREIGN: &str = "This is asked for by a page of another site.\n";

/// Who has access.
#[derive(Debug)]
pub enum Access {
    /// Every user of this machine.
    Here,
    /// Everyone with the key.
    Key {
        key: String,
        /// Wrong keys so far.
        guesses: Mutex<Guesses>,
    },
}

/// The outcome of a request.
#[derive(Debug, PartialEq, Eq)]
pub enum Verdict {
    /// It is answered.
    Enter,
    /// The key is in its address: it becomes this cookie.
    Welcome(String),
    /// It is refused.
    Refuse(StatusCode, &'static str),
}

impl Access {
    /// The access for an address.
    ///
    /// # Errors
    /// When the system has no random numbers for a key.
    pub fn of(bind: IpAddr) -> io::Result<Self> {
        if bind.is_loopback() {
            return Ok(Self::Here);
        }
        let mut key = [0; 16];
        getrandom::fill(&mut key).map_err(io::Error::other)?;
        Ok(Self::Key { key: format!("{:032x}", u128::from_be_bytes(key)), guesses: Mutex::default() })
    }

    /// The address that the user opens.
    pub fn url(&self, address: SocketAddr) -> String {
        let address = named(address);
        match self {
            Self::Here => format!("http://{address}/"),
            Self::Key { key, .. } => format!("http://{address}/?{KEY}={key}"),
        }
    }

    /// The outcome of a request that comes from an address now.
    pub fn judge<B>(&self, request: &Request<B>, from: IpAddr, now: Instant) -> Verdict {
        if !is_of_this_site(request) {
            return Verdict::Refuse(StatusCode::FORBIDDEN, FOREIGN);
        }
        match self {
            Self::Here if names::are_of_this_machine(request) => Verdict::Enter,
            Self::Here => Verdict::Refuse(StatusCode::FORBIDDEN, names::REFUSAL),
            Self::Key { key, guesses } => {
                let welcome = || Verdict::Welcome(format!("{KEY}={key}; HttpOnly; SameSite=Strict; Path=/"));
                let mut guesses = guesses.lock().unwrap_or_else(PoisonError::into_inner);
                let mut look = |shown: &str| {
                    if shown.len() == key.len() {
                        guesses.look(shown, from, now, |shown| is_same(shown, key))
                    } else {
                        // Nothing is revealed, and nothing is stored about it.
                        Look::Wrong
                    }
                };
                match in_cookies(request).map_or(Look::Wrong, &mut look) {
                    Look::Right => return Verdict::Enter,
                    Look::Late => return Verdict::Refuse(StatusCode::TOO_MANY_REQUESTS, GUESSED),
                    Look::Wrong => {}
                }
                match in_address(request).map_or(Look::Wrong, &mut look) {
                    Look::Right => welcome(),
                    Look::Late => Verdict::Refuse(StatusCode::TOO_MANY_REQUESTS, GUESSED),
                    Look::Wrong => Verdict::Refuse(StatusCode::UNAUTHORIZED, REFUSED),
                }
            }
        }
    }
}

/// The key that a browser has as a cookie.
fn in_cookies<B>(request: &Request<B>) -> Option<&str> {
    let cookies = request.headers().get_all(COOKIE).iter().filter_map(|cookies| cookies.to_str().ok());
    let mut shown = cookies.flat_map(|cookies| cookies.split(';')).filter_map(|cookie| cookie.trim().split_once('='));
    shown.find(|(name, _)| *name == KEY).map(|(_, value)| value)
}

/// The key in the printed address.
fn in_address<B>(request: &Request<B>) -> Option<&str> {
    let query = request.uri().query().filter(|_| request.uri().path() == "/")?;
    query.split('&').filter_map(|pair| pair.split_once('=')).find(|(name, _)| *name == KEY).map(|(_, value)| value)
}

/// An address that others can use: an unspecified one is replaced by the machine's address in the network.
fn named(address: SocketAddr) -> SocketAddr {
    if !address.ip().is_unspecified() {
        return address;
    }
    // Connecting sends nothing here: it only selects the route to an address, which nobody uses.
    let own = UdpSocket::bind((Ipv4Addr::UNSPECIFIED, 0)).and_then(|socket| {
        socket.connect((Ipv4Addr::new(192, 0, 2, 1), 9))?;
        socket.local_addr()
    });
    SocketAddr::new(own.map_or(IpAddr::V4(Ipv4Addr::LOCALHOST), |own| own.ip()), address.port())
}

/// Whether a request comes from a page of the same server that it goes to, or from no page. A browser sends the origin of
/// the page with everything but plain reading; for that as well it sends, on this machine, how the two sites are related.
/// A link on another page may lead to ours: what opens is seen by the user, and cannot be read by the other page.
fn is_of_this_site<B>(request: &Request<B>) -> bool {
    let headers = request.headers();
    let is_only = |name: &str, values: &[&str]| {
        headers.get_all(name).iter().all(|value| values.iter().any(|wanted| value.as_bytes() == wanted.as_bytes()))
    };
    let is_opened = || request.uri().path() == "/" && headers.contains_key(MODE) && headers.contains_key(DEST);
    let is_related = is_only(SITE, &["same-origin", "none"])
        || (is_opened() && is_only(MODE, &["navigate"]) && is_only(DEST, &["document"]));
    if !is_related {
        return false;
    }
    let Some(host) = request.headers().get(HOST) else {
        return request.headers().get(ORIGIN).is_none();
    };
    request.headers().get_all(ORIGIN).iter().all(|origin| {
        let authority = origin.to_str().ok().and_then(|origin| origin.strip_prefix("http://"));
        authority.is_some_and(|authority| authority.as_bytes().eq_ignore_ascii_case(host.as_bytes()))
    })
}

/// Whether two texts are equal, in a time that does not reveal how much of them is.
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
        access.judge(&request.body(()).expect("a request"), IpAddr::V4(Ipv4Addr::LOCALHOST), Instant::now())
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
    fn what_another_site_asks_for_is_refused_on_every_path_but_for_a_link_to_the_page() {
        let here = Access::of("127.0.0.1".parse().expect("an address")).expect("no key");
        let host = ("host", "127.0.0.1:8600");
        let asked = |uri: &str, site: &str, mode: &str, dest: &str| {
            let headers = [host, (SITE, site), (MODE, mode), (DEST, dest)];
            judged(&here, uri, &headers)
        };
        for uri in ["/", "/download?folder=/home/me", "/client.js", "/rerun/", "/socket?page=x", "/upload/a/b"] {
            for site in ["same-origin", "none"] {
                assert_eq!(asked(uri, site, "no-cors", "image"), Verdict::Enter, "{uri} {site}");
            }
            for site in ["cross-site", "same-site", "whatever", ""] {
                assert!(is_refused(&asked(uri, site, "no-cors", "image")), "{uri} {site}");
                assert!(is_refused(&asked(uri, site, "navigate", "iframe")), "{uri} {site}");
                let link = asked(uri, site, "navigate", "document");
                assert_eq!(link == Verdict::Enter, uri == "/", "{uri} {site}");
            }
        }
        assert!(is_refused(&judged(&here, "/", &[host, (SITE, "cross-site")])), "it does not say what for");
        assert!(is_refused(&judged(&here, "/", &[host, (SITE, "none"), (SITE, "cross-site")])), "it says both");
    }

    #[test]
    fn elsewhere_the_key_is_needed_once_and_is_then_a_cookie() {
        let access = Access::of("0.0.0.0".parse().expect("an address")).expect("a key");
        let Access::Key { key, .. } = &access else { panic!("no key") };
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
        assert!(matches!(another, Access::Key { key: other, .. } if other != *key));
    }

    #[test]
    fn who_guesses_waits_and_who_comes_back_with_an_old_key_is_let_in_with_the_new_one() {
        let access = Access::of("0.0.0.0".parse().expect("an address")).expect("a key");
        let Access::Key { key, .. } = &access else { panic!("no key") };
        let began = Instant::now();
        let judged = |from: &str, key: &str| {
            let request = Request::builder().uri(format!("/?handeye_key={key}")).header("host", "cell.example:8600");
            access.judge(&request.body(()).expect("a request"), from.parse().expect("an address"), began)
        };
        // A page that was left open keeps sending yesterday's key.
        for _ in 0..1000 {
            assert_eq!(judged("10.0.0.7", &"a".repeat(32)), Verdict::Refuse(StatusCode::UNAUTHORIZED, REFUSED));
        }
        assert!(matches!(judged("10.0.0.7", key), Verdict::Welcome(_)));
        let answers: Vec<_> = (0..100).map(|number| judged("10.0.0.8", &format!("{number:032x}"))).collect();
        let refused = Verdict::Refuse(StatusCode::TOO_MANY_REQUESTS, GUESSED);
        assert!(answers.iter().filter(|answer| **answer == refused).count() >= 80, "{answers:?}");
        assert_eq!(judged("10.0.0.8", key), refused, "nothing is learnt while one waits");
        assert!(matches!(judged("10.0.0.7", key), Verdict::Welcome(_)), "nobody else waits");
    }
}
