//! Checks of the owner and the permissions of a bus's files. Every user may create files in the directories of shared memory, so files
//! of another user are not used. The middleware would let everyone write one file, its count of nodes, so that file is created here.

use std::{
    fs,
    io::{self, Error, ErrorKind, Write as _},
    os::unix::fs::{MetadataExt as _, OpenOptionsExt as _},
    path::{Path, PathBuf},
};

use iceoryx2_bb_elementary::package_version::PackageVersion;

use crate::{bus_instance::BusInstance, domain::SHARED_MEMORY};

/// The end of the name of the middleware's count of nodes.
const COUNT_OF_NODES: &str = ".global_mgmt";
/// The middleware's name of the count's type: the SHA-1 of `iceoryx2::node::global_management_segment::State`.
const TYPE_OF_COUNT: &str = "9204dd183d1c4d8e1ff592a30766ffa6765aa8b5";
/// The permissions of all users but the owner, in a file's mode.
const OTHERS: u32 = 0o077;

/// Check that the files which a process opens first to join belong to this user, are closed to others and are complete. The
/// middleware would wait for files that are not. The error names the file.
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
        return Err(wrong(&missing, "has lost its count of nodes; start the robot again"));
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

/// Create the middleware's count of nodes, closed to other users. The middleware uses a count that exists; it would create one that
/// another user can open before its permissions are restricted.
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
    // The version of the middleware, then the count, which is 0, padded to the alignment of the version.
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
