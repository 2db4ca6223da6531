//! The files that a process killed while it joined the bus leaves, and that the middleware neither expects nor removes.
//!
//! - Shared memory that it had made and not yet filled. Root may open such a file, where others are refused, and the
//!   middleware then waits for ever for it to be filled.
//! - Files of a node that was not complete: the middleware would look at them, and not remove them, at each start.
//!
//! Both are found by their names: these hold ids of nodes and ports, and an id holds the number of the process that
//! made it.
//!
//! And files that are missing: a consumer that leaves a bus which was replaced, as the last one, removes the file of
//! each service by its name, which by then is the new bus's file. So each has a backup under a second name.

use std::{
    fs::{self, DirEntry},
    io,
    os::unix::fs::PermissionsExt as _,
    path::Path,
    time::Duration,
};

/// Permissions of shared memory before it is filled: its maker may write, nobody may read.
const UNFILLED: u32 = 0o200;

/// Filling a piece of shared memory takes microseconds.
const FILLED: Duration = Duration::from_secs(1);

/// Remove shared memory that was to connect `ended`, a process that must have ended, and was never filled; and that of
/// any process, if it was made so long ago that it will not be filled. `prefix` starts the names of this robot's files
/// in `directory`. Returns whether anything unfilled is left, which its maker may be filling just now.
///
/// # Errors
/// When the directory cannot be read, or a file not be removed.
pub(super) fn remove_unfilled(directory: &Path, prefix: &str, ended: u32) -> io::Result<bool> {
    let mut left = false;
    for entry in fs::read_dir(directory)? {
        let entry = entry?;
        let name = entry.file_name();
        let name = name.to_string_lossy();
        let ours = name.starts_with(prefix);
        let Some(age) = ours.then(|| unfilled_for(&entry)).flatten() else {
            continue;
        };
        if names(&name, ended) || age >= FILLED {
            removed(fs::remove_file(entry.path()))?;
        } else {
            left = true;
        }
    }
    Ok(left)
}

/// How long it has been unfilled, if it is there and is; it may be removed or filled at any moment.
fn unfilled_for(entry: &DirEntry) -> Option<Duration> {
    let file = entry.metadata().ok()?;
    let unfilled = file.is_file() && file.permissions().mode() & 0o777 == UNFILLED;
    // A clock that was set back makes it new.
    unfilled.then(|| file.modified().ok()?.elapsed().ok()).map(Option::unwrap_or_default)
}

/// Remove from the directory `nodes` what is named after nodes of `ended`, a process that must have ended.
///
/// # Errors
/// When the directory cannot be read, or something not be removed.
pub(super) fn remove_nodes(nodes: &Path, ended: u32) -> io::Result<()> {
    for entry in fs::read_dir(nodes)? {
        let entry = entry?;
        if names(&entry.file_name().to_string_lossy(), ended) {
            removed(if entry.file_type()?.is_dir() {
                fs::remove_dir_all(entry.path())
            } else {
                fs::remove_file(entry.path())
            })?;
        }
    }
    Ok(())
}

/// Give each file in `services` a second name in `backup`, a directory that must not exist.
///
/// # Errors
/// When the directory cannot be made, or a file not be linked.
pub(super) fn back_up(services: &Path, backup: &Path) -> io::Result<()> {
    fs::create_dir(backup)?;
    for entry in fs::read_dir(services)? {
        let entry = entry?;
        fs::hard_link(entry.path(), backup.join(entry.file_name()))?;
    }
    Ok(())
}

/// Give each file in `backup` its name in `services` again where it is missing.
///
/// # Errors
/// When the directory cannot be read, or a file not be linked.
pub(super) fn restore(backup: &Path, services: &Path) -> io::Result<()> {
    for entry in fs::read_dir(backup)? {
        let entry = entry?;
        match fs::hard_link(entry.path(), services.join(entry.file_name())) {
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
            other => other?,
        }
    }
    Ok(())
}

/// A file that another process removed first is removed, too.
fn removed(result: io::Result<()>) -> io::Result<()> {
    match result {
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
        other => other,
    }
}

/// Whether a file's name holds an id that `process` made.
fn names(file: &str, process: u32) -> bool {
    file.split(['_', '.']).filter_map(|part| part.parse().ok()).any(|id| process_of(id) == process)
}

/// The process that made a node or a port: the third of the four words of its id.
pub(super) const fn process_of(id: u128) -> u32 {
    (id >> 64) as u32
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs::Permissions;

    const ENDED: u32 = 4321;
    const RUNNING: u32 = 4322;

    const fn id(process: u32) -> u128 {
        (7 << 96) + ((process as u128) << 64) + (123 << 32) + 456
    }

    fn left(directory: &Path) -> Vec<String> {
        let entries = fs::read_dir(directory).unwrap();
        let mut left: Vec<_> =
            entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        left.sort();
        left
    }

    #[test]
    fn node_files_of_ended_processes_are_removed_and_no_others() {
        let directory = tempfile::tempdir().unwrap();
        let nodes = directory.path();
        for id in [id(ENDED), id(RUNNING)] {
            fs::create_dir(nodes.join(id.to_string())).unwrap();
            fs::write(nodes.join(format!("{id}/fh0_x80_node.details")), "").unwrap();
            fs::write(nodes.join(format!("fh0_x80_{id}.node_monitor")), "").unwrap();
        }
        remove_nodes(nodes, ENDED).unwrap();
        let monitor = format!("fh0_x80_{}.node_monitor", id(RUNNING));
        assert_eq!(left(nodes), [id(RUNNING).to_string(), monitor]);
    }

    #[test]
    fn a_service_file_that_is_missing_is_restored_and_one_that_is_there_is_left() {
        let directory = tempfile::tempdir().unwrap();
        let [services, backup] = ["services", "backup"].map(|name| directory.path().join(name));
        fs::create_dir(&services).unwrap();
        for name in ["pose.service", "grid.service"] {
            fs::write(services.join(name), name).unwrap();
        }
        back_up(&services, &backup).unwrap();
        fs::remove_file(services.join("pose.service")).unwrap();
        fs::remove_file(services.join("grid.service")).unwrap();
        fs::write(services.join("grid.service"), "another").unwrap();
        restore(&backup, &services).unwrap();
        let content = |name| fs::read_to_string(services.join(name)).unwrap();
        assert_eq!(content("pose.service"), "pose.service");
        assert_eq!(content("grid.service"), "another");
        assert_eq!(left(&services).len(), 2);
    }

    #[test]
    fn unfilled_memory_of_ended_processes_or_of_long_ago_is_removed_and_no_other() {
        let directory = tempfile::tempdir().unwrap();
        let (ended, running) = (id(ENDED), id(RUNNING));
        let make = |name: String, mode| {
            let path = directory.path().join(&name);
            fs::write(&path, "").unwrap();
            fs::set_permissions(&path, Permissions::from_mode(mode)).unwrap();
            name
        };
        make(format!("fh0_x80_ab12_{running}_{ended}.connection"), UNFILLED);
        make(format!("fh0_x80_ab12_{ended}.data"), UNFILLED);
        let mut stay = [
            make(format!("fh0_x80_ab12_{ended}_{running}.connection"), 0o600),
            make(format!("fh0_x80_ab12_{running}.data"), UNFILLED),
            make(format!("fh0_other_ab12_{ended}.data"), UNFILLED),
        ];
        let old = make(format!("fh0_x80_cd34_{running}.data"), 0o600);
        let old = directory.path().join(old);
        let file = fs::File::options().write(true).open(&old).unwrap();
        file.set_modified(std::time::SystemTime::now() - FILLED).unwrap();
        fs::set_permissions(&old, Permissions::from_mode(UNFILLED)).unwrap();
        stay.sort();
        assert!(remove_unfilled(directory.path(), "fh0_x80_", ENDED).unwrap());
        assert_eq!(left(directory.path()), stay);
    }
}
