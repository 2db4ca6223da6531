//! Files of the system or of a simulated machine: replacement, appending, bounded reading, and the
//! error of an unusable file.

use std::{
    fs,
    io::{self, Read as _, Seek as _, SeekFrom, Write as _},
    os::unix::fs::FileExt as _,
    path::{Path, PathBuf},
};

use rustix::{
    fs::{FallocateFlags, fallocate},
    io::Errno,
};
use thiserror::Error;

use crate::machine::{self, Content};

#[derive(Debug, Error)]
#[error("cannot {action} {}: {source}", file.display())]
pub struct FileError {
    pub action: &'static str,
    pub file: PathBuf,
    pub source: io::Error,
}

impl FileError {
    pub fn of<E: Into<io::Error>>(
        action: &'static str,
        file: &Path,
    ) -> impl FnOnce(E) -> Self + use<E> {
        let file = file.to_path_buf();
        move |cause| Self { action, file, source: cause.into() }
    }
}

/// File that a process keeps open: the system's, or a simulated machine's.
#[derive(Debug)]
pub(crate) enum Store {
    System(fs::File),
    Simulated(Content),
}

impl Store {
    pub(crate) fn open(path: &Path, length: u64) -> io::Result<Self> {
        match machine::simulated() {
            Some(machine) => killed().map(|()| Self::Simulated(machine.files().open(path))),
            None => reserved(path, length).map(Self::System),
        }
    }

    pub(crate) fn read(&self, at: u64, most: u64) -> io::Result<Vec<u8>> {
        match self {
            Self::System(file) => {
                let mut file = file;
                let mut bytes = Vec::new();
                file.seek(SeekFrom::Start(at))?;
                file.take(most).read_to_end(&mut bytes)?;
                Ok(bytes)
            }
            Self::Simulated(content) => {
                let content = content.borrow();
                let from = content.get(at as usize..).unwrap_or_default();
                Ok(from.get(..most as usize).unwrap_or(from).to_vec())
            }
        }
    }

    pub(crate) fn write(&self, bytes: &[u8], at: u64) -> io::Result<()> {
        match self {
            Self::System(file) => file.write_all_at(bytes, at),
            Self::Simulated(content) => {
                killed()?;
                let mut content = content.borrow_mut();
                let end = at as usize + bytes.len();
                let length = content.len().max(end);
                content.resize(length, 0);
                content[at as usize..end].copy_from_slice(bytes);
                Ok(())
            }
        }
    }
}

/// Opens or creates `path` and reserves `length` bytes on disk, if the file system can; the file's
/// length stays.
pub fn reserved(path: &Path, length: u64) -> io::Result<fs::File> {
    let mut options = fs::File::options();
    let file = options.read(true).write(true).create(true).truncate(false).open(path)?;
    match fallocate(&file, FallocateFlags::KEEP_SIZE, 0, length) {
        Ok(()) | Err(Errno::OPNOTSUPP | Errno::NOSYS) => Ok(file),
        Err(errno) => Err(errno.into()),
    }
}

fn killed() -> io::Result<()> {
    if machine::is_killed() { Err(io::ErrorKind::BrokenPipe.into()) } else { Ok(()) }
}

/// Replaces `file` so that a kill leaves the old or the new content.
pub fn replace(file: &Path, content: impl AsRef<[u8]>) -> io::Result<()> {
    if let Some(machine) = machine::simulated() {
        killed()?;
        machine.files().open(file).replace(content.as_ref().to_vec());
        return Ok(());
    }
    let mut new = file.as_os_str().to_owned();
    new.push(".new");
    fs::write(&new, content)?;
    fs::rename(&new, file)
}

pub fn append(file: impl AsRef<Path>) -> io::Result<fs::File> {
    fs::File::options().create(true).append(true).open(file)
}

/// Appends `bytes` in one write. Returns the new length.
pub fn append_bytes(file: &Path, bytes: &[u8]) -> io::Result<u64> {
    if let Some(machine) = machine::simulated() {
        killed()?;
        let content = machine.files().open(file);
        content.borrow_mut().extend_from_slice(bytes);
        return Ok(content.borrow().len() as u64);
    }
    let mut file = append(file)?;
    file.write_all(bytes)?;
    Ok(file.metadata()?.len())
}

pub fn read_text(file: &Path) -> io::Result<String> {
    let Some(machine) = machine::simulated() else { return fs::read_to_string(file) };
    if !machine.files().exists(file) {
        return Err(io::ErrorKind::NotFound.into());
    }
    String::from_utf8(machine.files().open(file).borrow().clone()).map_err(io::Error::other)
}

/// Links count, too.
pub fn exists(path: &Path) -> bool {
    match machine::simulated() {
        Some(machine) => machine.files().exists(path),
        None => path.symlink_metadata().is_ok(),
    }
}

pub fn create(path: &Path) -> io::Result<()> {
    match machine::simulated() {
        Some(machine) => killed().map(|()| drop(machine.files().open(path))),
        None => fs::File::create(path).map(drop),
    }
}

pub fn remove(path: &Path) -> io::Result<()> {
    if let Some(machine) = machine::simulated() {
        return killed().map(|()| machine.files().remove(path));
    }
    match fs::remove_file(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    }
}

pub fn text(file: &Path, most: u64) -> Option<String> {
    if machine::is_simulated() {
        return read_text(file).ok();
    }
    let mut text = String::new();
    fs::File::open(file).ok()?.take(most).read_to_string(&mut text).ok()?;
    Some(text)
}
