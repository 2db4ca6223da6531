//! What a killed process leaves of the middleware in its robot's domain, found by the process's number and removed.
//!
//! Whoever joins the bus cleans up after the dead, but not all: of a process that was killed while it joined, node files
//! stay for ever, and a piece of shared memory that was half made lets everyone wait for its completion, without
//! limit where the user is root. Ports and nodes are called by numbers, decimal in the names of their files, whose third
//! 32 bits are the process's.

use std::{
    collections::VecDeque,
    fs,
    os::unix::fs::{MetadataExt as _, PermissionsExt as _},
    path::Path,
    time::Duration,
};

use common::domain::{Domain, SHARED_MEMORY};

use crate::policy::Now;

/// Cleaning up after a dead process takes milliseconds.
const CLEANED_UP: Duration = Duration::from_secs(1);

/// Making a piece of shared memory takes microseconds.
const COMPLETED: Duration = Duration::from_secs(1);

/// The dead of a domain whose files are not swept yet.
#[derive(Debug)]
pub(crate) struct Remains {
    domain: Domain,
    /// Their processes, and when they died.
    dead: VecDeque<(u32, Now)>,
    /// When the newest life began that is ready: it has cleaned up after those who were dead by then.
    newest: Now,
}

impl Remains {
    /// Nobody has died in `domain` yet.
    pub(crate) const fn new(domain: Domain) -> Self {
        Self {
            domain,
            dead: VecDeque::new(),
            newest: Now::ZERO,
        }
    }

    /// Process `pid` has died. What it has half made is removed before anyone cleans up after it.
    pub(crate) fn on_death(&mut self, pid: u32, now: Now) {
        self.sweep_half_made(pid);
        self.dead.push_back((pid, now));
    }

    /// A life that `began` then is ready.
    pub(crate) fn on_ready(&mut self, began: Now) {
        self.newest = self.newest.max(began);
    }

    /// The bus was made anew: nothing is left of anyone.
    pub(crate) fn forget(&mut self) {
        self.dead.clear();
    }

    /// Remove every file of the dead that others have cleaned up after: before that they need these files to find the
    /// places of the dead in the services.
    pub(crate) fn sweep(&mut self, now: Now) {
        while let Some(&(pid, died)) = self.dead.front()
            && died <= self.newest
            && now >= died + CLEANED_UP
        {
            self.dead.pop_front();
            self.sweep_half_made(pid);
            let root = self.domain.middleware_root();
            for directory in [&root.join("nodes"), &root, Path::new(SHARED_MEMORY)] {
                remove(directory, &self.domain, |_, name| names(name, pid));
            }
        }
    }

    /// Remove what `pid` has half made, and what anyone made half so long ago that it will not be completed: nobody can
    /// use it, and nobody is to wait for it.
    fn sweep_half_made(&self, pid: u32) {
        remove(Path::new(SHARED_MEMORY), &self.domain, |path, name| {
            path.symlink_metadata().is_ok_and(|found| {
                let unready = found.size() == 0 || found.permissions().mode() & 0o400 == 0;
                let made = found.modified().ok();
                let age = made.and_then(|made| made.elapsed().ok());
                unready && (names(name, pid) || age >= Some(COMPLETED))
            })
        });
    }
}

/// Remove the files and directories of the domain in `directory` that are so, by path and by name.
fn remove(directory: &Path, domain: &Domain, is_so: impl Fn(&Path, &str) -> bool) {
    let prefix = domain.shared_memory_prefix();
    // Gone meanwhile, or not to be removed: then it stays in the way as it was.
    for entry in fs::read_dir(directory).into_iter().flatten().flatten() {
        let name = entry.file_name();
        let Some(name) = name.to_str() else { continue };
        let (name, ours) = match name.strip_prefix(&prefix) {
            Some(name) => (name, true),
            None => (name, directory.starts_with(domain.directory())),
        };
        let path = entry.path();
        if ours && is_so(&path, name) {
            tracing::debug!(path = %path.display(), "removed what a dead process left");
            let _ = match entry.file_type() {
                Ok(kind) if kind.is_dir() => fs::remove_dir_all(&path),
                _ => fs::remove_file(&path),
            };
        }
    }
}

/// Whether the name of a file speaks of process `pid`.
fn names(name: &str, pid: u32) -> bool {
    name.split(['_', '.'])
        .filter_map(|word| word.parse::<u128>().ok())
        .any(|number| (number >> 64) as u32 == pid)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_names_the_process_of_each_port_and_of_no_hash() {
        let connection = "b9fc73e5c1f646968758453273c6c65cb372831b_\
            554597485121183016453176035325_475369322588457853048447830013.connection";
        assert!(names(connection, 18839) && names(connection, 18838));
        assert!(!names(connection, 18837));
        assert!(names("554597485121183016453176035325", 18839));
        let service = "1111111111111111111111111111111111111111.service";
        assert!((0..1 << 16).all(|pid| !names(service, pid)));
    }
}
