//! Owner and permission checks of a bus's files. Every user may create files in shared memory, so
//! others' files are rejected.
//!
//! The middleware would make its count of nodes writable for all, so it is created here.

use std::{
    fs,
    io::{self, Error, ErrorKind, Write as _},
    os::unix::fs::{MetadataExt as _, OpenOptionsExt as _},
    path::{Path, PathBuf},
};

use iceoryx2_bb_elementary::package_version::PackageVersion;

use crate::{bus_instance::BusInstance, domain::SHARED_MEMORY};

const COUNT_OF_NODES: &str = ".global_mgmt";
/// Middleware's name of the count's type: the SHA-1 of
/// `iceoryx2::node::global_management_segment::State`.
const TYPE_OF_COUNT: &str = "9204dd183d1c4d8e1ff592a30766ffa6765aa8b5";
const OTHERS: u32 = 0o077;

/// Checks that the first files for joining are complete and private to this user. The middleware
/// would wait for incomplete ones.
pub(super) fn check(instance: &BusInstance) -> io::Result<()> {
    let directory = instance.domain.directory();
    let directories = [directory, &instance.root()];
    for path in directory.parent().into_iter().chain(directories) {
        check_one(path, true)?;
    }
    check_one(&instance.config(), false)?;
    let counts = counts_of_nodes(instance)?;
    if counts.is_empty() {
        let missing = Path::new(SHARED_MEMORY).join(instance.shared_memory_prefix());
        return Err(wrong(&missing, "lacks its count of nodes; start the robot again"));
    }
    for count in counts {
        check_one(&count, false)?;
        let found = fs::symlink_metadata(&count)?;
        if found.mode() & OTHERS != 0 {
            return Err(wrong(&count, "is open to other users"));
        }
        if found.len() == 0 {
            return Err(wrong(&count, "is empty; start the robot again"));
        }
    }
    Ok(())
}

/// Creates the middleware's count of nodes, closed to other users. The middleware's own would be
/// open to them until its permissions are restricted.
pub(super) fn create_count_of_nodes(instance: &BusInstance) -> io::Result<()> {
    let version = PackageVersion::get();
    let [major, minor, patch] = [version.major(), version.minor(), version.patch()];
    let prefix = instance.shared_memory_prefix();
    let name = format!("{prefix}{TYPE_OF_COUNT}_node.{major}_{minor}_{patch}{COUNT_OF_NODES}");
    let mut file = fs::File::options()
        .write(true)
        .create_new(true)
        .mode(0o600)
        .open(Path::new(SHARED_MEMORY).join(name))?;
    // The middleware's version, then the count of 0, padded to the version's alignment.
    file.write_all(&[version.to_u64(), 0].map(u64::to_ne_bytes).concat())
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
        return Err(wrong(path, "has the wrong file type"));
    }
    // The configuration's mode may let others read, because its directory is closed to them.
    if found.mode() & 0o022 != 0 || directory && found.mode() & OTHERS != 0 {
        return Err(wrong(path, "is open to other users"));
    }
    Ok(())
}

fn wrong(path: &Path, what: &str) -> Error {
    Error::new(ErrorKind::PermissionDenied, format!("{} {what}", path.display()))
}
