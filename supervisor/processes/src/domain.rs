//! Domain of a robot: its directory and shared memory, locked by one supervisor, with the bus.

use std::{
    fs::{self, DirBuilder, File, OpenOptions},
    io,
    os::unix::fs::{DirBuilderExt, MetadataExt, PermissionsExt, symlink},
    path::{Path, PathBuf},
    rc::Rc,
    thread,
    time::{Duration, Instant},
};

use common::{
    bus::{Bus, Services},
    claim::Claim,
    domain::{Domain, SHARED_MEMORY},
    file::{self, append},
    stop_socket::Operator,
    topics,
};
use rustix::fs::{Access, access, statvfs};

use crate::{
    descriptors,
    domain_error::{DomainError, failed},
    orphans,
};

/// Shared memory for small topics: twice the measured size. The second term covers samples held by
/// a frozen recorder: grids, and at least a page per piece of `inputs` of five stages.
const SMALL_TOPICS_BYTES: u64 = (16 << 20) + (32 << 20);
/// Shared memory per map cell, bytes: one in `grid` and twelve in `field`, for eight samples under
/// way at once.
const CELL_BYTES: u64 = 8 * 13;

/// Maximum time that a killed supervisor holds its lock on a loaded machine.
const LAST_HOLDER_ENDS: Duration = Duration::from_secs(1);

/// Domain locked by this process. A drop removes all its files.
pub struct DomainLock {
    domain: Domain,
    // The bus is dropped before the files are removed.
    bus: Option<(Services, Rc<Bus>)>,
    // Held while the bus changes, so that no stage joins.
    stages_lock: Option<File>,
    // Held while the bus changes, so that no consumer joins, except a stuck one.
    joining_lock: Option<File>,
    cells: usize,
    /// Links to the run's directory, with their destinations.
    links: Vec<(PathBuf, PathBuf)>,
    /// Whether restoring failed, which is logged once.
    stays_missing: bool,
    lock: File,
    // `None` if another user took the name. Dropped last.
    claim: Option<Claim>,
}

impl DomainLock {
    /// Locks `domain`, removes old files, creates services for a map of `cells` cells.
    pub fn acquire(domain: Domain, cells: usize) -> Result<Self, DomainError> {
        descriptors::raise_limit()?;
        // A robot whose directory was removed is still claimed.
        let claim = claim(&domain)?;
        let lock = lock(&domain)?;
        let mut acquired = Self {
            domain,
            bus: None,
            stages_lock: None,
            joining_lock: None,
            cells,
            links: Vec::new(),
            stays_missing: false,
            lock,
            claim,
        };
        // Without its configuration, consumers cannot mistake a killed supervisor's bus for the new
        // one.
        remove_file(&acquired.domain.middleware_config())?;
        remove_run(&acquired.domain)?;
        acquired.recreate_bus()?;
        Ok(acquired)
    }

    pub fn recreate_bus(&mut self) -> Result<(), DomainError> {
        self.clear()?;
        assert!(self.stages_lock.is_some() && self.joining_lock.is_some());
        check_shared_memory(SHARED_MEMORY, self.cells)?;
        let (bus, services) = Bus::make(&self.domain, "supervisor", topics::TABLE)?;
        self.bus = Some((services, Rc::new(bus)));
        (self.stages_lock, self.joining_lock) = (None, None);
        Ok(())
    }

    fn clear(&mut self) -> Result<(), DomainError> {
        self.bus = None;
        // A cleaner of temporary files may have removed the directory.
        make_directory(&self.domain)?;
        if self.stages_lock.is_none() {
            // External stages may still be stopping or starting.
            self.stages_lock = Some(orphans::wait_for(&self.domain)?);
        }
        if self.joining_lock.is_none() {
            self.joining_lock = Some(orphans::wait_for_consumers(&self.domain)?);
        }
        wipe(&self.domain)
    }

    pub fn bus(&self) -> Option<Rc<Bus>> {
        self.bus.as_ref().map(|(_, bus)| Rc::clone(bus))
    }

    /// Links `at` in the domain's directory to `run`: the run's directory, or the place of a
    /// mirrored robot.
    pub fn link_to_run(&mut self, run: &Path, at: PathBuf) -> Result<(), DomainError> {
        symlink(run, &at).map_err(failed("make", &at))?;
        self.links.push((at, run.to_path_buf()));
        Ok(())
    }

    /// Restores missing files of the domain's directory; called a few times a second.
    ///
    /// A cleaner of temporary files may remove them while the robot drives, which hides the robot.
    pub fn restore(&mut self) {
        if let Some(claim) = &self.claim {
            claim.forget_askers();
        }
        let domain = &self.domain;
        let files = [
            domain.lock_file(),
            domain.stages_lock_file(),
            domain.joining_lock_file(),
            domain.middleware_config(),
        ];
        let mut all = self.links.iter().map(|(at, _)| at).chain(&files);
        if all.all(|file| file.symlink_metadata().is_ok()) {
            return;
        }
        let again = self.make_again();
        // A lasting error is logged once.
        if again.is_ok() || !self.stays_missing {
            tracing::warn!(
                ?again,
                "files of the robot were removed while it ran and are recreated"
            );
        }
        self.stays_missing = again.is_err();
    }

    fn make_again(&mut self) -> Result<(), DomainError> {
        let domain = &self.domain;
        make_directory(domain)?;
        if !domain.lock_file().exists() {
            self.lock = lock(domain)?;
        }
        if let Some((_, bus)) = &self.bus {
            bus.restore_config()?;
        }
        for (at, run) in &self.links {
            remove_file(at)?;
            symlink(run, at).map_err(failed("make", at))?;
        }
        // Last, because a consumer that waits for one expects all others.
        for file in [domain.stages_lock_file(), domain.joining_lock_file()] {
            append(&file).map_err(failed("make", &file))?;
        }
        Ok(())
    }
}

impl Drop for DomainLock {
    fn drop(&mut self) {
        // The lock goes last, with its directory. A waiting process then makes its own.
        let _ = self.clear();
        remove_directory_of(&self.domain);
    }
}

pub(crate) fn remove_all(domain: &Domain) {
    let _ = wipe(domain);
    remove_directory_of(domain);
}

fn remove_directory_of(domain: &Domain) {
    let _ = remove_run(domain);
    for file in [domain.stages_lock_file(), domain.joining_lock_file(), domain.lock_file()] {
        let _ = fs::remove_file(file);
    }
    let _ = fs::remove_dir(domain.directory());
}

/// Claims the robot. The kernel holds a killed supervisor's claim until it removes the process.
fn claim(domain: &Domain) -> Result<Option<Claim>, DomainError> {
    let began = Instant::now();
    loop {
        match Claim::make(domain) {
            Ok(claim) => return Ok(Some(claim)),
            Err(_) if began.elapsed() < LAST_HOLDER_ENDS => thread::park_timeout(orphans::RETRY),
            Err(_) => break,
        }
    }
    let Ok(Some(process)) = domain.supervisor() else {
        tracing::warn!(
            "another user holds the name of the robot's claim; if the robot's directory is removed, commands cannot find the robot"
        );
        return Ok(None);
    };
    Err(DomainError::Supervised { robot: domain.robot.to_string(), holder: process.to_string() })
}

fn make_directory(domain: &Domain) -> Result<(), DomainError> {
    let directory = domain.directory();
    directory.parent().into_iter().chain([directory]).try_for_each(make_own_directory)
}

/// Makes a directory for its owner only, in a place that other users can write.
pub fn make_own_directory(path: &Path) -> Result<(), DomainError> {
    match DirBuilder::new().mode(0o700).create(path) {
        Ok(()) => {}
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
        Err(error) => return Err(failed("make", path)(error)),
    }
    let found = fs::symlink_metadata(path).map_err(failed("look at", path))?;
    if !found.is_dir() || found.uid() != rustix::process::geteuid().as_raw() {
        return Err(DomainError::Foreign { path: path.to_path_buf() });
    }
    if found.mode() & 0o077 != 0 {
        let own = fs::Permissions::from_mode(0o700);
        fs::set_permissions(path, own).map_err(failed("close to other users", path))?;
    }
    Ok(())
}

/// Locks the domain. The file names the holder for another supervisor's error message.
fn lock(domain: &Domain) -> Result<File, DomainError> {
    let path = domain.lock_file();
    let began = Instant::now();
    loop {
        make_directory(domain)?;
        let opened =
            OpenOptions::new().create(true).truncate(false).read(true).write(true).open(&path);
        let file = match opened {
            Ok(file) => file,
            // The previous holder has just removed the directory.
            Err(error) if error.kind() == io::ErrorKind::NotFound => continue,
            Err(error) => return Err(failed("open", &path)(error)),
        };
        let left = LAST_HOLDER_ENDS.saturating_sub(began.elapsed());
        if !orphans::locked_within(&file, left).map_err(failed("lock", &path))? {
            let holder = fs::read_to_string(&path).unwrap_or_default();
            return Err(DomainError::Supervised {
                robot: domain.robot.to_string(),
                holder: holder.trim().to_owned(),
            });
        }
        // The previous holder may have removed the file before this lock.
        let (ours, there) = (file.metadata(), fs::metadata(&path));
        if let (Ok(ours), Ok(there)) = (ours, there)
            && ours.ino() == there.ino()
        {
            fs::write(&path, format!("{}\n", std::process::id()))
                .map_err(failed("write", &path))?;
            return Ok(file);
        }
    }
}

fn remove_run(domain: &Domain) -> Result<(), DomainError> {
    let files =
        [domain.run_link(), domain.run_directory(), domain.stop_socket(), domain.mirror_link()];
    files.iter().try_for_each(|file| remove_file(file))?;
    // A killed stop guard leaves its socket; one that answers still orders the stop.
    let guard = domain.guard_socket();
    match Operator::connect(&guard) {
        Ok(None) => remove_file(&guard),
        _ => Ok(()),
    }
}

/// Removes the user's middleware files in this domain. A new bus has random names, without
/// collisions with other users' files.
fn wipe(domain: &Domain) -> Result<(), DomainError> {
    remove_file(&domain.middleware_config())?;
    let directory = domain.directory();
    for entry in fs::read_dir(directory).map_err(failed("read", directory))?.flatten() {
        let name = entry.file_name();
        if name.as_encoded_bytes().starts_with(b"iceoryx2") {
            remove_file(&entry.path())?;
        }
    }
    let prefix = domain.shared_memory_prefix();
    let shared = Path::new(SHARED_MEMORY);
    let entries = fs::read_dir(shared).map_err(|error| DomainError::SharedMemory {
        problem: format!("cannot be read: {error}"),
        remedy: "mount a tmpfs there",
    })?;
    let user = rustix::process::geteuid().as_raw();
    for entry in entries.flatten() {
        let name = entry.file_name();
        if !name.as_encoded_bytes().starts_with(prefix.as_bytes()) {
            continue;
        }
        let path = entry.path();
        // A leaving consumer removes its own files.
        let Ok(found) = entry.metadata() else {
            continue;
        };
        if found.uid() != user {
            tracing::warn!(file = %path.display(), owner = found.uid(), "a file of another user has a name reserved for this robot; it is kept");
        } else if found.is_dir() {
            remove_root(&path)?;
        } else {
            remove_file(&path)?;
        }
    }
    Ok(())
}

/// Removes a bus's directory, renamed first, because a joining consumer would add files.
fn remove_root(root: &Path) -> Result<(), DomainError> {
    let aside = root.with_extension("old");
    remove_directory(&aside)?;
    match fs::rename(root, &aside) {
        Ok(()) => remove_directory(&aside),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
        Err(error) => Err(failed("move", root)(error)),
    }
}

/// Removes a file, which a leaving consumer may have removed.
fn remove_file(path: &Path) -> Result<(), DomainError> {
    file::remove(path).map_err(failed("remove", path))
}

fn remove_directory(path: &Path) -> Result<(), DomainError> {
    match fs::remove_dir_all(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(failed("remove", path)(error)),
        _ => Ok(()),
    }
}

/// Checks, by name, what a supervisor with a map of `cells` cells needs of this machine.
pub fn check_machine(
    domain: &Domain,
    cells: usize,
) -> [(&'static str, Result<(), DomainError>); 3] {
    [
        ("limit of open files", descriptors::raise_limit()),
        ("directory of robots", domain.directory().parent().map_or(Ok(()), make_own_directory)),
        ("shared memory", check_shared_memory(SHARED_MEMORY, cells)),
    ]
}

/// Checks for space: writing to a segment in a full file system raises SIGBUS.
fn check_shared_memory(mount: &str, cells: usize) -> Result<(), DomainError> {
    let needed = SMALL_TOPICS_BYTES + CELL_BYTES * cells as u64;
    let space = access(mount, Access::WRITE_OK).and_then(|()| statvfs(mount)).map_err(|error| {
        DomainError::SharedMemory {
            problem: format!("cannot be used: {error}"),
            remedy: "mount a tmpfs there that all users may write",
        }
    })?;
    let free = space.f_bavail * space.f_frsize;
    if free < needed {
        return Err(DomainError::SharedMemory {
            problem: format!("has {} MiB free of the {} MiB needed", free >> 20, needed >> 20),
            remedy: "free space in it, enlarge it (docker: --shm-size), or lower perimeter.cells",
        });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use common::{bus::BusError, stop_socket::StopSocket};

    use super::*;

    /// Returns a domain unique to this process, independent of killed tests.
    fn domain(name: &str) -> Domain {
        Domain::of(format!("{name}-{}", std::process::id()).parse().unwrap())
    }

    #[test]
    fn a_domain_that_could_not_be_acquired_keeps_no_lock() {
        let domain = domain("no-lock");
        make_directory(&domain).unwrap();
        // A directory in the file's place cannot be removed as a file.
        fs::create_dir(domain.middleware_config()).unwrap();
        let refused = DomainLock::acquire(domain.clone(), 1).err().unwrap();
        fs::remove_dir(domain.middleware_config()).unwrap();
        let DomainError::File(error) = &refused else { panic!("{refused}") };
        assert_eq!(error.file, domain.middleware_config());
        assert!(!domain.lock_file().exists() && !domain.stages_lock_file().exists());
        fs::remove_dir(domain.directory()).unwrap();
    }

    #[test]
    fn a_supervisor_is_known_whatever_other_locks_come_and_go() {
        let domain = domain("locks");
        let held = DomainLock::acquire(domain.clone(), 1).unwrap();
        let files = tempfile::tempdir().unwrap();
        let began = Instant::now();
        let goes_on = || began.elapsed() < Duration::from_secs(2);
        thread::scope(|scope| {
            for churn in 0..3 {
                let folder = files.path();
                scope.spawn(move || {
                    let file = |number| folder.join(format!("{churn}-{number}"));
                    let files: Vec<_> = (0..60).map(|n| File::create(file(n)).unwrap()).collect();
                    while goes_on() {
                        files.iter().for_each(|file| file.lock().unwrap());
                        files.iter().for_each(|file| file.unlock().unwrap());
                    }
                });
            }
            // The list of locks sometimes misses one.
            while goes_on() {
                assert!(domain.supervisor().unwrap().is_some());
            }
        });
        drop(held);
        assert_eq!(domain.supervisor().unwrap(), None);
    }

    #[test]
    fn a_consumer_that_joins_for_ever_keeps_no_bus() {
        let domain = domain("joins");
        let held = DomainLock::acquire(domain.clone(), 1).unwrap();
        let joining = domain.joining().unwrap();
        drop(held);
        assert!(!domain.directory().exists());
        drop(joining);
    }

    #[test]
    fn a_run_removes_the_socket_of_a_killed_stop_guard_and_keeps_that_of_a_living_one() {
        let domain = domain("guard");
        make_directory(&domain).unwrap();
        let guard = StopSocket::bind(domain.guard_socket()).unwrap();
        drop(DomainLock::acquire(domain.clone(), 1).unwrap());
        assert!(domain.guard_socket().exists());
        drop(guard);
        drop(DomainLock::acquire(domain.clone(), 1).unwrap());
        assert!(!domain.directory().exists());
    }

    #[test]
    fn a_consumer_that_opens_a_topic_of_a_removed_bus_is_refused_and_leaves_nothing() {
        let domain = domain("late");
        let held = DomainLock::acquire(domain.clone(), 1).unwrap();
        let bus = Bus::join(&domain, "late").unwrap();
        drop(held);
        assert!(matches!(bus.reader(&topics::POSE), Err(BusError::NotRunning { .. })));
        drop(bus);
        let prefix = domain.shared_memory_prefix();
        let left = fs::read_dir(SHARED_MEMORY).unwrap().flatten();
        let mut left = left.filter(|it| it.file_name().to_string_lossy().starts_with(&prefix));
        assert!(left.next().is_none());
    }

    #[test]
    fn too_little_or_no_shared_memory_is_an_error_with_the_remedy() {
        let full = check_shared_memory(SHARED_MEMORY, usize::MAX >> 8).unwrap_err();
        let missing = check_shared_memory("/no/such/mount", 1).unwrap_err();
        for (error, expected) in [(full, "--shm-size"), (missing, "mount a tmpfs")] {
            let DomainError::SharedMemory { remedy, .. } = error else { panic!("{error}") };
            assert!(remedy.contains(expected), "{remedy}");
        }
    }
}
