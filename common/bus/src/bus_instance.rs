//! Names of one bus instance. A recreated bus has its own files, so late leavers of the old bus
//! cannot delete new ones.
//!
//! The robot's directory holds each instance's configuration, and a link to the current one.

use std::{
    fs,
    hash::{BuildHasher as _, RandomState},
    io,
    os::unix::fs::symlink,
    path::{Path, PathBuf},
};

use crate::domain::{Domain, SHARED_MEMORY};

const CONFIG: [&str; 2] = ["iceoryx2-", ".toml"];
/// Length of an instance's name. Linux limits socket paths, which contain it twice.
const LENGTH: usize = 4;
pub const VERSION: &str = env!("CARGO_PKG_VERSION");
/// Start of a configuration, before the supervisor's version.
const MADE_BY: &str = "# firsthand ";
const LETTERS: &[u8; 32] = b"abcdefghijkmnpqrstuvwxyz23456789";

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BusInstance {
    pub domain: Domain,
    name: String,
}

impl BusInstance {
    /// Creates an instance. Its random name keeps others from creating its files beforehand.
    pub fn new(domain: &Domain) -> Self {
        let mut random = RandomState::new().hash_one(std::process::id());
        let name = (0..LENGTH).map(|_| {
            let letter = LETTERS[(random % 32) as usize];
            random /= 32;
            char::from(letter)
        });
        Self { domain: domain.clone(), name: name.collect() }
    }

    /// Fails if the robot has no bus.
    pub fn current(domain: &Domain) -> io::Result<Self> {
        let link = domain.middleware_config();
        let config = fs::read_link(&link)?;
        let name = config.to_str().and_then(|file| {
            let name = file.strip_prefix(CONFIG[0])?.strip_suffix(CONFIG[1])?;
            let known = |byte| LETTERS.contains(&byte);
            (name.len() == LENGTH && name.bytes().all(known)).then_some(name)
        });
        let name = name.ok_or_else(|| {
            let link = link.display();
            let config = config.display();
            let text = format!("{link} points to {config}, whose name is invalid for a bus configuration; start the robot again");
            io::Error::new(io::ErrorKind::InvalidData, text)
        })?;
        Ok(Self { domain: domain.clone(), name: name.to_owned() })
    }

    pub fn make_current(&self) -> io::Result<()> {
        let link = self.domain.middleware_config();
        let unfinished = link.with_extension("unfinished");
        symlink(self.config_name(), &unfinished)?;
        fs::rename(unfinished, link)
    }

    fn config_name(&self) -> String {
        CONFIG.join(&self.name)
    }

    pub fn config(&self) -> PathBuf {
        self.domain.directory().join(self.config_name())
    }

    pub(crate) fn config_text(settings: &str) -> String {
        format!("{MADE_BY}{VERSION}\n{settings}")
    }

    /// Returns the version that made the bus if it is incompatible with this program.
    pub(crate) fn made_by_another(&self) -> io::Result<Option<String>> {
        let config = fs::read_to_string(self.config())?;
        let made_by = config.lines().next().and_then(|line| line.strip_prefix(MADE_BY));
        let made_by = made_by.unwrap_or("from before 0.1.0");
        Ok((series(made_by) != series(VERSION)).then(|| made_by.to_owned()))
    }

    pub fn shared_memory_prefix(&self) -> String {
        format!("{}{}_", self.domain.shared_memory_prefix(), self.name)
    }

    /// Returns the directory of the middleware's files. It is in shared memory because the
    /// middleware syncs each file, and a starting stage creates twenty.
    pub fn root(&self) -> PathBuf {
        Path::new(SHARED_MEMORY).join(self.domain.shared_memory_prefix() + &self.name)
    }
}

/// Returns the version without the numbers that compatible programs may differ in: the last before
/// 1.0, all after the major from then on.
fn series(version: &str) -> (Option<&str>, Option<&str>) {
    let mut numbers = version.split('.');
    let major = numbers.next();
    (major, numbers.next().filter(|_| major == Some("0")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::DirBuilderExt as _;

    #[test]
    fn versions_meet_that_differ_in_the_last_number_and_from_1_0_in_the_last_two() {
        assert_eq!(series("0.1.0"), series("0.1.12"));
        assert_eq!(series("1.2.0"), series("1.3.4"));
        assert_ne!(series("0.1.0"), series("0.2.0"));
        assert_ne!(series("1.2.0"), series("2.2.0"));
        assert_ne!(series("0.1.0"), series("1.1.0"));
    }

    #[test]
    fn the_bus_that_is_there_is_the_one_made_last() {
        let domain = Domain::of(format!("link-{}", std::process::id()).parse().unwrap());
        let mut own = fs::DirBuilder::new();
        own.recursive(true).mode(0o700).create(domain.directory()).unwrap();
        assert!(BusInstance::current(&domain).is_err());
        for _ in 0..2 {
            let made = BusInstance::new(&domain);
            made.make_current().unwrap();
            assert_eq!(BusInstance::current(&domain).unwrap(), made);
        }
        fs::remove_file(domain.middleware_config()).unwrap();
        symlink("../../etc/passwd", domain.middleware_config()).unwrap();
        let foreign = BusInstance::current(&domain).unwrap_err();
        assert!(foreign.to_string().contains("passwd"), "{foreign}");
        fs::remove_dir_all(domain.directory()).unwrap();
    }
}
