use std::{
    fs,
    os::unix::fs::MetadataExt as _,
    path::{Path, PathBuf},
};

use common::domain::{Domain, RobotName};

pub const SUPERVISOR_LOG: &str = "supervisor.log";
/// Prefix of user directories, before the user's number.
const USER_DIRECTORY: &str = "firsthand-";

#[derive(Debug)]
pub struct Robot {
    pub name: RobotName,
    /// Supervisor's process. `None` if killed.
    pub supervisor: Option<u32>,
    /// Directory of the run, if the system reports it.
    pub run: Option<PathBuf>,
}

impl Robot {
    pub fn find(name: RobotName) -> Self {
        let supervisor = name.domain().supervisor().ok().flatten();
        Self { name, supervisor, run: supervisor.and_then(run_directory) }
    }
}

/// Returns this user's robots by name: those that run, and those whose supervisor was killed. The
/// files of the latter remain until their next run.
pub fn own() -> (Vec<Robot>, Vec<Robot>) {
    // All robots of a user share one directory.
    let mut names: Vec<_> = "any"
        .parse()
        .ok()
        .map(Domain::of)
        .as_ref()
        .and_then(|any| any.directory().parent())
        .into_iter()
        .flat_map(entries)
        .filter_map(|entry| entry.file_name().to_str()?.parse::<RobotName>().ok())
        .collect();
    names.sort();
    names.into_iter().map(Robot::find).partition(|robot| robot.supervisor.is_some())
}

pub fn entries(directory: &Path) -> impl Iterator<Item = fs::DirEntry> + use<> {
    fs::read_dir(directory).into_iter().flatten().flatten()
}

/// Returns users with present or former robots here. Only they can list them.
pub fn other_users() -> Vec<u32> {
    users_in(Path::new("/tmp"), rustix::process::geteuid().as_raw())
}

fn users_in(directory: &Path, own: u32) -> Vec<u32> {
    let user = |entry: fs::DirEntry| {
        let name = entry.file_name();
        let user = name.to_str()?.strip_prefix(USER_DIRECTORY)?.parse().ok()?;
        // Any user can create directories there.
        let its = entry.metadata().ok()?.uid() == user;
        (user != own && its).then_some(user)
    };
    let mut users: Vec<_> = entries(directory).filter_map(user).collect();
    users.sort_unstable();
    users
}

fn run_directory(supervisor: u32) -> Option<PathBuf> {
    let log = fs::read_dir(format!("/proc/{supervisor}/fd"))
        .ok()?
        .flatten()
        .filter_map(|entry| fs::read_link(entry.path()).ok())
        .find(|file| file.ends_with(SUPERVISOR_LOG))?;
    Some(log.parent()?.to_path_buf())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_run_directory_is_where_the_supervisor_has_its_log_open() {
        let directory = tempfile::tempdir().unwrap();
        let directory = fs::canonicalize(directory.path()).unwrap();
        let own = std::process::id();
        assert_eq!(run_directory(own), None);
        let _log = fs::File::create(directory.join(SUPERVISOR_LOG)).unwrap();
        assert_eq!(run_directory(own), Some(directory));
    }

    #[test]
    fn another_users_directory_is_one_that_the_user_owns() {
        let directory = tempfile::tempdir().unwrap();
        let own = rustix::process::geteuid().as_raw();
        for name in [format!("firsthand-{own}"), format!("firsthand-{}", own + 1)] {
            fs::create_dir(directory.path().join(name)).unwrap();
        }
        assert_eq!(users_in(directory.path(), own), Vec::<u32>::new());
        assert_eq!(users_in(directory.path(), own + 1), [own]);
    }
}
