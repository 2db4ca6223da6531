//! Access to a page: accepted host names, and two tokens. Other users of this machine can reach
//! loopback, so watching needs a token. Orders except the stop need the token to drive.

use std::{
    fmt,
    fs::File,
    io::{self, Read as _},
    net::SocketAddr,
};

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Role {
    Watch,
    Drive,
}

/// Secret that grants rights to its owner.
pub struct Token(String);

impl Token {
    fn new() -> io::Result<Self> {
        let mut bytes = [0; 16];
        File::open("/dev/urandom")?.read_exact(&mut bytes)?;
        Ok(Self(bytes.iter().map(|byte| format!("{byte:02x}")).collect()))
    }

    /// Compares in constant time for equal lengths.
    fn is(&self, shown: &str) -> bool {
        let differing = self
            .0
            .bytes()
            .zip(shown.bytes())
            .fold(0, |differing, (one, other)| differing | (one ^ other));
        self.0.len() == shown.len() && differing == 0
    }
}

/// Hides the token from logs.
impl fmt::Debug for Token {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        to.write_str("Token")
    }
}

#[derive(Debug)]
pub struct Access {
    scheme: &'static str,
    hosts: Vec<String>,
    pub watch: Token,
    pub drive: Token,
}

impl Access {
    /// # Errors
    /// The system gives no random bytes for tokens.
    pub fn new(address: SocketAddr, proxy: Option<&str>) -> io::Result<Self> {
        let hosts = match (proxy, address.port()) {
            (Some(name), _) => vec![name.to_owned()],
            // Browsers omit the default port.
            (None, 80) => vec![address.ip().to_string(), "localhost".to_owned()],
            (None, port) => vec![address.to_string(), format!("localhost:{port}")],
        };
        let scheme = if proxy.is_some() { "https" } else { "http" };
        Ok(Self { scheme, hosts, watch: Token::new()?, drive: Token::new()? })
    }

    /// For the operator alone.
    pub fn addresses(&self) -> String {
        let host = self.hosts.first().map(String::as_str).unwrap_or_default();
        let line =
            |role, Token(token): &Token| format!("{role} {}://{host}/#{token}\n", self.scheme);
        line("watch", &self.watch) + &line("drive", &self.drive)
    }

    pub fn host(&self, host: &str) -> Option<&str> {
        self.hosts.iter().map(String::as_str).find(|known| *known == host)
    }

    pub fn is_own_origin(&self, origin: &str, host: &str) -> bool {
        origin == format!("{}://{host}", self.scheme)
    }

    pub fn websocket(&self, host: &str) -> String {
        let scheme = if self.scheme == "https" { "wss" } else { "ws" };
        format!("{scheme}://{host}")
    }

    pub fn role(&self, token: &str) -> Option<Role> {
        if self.drive.is(token) {
            Some(Role::Drive)
        } else {
            self.watch.is(token).then_some(Role::Watch)
        }
    }
}

/// Parses a host name with an optional port. Restricts its letters for headers.
///
/// # Errors
/// `text` is not a host name.
pub fn host_name(text: &str) -> Result<String, String> {
    let is_letter = |letter: char| letter.is_ascii_alphanumeric() || "-.:[]".contains(letter);
    if !text.is_empty() && text.chars().all(is_letter) {
        Ok(text.to_ascii_lowercase())
    } else {
        Err("not a host name; give one such as robot.example or robot.example:8443".to_owned())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    impl Token {
        pub fn reveal(&self) -> &str {
            &self.0
        }
    }

    #[test]
    fn a_proxys_name_is_a_host_and_perhaps_a_port() {
        for name in ["", "robot.example/x", "a;script-src *", "a b", "a\"b"] {
            assert!(host_name(name).is_err(), "{name}");
        }
        assert_eq!(host_name("Robot.example:8443").unwrap(), "robot.example:8443");
    }
}
