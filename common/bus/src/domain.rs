//! Robot's domain on this machine: its name, runtime directory and shared memory prefix. Robots
//! share none of these, nor locks and services.

use std::{
    env, fmt,
    fs::{self, File, TryLockError},
    io::{self, ErrorKind::NotFound, Read as _},
    os::unix::fs::MetadataExt as _,
    path::{Path, PathBuf},
    str::FromStr,
    sync::OnceLock,
    thread,
    time::{Duration, Instant},
};

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::{claim, lock_holders::has_open, machine};

/// Name of a robot and its domain: 1 to 16 of a-z, 0-9 and `-`.
///
/// Linux limits the length of socket paths. Without `_`, no domain's shared memory prefix starts
/// with another's.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(try_from = "String")]
pub struct RobotName(String);

#[derive(Debug, Error)]
#[error("{0:?} cannot name a robot; use 1 to 16 characters of a-z, 0-9 and '-'")]
pub struct RobotNameError(String);

impl FromStr for RobotName {
    type Err = RobotNameError;

    fn from_str(text: &str) -> Result<Self, RobotNameError> {
        let allowed = |byte: u8| matches!(byte, b'a'..=b'z' | b'0'..=b'9' | b'-');
        if (1..=16).contains(&text.len()) && text.bytes().all(allowed) {
            Ok(Self(text.to_owned()))
        } else {
            Err(RobotNameError(text.to_owned()))
        }
    }
}

impl Default for RobotName {
    fn default() -> Self {
        Self("x80".to_owned())
    }
}

impl TryFrom<String> for RobotName {
    type Error = RobotNameError;

    fn try_from(text: String) -> Result<Self, RobotNameError> {
        text.parse()
    }
}

impl RobotName {
    pub fn domain(&self) -> Domain {
        Domain::of(self.clone())
    }
}

impl fmt::Display for RobotName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

pub const SHARED_MEMORY: &str = "/dev/shm";

/// Wait for a supervisor that recreates its directory. It checks five times a second, on a starved
/// machine less often.
const MADE_AGAIN: Duration = Duration::from_secs(10);
const LOOK_EVERY: Duration = Duration::from_millis(10);

/// Names of one robot's files on this machine, for one user.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Domain {
    pub robot: RobotName,
    /// User number, or the letters of a test suite.
    owner: String,
    directory: PathBuf,
}

impl Domain {
    pub fn of(robot: RobotName) -> Self {
        if machine::is_simulated() {
            let directory = Path::new("/simulation").join(&robot.0);
            return Self { robot, owner: String::new(), directory };
        }
        let user = rustix::process::geteuid().as_raw();
        let suite =
            SUITE.get_or_init(|| env::var(SUITE_VARIABLE).ok().filter(|suite| is_suite(suite)));
        let owner = suite.clone().unwrap_or_else(|| user.to_string());
        let directory = place(&places(&owner), user, &robot.0).join(&robot.0);
        Self { robot, owner, directory }
    }

    pub fn directory(&self) -> &Path {
        &self.directory
    }

    /// Returns the process that holds the supervisor's lock or claims the robot.
    pub fn supervisor(&self) -> io::Result<Option<u32>> {
        match self.supervision()? {
            // The lock's text comes first, because a frozen supervisor accepts no connections to
            // its claim.
            Supervision::Locked(lock) => match named_in(&lock)?.filter(|pid| has_open(*pid, &lock))
            {
                None => claim::holder(self),
                named => Ok(named),
            },
            Supervision::Claimed(process) => Ok(Some(process)),
            Supervision::None => Ok(None),
        }
    }

    /// Returns whether the robot has a supervisor; true if unknown.
    pub fn is_supervised(&self) -> bool {
        !matches!(self.supervision(), Ok(Supervision::None))
    }

    fn supervision(&self) -> io::Result<Supervision> {
        let lock = match File::open(self.lock_file()) {
            // A cleaner of temporary files may have removed it.
            Err(error) if error.kind() == NotFound => {
                return Ok(claim::holder(self)?.map_or(Supervision::None, Supervision::Claimed));
            }
            opened => opened?,
        };
        match lock.try_lock_shared() {
            Ok(()) => Ok(Supervision::None),
            Err(TryLockError::WouldBlock) => Ok(Supervision::Locked(lock)),
            Err(TryLockError::Error(error)) => Err(error),
        }
    }

    /// Returns the name of the claim. It includes the PID namespace, because containers may share a
    /// network and its abstract names.
    pub(crate) fn claim_name(&self) -> String {
        let seen = fs::read_link("/proc/self/ns/pid").unwrap_or_default();
        format!("firsthand-{}-{}-{}", self.owner, self.robot, seen.display())
    }

    /// Waits for `file`. A running supervisor recreates it after a cleaner of temporary files
    /// removed it.
    pub fn made_again(&self, file: PathBuf) -> PathBuf {
        let began = Instant::now();
        while !file.exists()
            && began.elapsed() < MADE_AGAIN
            && matches!(claim::holder(self), Ok(Some(_)))
        {
            thread::park_timeout(LOOK_EVERY);
        }
        file
    }

    /// Keeps the supervisor from creating or removing a bus until the result is dropped.
    pub fn joining(&self) -> io::Result<File> {
        let lock = File::open(self.made_again(self.joining_lock_file()))?;
        lock.lock_shared()?;
        Ok(lock)
    }

    /// Shares the stages' lock until the result is dropped.
    pub fn enter(&self) -> io::Result<File> {
        let lock = File::open(self.stages_lock_file())?;
        lock.lock_shared()?;
        Ok(lock)
    }

    pub fn mirrors(&self) -> Option<String> {
        Some(fs::read_link(self.mirror_link()).ok()?.display().to_string())
    }

    pub fn shared_memory_prefix(&self) -> String {
        format!("fh{}_{}_", self.owner, self.robot)
    }
}

/// Declares the paths of a robot's files, which are names in its directory.
macro_rules! files {
    ($($(#[$doc:meta])* $file:ident: $name:literal,)*) => {
        impl Domain {
            $($(#[$doc])* pub fn $file(&self) -> PathBuf {
                self.directory.join($name)
            })*
        }
    };
}

files! {
    lock_file: "lock",
    /// Returns the lock that consumers share while they join. The supervisor holds it exclusively
    /// to create or remove a bus, so no consumer recreates its files.
    joining_lock_file: "joining.lock",
    /// Returns the lock that all stages share while they run. A new supervisor waits for its
    /// release.
    stages_lock_file: "stages.lock",
    /// Returns the link to the run directory, created if another program starts the stages.
    run_link: "run",
    run_directory: "run-directory",
    /// Returns the link whose text names the robot's machine, if this domain is a mirror.
    mirror_link: "mirror",
    stop_socket: "stop",
    guard_socket: "guard",
    /// Returns the link to the run directory of a robot that may be moving.
    owed_stop: "owed-stop",
    /// Returns the socket for the position of another simulated robot.
    place_socket: "place",
    /// Returns the link to the middleware configuration of the current
    /// [`BusInstance`](crate::bus_instance::BusInstance), which consumers load first.
    middleware_config: "iceoryx2.toml",
}

enum Supervision {
    Locked(File),
    Claimed(u32),
    None,
}

/// Environment variable that isolates concurrent test suites: `t` and four of a-z and 0-9 replace
/// the user number.
pub const SUITE_VARIABLE: &str = "FIRSTHAND_SUITE";
static SUITE: OnceLock<Option<String>> = OnceLock::new();

/// Isolates this process's robots, as [`SUITE_VARIABLE`] does. Call it before the first
/// [`Domain::of`].
pub fn set_apart(suite: &str) {
    // After the first named domain this has no effect.
    let _ = SUITE.set(Some(suite.to_owned()).filter(|suite| is_suite(suite)));
}

fn is_suite(text: &str) -> bool {
    let allowed = |byte: u8| matches!(byte, b'a'..=b'z' | b'0'..=b'9');
    text.len() == 5 && text.starts_with('t') && text.bytes().all(allowed)
}

/// Longest path of a directory of robots; socket paths in it have at most 108 bytes.
const LONGEST_PLACE: usize = 80;

/// Returns the possible directories for the robots of `user`, the preferred first.
///
/// Another user can occupy only the name in `/tmp`: the package makes `/run/firsthand` for its
/// user, and login and home directories are private. `$XDG_RUNTIME_DIR` differs between a login, a
/// service and a container of one user.
fn places(user: &str) -> Vec<PathBuf> {
    let home = env::var_os("HOME").map(|home| Path::new(&home).join(".firsthand"));
    [
        format!("/tmp/firsthand-{user}"),
        "/run/firsthand".to_owned(),
        format!("/run/user/{user}/firsthand"),
    ]
    .into_iter()
    .map(PathBuf::from)
    .chain(home.filter(|home| home.is_absolute()))
    .collect()
}

/// Returns the place of `robot` among `places`, else the first usable one, else the first. This
/// finds a running robot even if places changed since its start.
fn place(places: &[PathBuf], user: u32, robot: &str) -> PathBuf {
    const { assert!(LONGEST_PLACE + "/".len() + 16 + "/guard".len() < 108) };
    let is_own = |path: &Path| {
        fs::symlink_metadata(path).is_ok_and(|found| found.is_dir() && found.uid() == user)
    };
    let may_have = |place: &&PathBuf| {
        let absent = || fs::symlink_metadata(place).is_err_and(|error| error.kind() == NotFound);
        let may_make = || place.starts_with("/tmp") || place.parent().is_some_and(is_own);
        place.as_os_str().len() <= LONGEST_PLACE && (is_own(place) || absent() && may_make())
    };
    let usable: Vec<_> = places.iter().filter(may_have).collect();
    let has_robot = usable.iter().find(|place| place.join(robot).exists());
    has_robot.or(usable.first()).copied().or(places.first()).cloned().unwrap_or_default()
}

/// Returns the process number in `lock`; a container may use another for that process.
fn named_in(mut lock: &File) -> io::Result<Option<u32>> {
    let mut named = String::new();
    lock.read_to_string(&mut named)?;
    Ok(named.trim().parse().ok())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_robot_name_cannot_reach_out_of_its_directory() {
        for bad in ["", "..", "a/b", "A", "a_b", "a b", "12345678901234567"] {
            assert!(bad.parse::<RobotName>().is_err(), "{bad:?} was accepted");
        }
        assert!("x80-2".parse::<RobotName>().is_ok());
    }

    #[test]
    fn a_place_that_another_user_took_is_passed_over_and_a_robot_that_runs_is_found() {
        let directory = tempfile::tempdir().unwrap();
        let places = ["taken", "own", "home"].map(|name| directory.path().join(name));
        let user = rustix::process::geteuid().as_raw();
        let found = || place(&places, user, "x80");
        assert_eq!(found(), places[0]);
        // A link, which is not this user's directory, represents another user's.
        std::os::unix::fs::symlink(directory.path(), &places[0]).unwrap();
        assert_eq!(found(), places[1]);
        fs::create_dir_all(places[2].join("x80")).unwrap();
        assert_eq!(found(), places[2]);
        for taken in &places[1..] {
            let _ = fs::remove_dir_all(taken);
            fs::write(taken, "").unwrap();
        }
        // The error names it.
        assert_eq!(found(), places[0]);
    }

    #[test]
    fn no_prefix_starts_another() {
        let of = |name: &str| Domain::of(name.parse().unwrap()).shared_memory_prefix();
        assert!(!of("x80-2").starts_with(&of("x80")));
    }
}
