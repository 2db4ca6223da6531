//! The access to a page: the names that it answers to, and the two tokens.
//!
//! On a loopback address everybody on the machine may watch and stop the robot. On another address that needs a token. Orders besides
//! the stop need the token to drive on each address.

use std::{fmt, fs::File, io::Read as _, net::SocketAddr};

use super::options::PageError;

/// The rights of a browser.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Role {
    /// The browser may watch and stop the robot.
    Watch,
    /// The browser may do everything.
    Drive,
}

/// A secret that gives rights to its owner. It is printed once, at the start.
#[derive(Clone)]
pub struct Token(String);

impl Token {
    fn new() -> std::io::Result<Self> {
        let mut bytes = [0; 16];
        File::open("/dev/urandom")?.read_exact(&mut bytes)?;
        Ok(Self(bytes.iter().map(|byte| format!("{byte:02x}")).collect()))
    }

    /// Whether `shown` is this token, in a time that does not depend on where they differ.
    fn is(&self, shown: &str) -> bool {
        let pairs = self.0.bytes().zip(shown.bytes());
        let differing = pairs.fold(0, |differing, (one, other)| differing | (one ^ other));
        self.0.len() == shown.len() && differing == 0
    }

    /// The text of the token, to be shown to the operator alone.
    pub fn reveal(&self) -> &str {
        &self.0
    }
}

/// The debug format hides the token from logs.
impl fmt::Debug for Token {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        to.write_str("Token")
    }
}

/// The rules of one page.
#[derive(Debug)]
pub struct Access {
    /// `http` or `https`.
    scheme: &'static str,
    /// The hosts that a request may name.
    hosts: Vec<String>,
    is_loopback: bool,
    pub watch: Token,
    pub drive: Token,
}

impl Access {
    /// The rules at `address`, to which `names` lead, too.
    pub(crate) fn new(
        address: SocketAddr,
        names: &[String],
        encrypted: bool,
    ) -> Result<Self, PageError> {
        let is_loopback = address.ip().is_loopback();
        if !is_loopback && !encrypted {
            return Err(PageError::NotLoopback(address));
        }
        let mut hosts: Vec<String> = Vec::new();
        let (scheme, default_port) = if encrypted { ("https", 443) } else { ("http", 80) };
        let own = (!address.ip().is_unspecified()).then(|| match address {
            SocketAddr::V4(address) => address.ip().to_string(),
            SocketAddr::V6(address) => format!("[{}]", address.ip()),
        });
        let local = is_loopback.then(|| "localhost".to_owned());
        for name in names.iter().cloned().chain(own).chain(local) {
            hosts.push(format!("{name}:{}", address.port()));
            if address.port() == default_port {
                hosts.push(name);
            }
        }
        if hosts.is_empty() {
            return Err(PageError::NoName(address));
        }
        let (watch, drive) = (Token::new()?, Token::new()?);
        Ok(Self { scheme, hosts, is_loopback, watch, drive })
    }

    /// The address of the page for a person.
    pub fn url(&self) -> String {
        let host = self.hosts.first().map(String::as_str).unwrap_or_default();
        format!("{}://{host}/", self.scheme)
    }

    /// The name of `host` as the rules have it; none if the page does not answer to it.
    pub(crate) fn host(&self, host: &str) -> Option<&str> {
        self.hosts.iter().map(String::as_str).find(|known| *known == host)
    }

    /// Whether `origin` is that of the page at `host`.
    pub(crate) fn is_own_origin(&self, origin: &str, host: &str) -> bool {
        origin.strip_prefix(self.scheme).and_then(|rest| rest.strip_prefix("://")) == Some(host)
    }

    /// The addresses at which a page at `host` may open its websocket.
    pub(crate) fn websocket(&self, host: &str) -> String {
        let scheme = if self.scheme == "https" { "wss" } else { "ws" };
        format!("{scheme}://{host}")
    }

    /// The rights of a browser that shows `token`; none if it has no rights at all.
    pub(crate) fn role(&self, token: &str) -> Option<Role> {
        if self.drive.is(token) {
            Some(Role::Drive)
        } else if self.watch.is(token) || self.is_loopback && token.is_empty() {
            Some(Role::Watch)
        } else {
            None
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn access(address: &str, names: &[&str], encrypted: bool) -> Result<Access, PageError> {
        let names: Vec<_> = names.iter().map(|name| (*name).to_owned()).collect();
        Access::new(address.parse().unwrap(), &names, encrypted)
    }

    #[test]
    fn another_address_than_loopback_needs_encryption_and_a_name() {
        for address in ["192.168.0.7:8080", "0.0.0.0:8080", "[::]:8080", "[fe80::1]:8080"] {
            let refused = access(address, &[], false);
            assert!(matches!(refused, Err(PageError::NotLoopback(_))), "{address}");
        }
        assert!(matches!(access("0.0.0.0:8080", &[], true), Err(PageError::NoName(_))));
        assert!(access("0.0.0.0:8080", &["robot.local"], true).is_ok());
        assert!(access("[::1]:8080", &[], false).is_ok());
    }

    #[test]
    fn only_the_names_of_the_page_and_its_own_origin_are_accepted() {
        let own = access("127.0.0.1:8080", &[], false).unwrap();
        assert!(own.host("127.0.0.1:8080").is_some() && own.host("localhost:8080").is_some());
        for host in ["127.0.0.1", "localhost:80", "evil.example:8080", "127.0.0.1:8080.evil", ""] {
            assert!(own.host(host).is_none(), "{host}");
        }
        let at = "localhost:8080";
        assert!(own.is_own_origin("http://localhost:8080", at));
        for origin in [
            "null",
            "",
            "https://localhost:8080",
            "http://127.0.0.1:8080",
            "http://localhost:8080/",
        ] {
            assert!(!own.is_own_origin(origin, at), "{origin}");
        }
    }

    #[test]
    fn a_token_opens_what_it_is_for_and_no_token_only_watches_on_loopback() {
        let own = access("127.0.0.1:8080", &[], false).unwrap();
        assert_eq!(own.role(""), Some(Role::Watch));
        assert_eq!(own.role(own.watch.reveal()), Some(Role::Watch));
        assert_eq!(own.role(own.drive.reveal()), Some(Role::Drive));
        let earlier = access("127.0.0.1:8080", &[], false).unwrap();
        assert_eq!(own.role(earlier.drive.reveal()), None, "a token of an earlier page");
        assert_eq!(own.role(&own.drive.reveal()[1..]), None);
        let far = access("192.168.0.7:8080", &[], true).unwrap();
        assert_eq!(far.role(""), None);
        assert!(!format!("{far:?}").contains(far.drive.reveal()));
    }
}
