//! The names of one bus instance. A recreated bus has its own files, so a process that leaves the old bus late cannot delete files
//! of the new one.
//!
//! The robot's directory holds the configuration of each instance, and a link to the configuration of the current one.

use std::{
    fs,
    hash::{BuildHasher as _, RandomState},
    io,
    os::unix::fs::symlink,
    path::{Path, PathBuf},
};

use crate::domain::{Domain, SHARED_MEMORY};

/// The file name of a configuration is the instance's name between these two.
const CONFIG: [&str; 2] = ["iceoryx2-", ".toml"];
/// The length of an instance's name. Paths of sockets contain the name twice, and Linux limits their length.
const LENGTH: usize = 4;
/// The version of firsthand that this program is of.
pub const VERSION: &str = env!("CARGO_PKG_VERSION");
/// A configuration begins with it and the version of the supervisor that made the bus.
const MADE_BY: &str = "# firsthand ";
const LETTERS: &[u8; 32] = b"abcdefghijkmnpqrstuvwxyz23456789";

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BusInstance {
    pub domain: Domain,
    name: String,
}

impl BusInstance {
    /// A new instance. Its name is random, so nobody can create its files beforehand.
    pub fn new(domain: &Domain) -> Self {
        let mut random = RandomState::new().hash_one(std::process::id());
        let name = (0..LENGTH).map(|_| {
            let letter = LETTERS[(random % 32) as usize];
            random /= 32;
            char::from(letter)
        });
        Self { domain: domain.clone(), name: name.collect() }
    }

    /// The instance that processes join now; an error if the robot has no bus.
    pub fn current(domain: &Domain) -> io::Result<Self> {
        let link = domain.middleware_config();
        let config = fs::read_link(&link)?;
        let name = config.to_str().and_then(|file| {
            let name = file.strip_prefix(CONFIG[0])?.strip_suffix(CONFIG[1])?;
            let known = |byte| LETTERS.contains(&byte);
            (name.len() == LENGTH && name.bytes().all(known)).then_some(name)
        });
        let name = name.ok_or_else(|| {
            let (link, config) = (link.display(), config.display());
            let text = format!("{link} leads to {config}, which is no configuration of a bus");
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

    /// The middleware's `settings` as the text of a configuration.
    pub(crate) fn config_text(settings: &str) -> String {
        format!("{MADE_BY}{VERSION}\n{settings}")
    }

    /// The version that made the bus if this program must not join it.
    pub(crate) fn made_by_another(&self) -> io::Result<Option<String>> {
        let config = fs::read_to_string(self.config())?;
        let made_by = config.lines().next().and_then(|line| line.strip_prefix(MADE_BY));
        let made_by = made_by.unwrap_or("of before 0.1.0");
        Ok((series(made_by) != series(VERSION)).then(|| made_by.to_owned()))
    }

    /// The names of all files of this instance in [`SHARED_MEMORY`] start with this prefix.
    pub fn shared_memory_prefix(&self) -> String {
        format!("{}{}_", self.domain.shared_memory_prefix(), self.name)
    }

    /// The directory of the middleware's node and service files. It is in shared memory because the middleware syncs each file to
    /// the disk, and a stage that starts creates twenty.
    pub fn root(&self) -> PathBuf {
        Path::new(SHARED_MEMORY).join(self.domain.shared_memory_prefix() + &self.name)
    }
}

/// A version without what may differ between two that understand each other, which before 1.0 is its last number.
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
