use std::{
    fmt, io,
    net::{SocketAddr, ToSocketAddrs},
    num::NonZeroU16,
    path::PathBuf,
    str::FromStr,
};

use serde::{Deserialize, Deserializer, Serialize, Serializer, de};
use thiserror::Error;

pub const FORMS: &str = "give \"host:port\", \"udp://host:port\", \"tcp://host:port\", \"serial:///dev/ttyUSB0\" or \"ros2:DOMAIN\"";

/// Robot address; `Host` is text in a mission and a socket address once resolved.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Address<Host = SocketAddr> {
    /// The default: `host:port` or `udp://host:port`.
    Udp(Host),
    /// `tcp://host:port`.
    Tcp(Host),
    /// Serial line, 8N1, with 115200 baud or the mission's `robot.arduino.baud`:
    /// `serial:///dev/ttyUSB0`.
    Serial(PathBuf),
    /// ROS 2 domain: `ros2:0`, or `ros2` for the one in `ROS_DOMAIN_ID`, by default 0.
    Ros2(Option<u16>),
}

/// Greatest domain with valid ports.
const LAST_DOMAIN: u16 = 232;

fn domain(text: &str) -> Option<u16> {
    text.parse().ok().filter(|domain| *domain <= LAST_DOMAIN)
}

#[derive(Debug, Error)]
pub enum AddressError {
    #[error("{address:?} {problem}; {FORMS}")]
    Form { address: String, problem: &'static str },
    #[error(
        "cannot resolve the host of {address:?}: {source}; give its IP address, or a name that this machine resolves"
    )]
    Host { address: String, source: io::Error },
}

impl<Host: fmt::Display> fmt::Display for Address<Host> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Udp(host) => write!(f, "udp://{host}"),
            Self::Tcp(host) => write!(f, "tcp://{host}"),
            Self::Serial(path) => write!(f, "serial://{}", path.display()),
            Self::Ros2(Some(domain)) => write!(f, "ros2:{domain}"),
            Self::Ros2(None) => f.write_str("ros2"),
        }
    }
}

impl FromStr for Address<String> {
    type Err = AddressError;

    fn from_str(address: &str) -> Result<Self, AddressError> {
        let refused = |problem| AddressError::Form { address: address.to_owned(), problem };
        if address == "ros2" {
            return Ok(Self::Ros2(None));
        }
        if let Some(text) = address.strip_prefix("ros2:") {
            let domain = domain(text.strip_prefix("//").unwrap_or(text));
            let domain = domain.ok_or_else(|| refused("has no ROS domain from 0 to 232"))?;
            return Ok(Self::Ros2(Some(domain)));
        }
        let (over, rest) = address.split_once("://").unwrap_or(("udp", address));
        if over == "serial" {
            return if rest.starts_with('/') {
                Ok(Self::Serial(rest.into()))
            } else {
                Err(refused("lacks the absolute path of a device"))
            };
        }
        let (host, port) = rest.rsplit_once(':').ok_or_else(|| refused("has no port"))?;
        if port.parse::<NonZeroU16>().is_err() {
            return Err(refused("has no port from 1 to 65535"));
        }
        let bracketed = host.starts_with('[') && host.ends_with(']');
        let plain = |c: char| !c.is_whitespace() && c != '/' && (c != ':' || bracketed);
        if host.is_empty() || !host.chars().all(plain) {
            return Err(refused("has no valid host"));
        }
        match over {
            "udp" => Ok(Self::Udp(rest.to_owned())),
            "tcp" => Ok(Self::Tcp(rest.to_owned())),
            _ => Err(refused("has an unknown transport")),
        }
    }
}

impl Address<String> {
    /// Resolves the host, which may take seconds; fails for an unknown host.
    pub fn resolve(&self) -> Result<Address, AddressError> {
        let number = |host: &String| {
            let unknown = |source| AddressError::Host { address: self.to_string(), source };
            let mut found = host.to_socket_addrs().map_err(unknown)?;
            found.next().ok_or_else(|| {
                unknown(io::Error::new(io::ErrorKind::NotFound, "the name has no IP address"))
            })
        };
        Ok(match self {
            Self::Udp(host) => Address::Udp(number(host)?),
            Self::Tcp(host) => Address::Tcp(number(host)?),
            Self::Serial(path) => Address::Serial(path.clone()),
            Self::Ros2(domain) => {
                Address::Ros2(Some(domain.map_or_else(domain_of_environment, Ok)?))
            }
        })
    }
}

/// From `ROS_DOMAIN_ID`, by default 0.
pub fn domain_of_environment() -> Result<u16, AddressError> {
    let Some(text) = std::env::var_os("ROS_DOMAIN_ID").filter(|text| !text.is_empty()) else {
        return Ok(0);
    };
    text.to_str().and_then(domain).ok_or_else(|| AddressError::Form {
        address: format!("ROS_DOMAIN_ID={}", text.display()),
        problem: "has no ROS domain from 0 to 232",
    })
}

impl Serialize for Address {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for Address {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = String::deserialize(deserializer)?;
        let number = |host: String| host.parse().map_err(de::Error::custom);
        match text.parse().map_err(de::Error::custom)? {
            Address::Udp(host) => number(host).map(Self::Udp),
            Address::Tcp(host) => number(host).map(Self::Tcp),
            Address::Serial(path) => Ok(Self::Serial(path)),
            Address::Ros2(domain) => Ok(Self::Ros2(domain)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_form_is_read_and_datagrams_are_the_default() {
        use Address::{Ros2, Serial, Tcp, Udp};
        for (text, address) in [
            ("192.168.0.201:10001", Udp("192.168.0.201:10001".to_owned())),
            ("udp://192.168.0.201:10001", Udp("192.168.0.201:10001".to_owned())),
            ("tcp://192.168.0.201:10001", Tcp("192.168.0.201:10001".to_owned())),
            ("tcp://[::1]:7", Tcp("[::1]:7".to_owned())),
            ("x80.local:7", Udp("x80.local:7".to_owned())),
            ("ros2", Ros2(None)),
            ("ros2:7", Ros2(Some(7))),
            ("ros2://7", Ros2(Some(7))),
            ("ros2.local:7", Udp("ros2.local:7".to_owned())),
            ("serial:///dev/ttyUSB0", Serial("/dev/ttyUSB0".into())),
        ] {
            assert_eq!(text.parse::<Address<String>>().unwrap(), address);
        }
    }

    #[test]
    fn what_is_no_address_is_named_with_the_forms_there_are() {
        let bad = "|not an address|192.168.0.201|host:0|host:99999|:10001|two hosts:1|::1:7|http://host:80|udp://host|tcp://host:1/path|serial://ttyUSB0|serial://|ros2:|ros2:233|ros2:-1";
        for bad in bad.split('|') {
            let error = bad.parse::<Address<String>>().unwrap_err().to_string();
            let named = error.contains(&format!("{bad:?}")) && error.contains(FORMS);
            assert!(named, "{bad:?} gave {error:?}");
        }
    }

    #[test]
    fn a_resolved_address_survives_the_run_file() {
        #[derive(Debug, PartialEq, Serialize, Deserialize)]
        struct File {
            address: Address,
        }
        for text in ["udp://127.0.0.1:1", "tcp://[::1]:2", "serial:///dev/pts/3", "ros2:42"] {
            let address = text.parse::<Address<String>>().unwrap().resolve().unwrap();
            let file = File { address };
            let written = toml::to_string(&file).unwrap();
            assert!(written.contains(text), "{written}");
            assert_eq!(toml::from_str::<File>(&written).unwrap(), file);
        }
    }
}
