//! Checks of the owner and the permissions of a bus's files. Every user may create files in the directories of shared memory, so files
//! of another user are not used. The middleware lets everyone write one file, its count of nodes, so its permissions are
//! restricted here.

use std::{
    fs,
    io::{self, Error, ErrorKind},
    os::unix::fs::{MetadataExt as _, PermissionsExt as _},
    path::{Path, PathBuf},
};

use crate::{bus_instance::BusInstance, domain::SHARED_MEMORY};

/// The name of the middleware's count of nodes ends with this.
const COUNT_OF_NODES: &str = ".global_mgmt";
/// The permissions of all users but the owner, in a file's mode.
const OTHERS: u32 = 0o077;

/// Check that the files which a process opens first to join belong to this user, are closed to others and are complete. The
/// middleware would wait for files that are not. The error names the file.
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

/// Take the permissions of other users away from the middleware's counts of nodes.
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
    // Others may read the configuration by its mode, because its directory is closed to them.
    if found.mode() & 0o022 != 0 || directory && found.mode() & OTHERS != 0 {
        return Err(wrong(path, "is open to other users"));
    }
    Ok(())
}

fn wrong(path: &Path, what: &str) -> Error {
    Error::new(ErrorKind::PermissionDenied, format!("{} {what}", path.display()))
}
