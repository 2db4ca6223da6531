//! A robot's domain on this machine: its name, its runtime directory, and the prefix of its files in shared memory.
//!
//! Two robots share nothing: each has its own directory, lock, prefix in `/dev/shm` and services.

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

use crate::{claim, lock_holders::has_open};

/// The name of a robot, and of its domain: 1 to 16 of a-z, 0-9 and `-`.
///
/// It is short because Linux limits the length of socket paths. It has no `_` because `_` ends the name in a shared memory prefix.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(try_from = "String")]
pub struct RobotName(String);

#[derive(Debug, Error)]
#[error("{0:?} cannot name a robot; use 1 to 16 of a-z, 0-9 and '-'")]
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

impl TryFrom<String> for RobotName {
    type Error = RobotNameError;

    fn try_from(text: String) -> Result<Self, RobotNameError> {
        text.parse()
    }
}

impl fmt::Display for RobotName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

pub const SHARED_MEMORY: &str = "/dev/shm";

/// The patience with a supervisor that makes its directory again, for which it looks five times a second.
const MADE_AGAIN: Duration = Duration::from_secs(2);
const LOOK_EVERY: Duration = Duration::from_millis(10);

/// The names of one robot's files on this machine, for one user.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Domain {
    pub robot: RobotName,
    /// The user's number, or the letters of a suite of tests.
    owner: String,
    directory: PathBuf,
}

impl Domain {
    pub fn of(robot: RobotName) -> Self {
        let user = rustix::process::geteuid().as_raw();
        let suite =
            SUITE.get_or_init(|| env::var(SUITE_VARIABLE).ok().filter(|suite| is_suite(suite)));
        let owner = suite.clone().unwrap_or_else(|| user.to_string());
        let directory = place(&places(&owner), user, &robot.0).join(&robot.0);
        Self { robot, owner, directory }
    }

    /// The directory of the domain's files. Only its owner may enter it.
    pub fn directory(&self) -> &Path {
        &self.directory
    }

    /// The lock that the supervisor holds exclusively as long as it runs.
    pub fn lock_file(&self) -> PathBuf {
        self.directory.join("lock")
    }

    /// The process that holds the supervisor's lock, or claims the robot; none if there is neither.
    pub fn supervisor(&self) -> io::Result<Option<u32>> {
        match self.supervision()? {
            // A frozen supervisor does not accept connections to its claim, so the lock's own text comes first.
            Supervision::Locked(lock) => match named_in(&lock)?.filter(|pid| has_open(*pid, &lock))
            {
                None => claim::holder(self),
                named => Ok(named),
            },
            Supervision::Claimed(process) => Ok(Some(process)),
            Supervision::None => Ok(None),
        }
    }

    /// Whether the robot has a supervisor; true if that cannot be found out.
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

    /// The name of the claim on the robot. Two containers may have the network in common, and with it such names, so the name has the set
    /// of processes that this one sees.
    pub(crate) fn claim_name(&self) -> String {
        let seen = fs::read_link("/proc/self/ns/pid").unwrap_or_default();
        format!("firsthand-{}-{}-{}", self.owner, self.robot, seen.display())
    }

    /// Wait for `file` of the directory. A supervisor that runs makes it again, if a cleaner of temporary files removed it.
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

    /// The lock that consumers share while they join a bus. The supervisor holds it exclusively while it creates or removes a bus, so a
    /// consumer cannot recreate files of a bus that was removed.
    pub fn joining_lock_file(&self) -> PathBuf {
        self.directory.join("joining.lock")
    }

    /// Prevent the supervisor from creating or removing a bus until the result is dropped or the process ends. Hold it only briefly. An
    /// error means that there is no domain.
    pub fn joining(&self) -> io::Result<File> {
        let lock = File::open(self.made_again(self.joining_lock_file()))?;
        lock.lock_shared()?;
        Ok(lock)
    }

    /// The lock that all stages share as long as they run. A new supervisor waits until the stages of the last one have released it.
    pub fn stages_lock_file(&self) -> PathBuf {
        self.directory.join("stages.lock")
    }

    /// Share the lock of the stages until the result is dropped or the process ends. An error means that there is no domain.
    pub fn enter(&self) -> io::Result<File> {
        let lock = File::open(self.stages_lock_file())?;
        lock.lock_shared()?;
        Ok(lock)
    }

    /// A link to the run directory. A supervisor creates it if another program starts the stages.
    pub fn run_link(&self) -> PathBuf {
        self.directory.join("run")
    }

    pub fn run_directory(&self) -> PathBuf {
        self.directory.join("run-directory")
    }

    /// A link whose text names where the robot runs, if this domain is a mirror of a robot of another machine.
    pub fn mirror_link(&self) -> PathBuf {
        self.directory.join("mirror")
    }

    /// Where the robot runs that this domain mirrors; none if the robot itself has the domain, or nobody.
    pub fn mirrors(&self) -> Option<String> {
        Some(fs::read_link(self.mirror_link()).ok()?.display().to_string())
    }

    /// The socket of the link that an operator's stop needs no middleware for.
    pub fn stop_socket(&self) -> PathBuf {
        self.directory.join("stop")
    }

    /// The socket of the stop guard that orders the stop after its link ended.
    pub fn guard_socket(&self) -> PathBuf {
        self.directory.join("guard")
    }

    /// A link to the directory of the run whose robot may move.
    pub fn owed_stop(&self) -> PathBuf {
        self.directory.join("owed-stop")
    }

    /// The socket at which the simulated robot hears where another in its world is.
    pub fn place_socket(&self) -> PathBuf {
        self.directory.join("place")
    }

    /// A link to the middleware's configuration of the current [`BusInstance`](crate::bus_instance::BusInstance). A consumer in any
    /// language loads it first.
    pub fn middleware_config(&self) -> PathBuf {
        self.directory.join("iceoryx2.toml")
    }

    /// The names of all files of this domain in [`SHARED_MEMORY`] start with this prefix. No other domain's prefix starts with it,
    /// because robot names have no `_`.
    pub fn shared_memory_prefix(&self) -> String {
        format!("fh{}_{}_", self.owner, self.robot)
    }
}

/// How it shows that a robot has a supervisor.
enum Supervision {
    Locked(File),
    Claimed(u32),
    None,
}

/// The environment variable that sets a suite of tests apart, so that two of them may run at once: `t` and four of a-z and 0-9, which
/// stand in the place of the user's number.
pub const SUITE_VARIABLE: &str = "FIRSTHAND_SUITE";
static SUITE: OnceLock<Option<String>> = OnceLock::new();

/// Set the robots that this process knows apart, as [`SUITE_VARIABLE`] does. Call it before the first [`Domain::of`].
pub fn set_apart(suite: &str) {
    // Once a domain has been named, it is too late.
    let _ = SUITE.set(Some(suite.to_owned()).filter(|suite| is_suite(suite)));
}

fn is_suite(text: &str) -> bool {
    let allowed = |byte: u8| matches!(byte, b'a'..=b'z' | b'0'..=b'9');
    text.len() == 5 && text.starts_with('t') && text.bytes().all(allowed)
}

/// The longest path of a directory of robots. The paths of sockets in it have at most 108 bytes.
const LONGEST_PLACE: usize = 80;

/// The directories in which the robots of `user` may be, the preferred first. Another user can take the name in `/tmp`, and no other:
/// the package makes `/run/firsthand` for its user, and nobody else writes in the directories of a login and of a home.
/// `$XDG_RUNTIME_DIR` is not asked, because it differs between a login, a service and a container of one user.
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

/// The place of `robot` among `places`, or else the first place that this user has or may make. So a running robot is found, whatever
/// places were made or taken since its start. If no place is left, the first is returned, and an error names it.
fn place(places: &[PathBuf], user: u32, robot: &str) -> PathBuf {
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
    let found = has_robot.or(usable.first()).copied().or(places.first());
    found.cloned().unwrap_or_default()
}

/// The process that wrote its number in `lock`. A container may have another number for it.
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
        // A link, which is no directory of this user, stands for a directory of another user.
        std::os::unix::fs::symlink(directory.path(), &places[0]).unwrap();
        assert_eq!(found(), places[1]);
        fs::create_dir_all(places[2].join("x80")).unwrap();
        assert_eq!(found(), places[2]);
        for taken in &places[1..] {
            let _ = fs::remove_dir_all(taken);
            fs::write(taken, "").unwrap();
        }
        assert_eq!(found(), places[0], "the error names it");
    }

    #[test]
    fn no_prefix_starts_another() {
        let of = |name: &str| Domain::of(name.parse().unwrap()).shared_memory_prefix();
        assert!(!of("x80-2").starts_with(&of("x80")));
    }
}
