//! Files that a process leaves if it is killed while it joins the bus. The middleware neither
//! expects nor removes them:
//!
//! - Shared memory that was created and is still unfilled. If root opens such a file, the
//!   middleware waits forever for its contents; other users are refused.
//! - Files of an incomplete node, which the middleware reads again at each start.
//!
//! Their names contain ids of nodes and ports, which contain the process number.
//!
//! Service files may also be missing: the last consumer to leave a bus removes them by name, even
//! those of a recreated bus. Each therefore has a backup under a second name.

use std::{
    fs::{self, DirEntry},
    io,
    os::unix::fs::PermissionsExt as _,
    path::Path,
    time::Duration,
};

/// Permissions of unfilled shared memory: write-only for its creator.
const UNFILLED: u32 = 0o200;

/// Age of abandoned unfilled memory; filling takes microseconds.
const FILLED: Duration = Duration::from_secs(1);

/// Removes unfilled shared memory with `prefix` from `directory`: that of `ended`, which must have
/// ended, and all older than [`FILLED`]. Returns whether some is left, which its creator may be
/// about to fill.
pub(super) fn remove_unfilled(directory: &Path, prefix: &str, ended: u32) -> io::Result<bool> {
    let mut left = false;
    for entry in fs::read_dir(directory)? {
        let entry = entry?;
        let name = entry.file_name();
        let name = name.to_string_lossy();
        let Some(age) = name.starts_with(prefix).then(|| unfilled_for(&entry)).flatten() else {
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

/// Returns the age of unfilled shared memory; `None` for other files, even if removed or filled
/// meanwhile.
fn unfilled_for(entry: &DirEntry) -> Option<Duration> {
    let file = entry.metadata().ok()?;
    let unfilled = file.is_file() && file.permissions().mode() & 0o777 == UNFILLED;
    // After the clock was set back, the file counts as new.
    unfilled.then(|| file.modified().ok()?.elapsed().ok()).map(Option::unwrap_or_default)
}

/// The process `ended` must have ended.
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

pub(super) fn back_up(services: &Path, backup: &Path) -> io::Result<()> {
    fs::create_dir(backup)?;
    for entry in fs::read_dir(services)? {
        let entry = entry?;
        fs::hard_link(entry.path(), backup.join(entry.file_name()))?;
    }
    Ok(())
}

/// Links the files that `services` lacks back from `backup`.
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

/// Treats a file already removed by another process as success.
fn removed(result: io::Result<()>) -> io::Result<()> {
    match result {
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
        other => other,
    }
}

fn names(file: &str, process: u32) -> bool {
    file.split(['_', '.']).filter_map(|part| part.parse().ok()).any(|id| process_of(id) == process)
}

/// Returns the process that made an id: the third of its four words.
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
