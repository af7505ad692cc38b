//! Host names and origins of requests: names of this machine and nothing else.
//!
//! A foreign page can make its own name resolve to 127.0.0.1 (DNS rebinding). The browser then lets it read responses from
//! here, because it takes both for one site; only the name in the request reveals it. A numeric address cannot be
//! redirected.

use std::net::IpAddr;

use axum::http::header::{HOST, HeaderValue, ORIGIN};
use axum::http::uri::Authority;
use axum::http::{Request, Uri};

/// The response to a request under another name.
pub const REFUSAL: &str = "This is served for this machine only: ask for it as 127.0.0.1 or localhost, and from a page of \
                           this machine.\n";

/// Whether a request uses one of this machine's own names and does not come from a page of another machine.
pub fn are_of_this_machine<B>(request: &Request<B>) -> bool {
    let headers = request.headers();
    // HTTP/2 and proxies put the name in the address, HTTP/1 in a header; if both are present both have to be right.
    let address = request.uri().authority().map(|authority| is_here(authority.host()));
    let asked: Vec<bool> = address.into_iter().chain(headers.get_all(HOST).iter().map(is_host_here)).collect();
    !asked.is_empty() && asked.into_iter().all(|here| here) && headers.get_all(ORIGIN).iter().all(is_origin_here)
}

fn is_host_here(host: &HeaderValue) -> bool {
    let authority = host.to_str().ok().and_then(|host| host.parse::<Authority>().ok());
    authority.is_some_and(|authority| !authority.as_str().contains('@') && is_here(authority.host()))
}

/// A page sends its origin; `null` may be from anywhere.
fn is_origin_here(origin: &HeaderValue) -> bool {
    let uri = origin.to_str().ok().and_then(|origin| origin.parse::<Uri>().ok());
    uri.is_some_and(|uri| matches!(uri.scheme_str(), Some("http" | "https")) && uri.host().is_some_and(is_here))
}

fn is_here(host: &str) -> bool {
    let plain = host.strip_prefix('[').and_then(|host| host.strip_suffix(']')).unwrap_or(host);
    plain.eq_ignore_ascii_case("localhost") || plain.parse::<IpAddr>().is_ok_and(|address| address.is_loopback())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn asked(uri: &str, headers: &[(&str, &str)]) -> bool {
        let mut request = Request::builder().uri(uri);
        for (name, value) in headers {
            request = request.header(*name, *value);
        }
        are_of_this_machine(&request.body(()).expect("a request"))
    }

    #[test]
    fn names_of_this_machine_are_served() {
        for host in ["127.0.0.1:9876", "127.0.0.1", "localhost:1", "LocalHost", "[::1]:80", "[::1]", "127.8.9.1:5"] {
            assert!(asked("/", &[("host", host)]), "{host}");
            assert!(asked(&format!("http://{host}/a"), &[]), "HTTP/2: {host}");
        }
        for origin in ["http://127.0.0.1:3000", "http://localhost", "https://[::1]:1"] {
            assert!(asked("/", &[("host", "127.0.0.1:1"), ("origin", origin)]), "{origin}");
        }
    }

    #[test]
    fn other_names_are_not() {
        let hosts =
            ["evil.example", "evil.example:9876", "127.0.0.1.evil.example", "localhost.evil.example", "", "0.0.0.0"];
        for host in
            hosts.into_iter().chain(["10.0.0.1", "evil@127.0.0.1", "127.0.0.1@evil.example", "[::2]", "2130706433"])
        {
            assert!(!asked("/", &[("host", host)]), "{host:?}");
        }
        assert!(!asked("/", &[]), "no name at all");
        assert!(!asked("http://evil.example/", &[]), "HTTP/2");
        assert!(!asked("http://evil.example/", &[("host", "127.0.0.1")]), "one of two names");
        assert!(!asked("http://127.0.0.1/", &[("host", "evil.example")]), "the other of two names");
        assert!(!asked("/", &[("host", "127.0.0.1"), ("host", "evil.example")]), "one of two headers");
        for origin in
            ["http://evil.example", "null", "http://127.0.0.1.evil.example", "https://rerun.io", "file://", ""]
        {
            assert!(!asked("/", &[("host", "127.0.0.1:1"), ("origin", origin)]), "{origin:?}");
        }
    }
}
