//! Whose the files of a bus are. The middleware makes one of them for everyone to write (its count of nodes), and all
//! of them by name in a directory that every user may write to: what this user does not own is not used.

use std::{
    fs,
    io::{self, Error, ErrorKind},
    os::unix::fs::{MetadataExt as _, PermissionsExt as _},
    path::{Path, PathBuf},
};

use crate::{bus_instance::BusInstance, domain::SHARED_MEMORY};

/// Ends the name of the middleware's count of nodes.
const COUNT_OF_NODES: &str = ".global_mgmt";
/// What others than the owner may do, in a file's mode.
const OTHERS: u32 = 0o077;

/// That all which a process opens first to join is this user's, closed to others and whole: the middleware would wait
/// for what is not.
///
/// # Errors
/// Names what is not.
pub(super) fn check(instance: &BusInstance) -> io::Result<()> {
    let directory = instance.domain().directory();
    let directories = [directory, &instance.root()];
    for path in directory.parent().into_iter().chain(directories) {
        check_one(path, true)?;
    }
    check_one(&instance.config(), false)?;
    for count in counts_of_nodes(instance)? {
        check_one(&count, false)?;
        if fs::symlink_metadata(&count)?.len() == 0 {
            return Err(wrong(&count, "is empty; start the robot again"));
        }
    }
    Ok(())
}

/// Close to others what the middleware has opened to them.
///
/// # Errors
/// When a file's mode cannot be set.
pub(super) fn close_to_others(instance: &BusInstance) -> io::Result<()> {
    for count in counts_of_nodes(instance)? {
        let mut permissions = fs::symlink_metadata(&count)?.permissions();
        if permissions.mode() & OTHERS != 0 {
            permissions.set_mode(permissions.mode() & !OTHERS);
            fs::set_permissions(&count, permissions)?;
        }
    }
    Ok(())
}

fn counts_of_nodes(instance: &BusInstance) -> io::Result<Vec<PathBuf>> {
    let prefix = instance.shared_memory_prefix();
    let mut found = Vec::new();
    for entry in fs::read_dir(SHARED_MEMORY)? {
        let entry = entry?;
        let name = entry.file_name();
        let name = name.to_string_lossy();
        if name.starts_with(&prefix) && name.ends_with(COUNT_OF_NODES) {
            found.push(entry.path());
        }
    }
    Ok(found)
}

fn check_one(path: &Path, directory: bool) -> io::Result<()> {
    let found = fs::symlink_metadata(path)?;
    if found.uid() != rustix::process::geteuid().as_raw() {
        return Err(wrong(path, "belongs to another user"));
    }
    let kind = found.file_type();
    if kind.is_symlink() || kind.is_dir() != directory {
        return Err(wrong(path, "is of another kind than a bus has there"));
    }
    // The configuration is in a directory of the owner's.
    if found.mode() & 0o022 != 0 || directory && found.mode() & OTHERS != 0 {
        return Err(wrong(path, "is open to other users"));
    }
    Ok(())
}

fn wrong(path: &Path, what: &str) -> Error {
    Error::new(ErrorKind::PermissionDenied, format!("{} {what}", path.display()))
}
