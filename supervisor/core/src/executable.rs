//! An executable that somebody names: found, and checked before anything starts.

use std::{
    env, io,
    path::{Path, PathBuf},
};

use rustix::fs::{Access, access};
use thiserror::Error;

/// Why what is named cannot be executed.
#[derive(Debug, Error)]
pub enum ExecutableError {
    /// A name alone, in no folder.
    #[error("it is neither beside firsthand nor on PATH")]
    Nowhere,
    /// No text.
    #[error("its path is not UTF-8")]
    NotUtf8,
    /// The system refuses.
    #[error(transparent)]
    Refused(#[from] io::Error),
}

/// The absolute path of the executable that is `named`: a path from the current directory, or a name alone beside this
/// executable or on `PATH`.
///
/// # Errors
/// When there is none, or it cannot be executed.
pub fn find(named: &Path) -> Result<PathBuf, ExecutableError> {
    let is_name = named.components().count() == 1 && !named.is_absolute();
    let is_name = is_name && !named.as_os_str().as_encoded_bytes().contains(&b'/');
    let found = if is_name {
        let mut found = folders().map(|folder| folder.join(named));
        found
            .find(|candidate| check(candidate).is_ok())
            .ok_or(ExecutableError::Nowhere)?
    } else {
        let absolute = std::path::absolute(named)?;
        check(&absolute)?;
        absolute
    };
    match found.to_str() {
        Some(_) => Ok(found),
        None => Err(ExecutableError::NotUtf8),
    }
}

/// Where a name alone is looked for, in order, as absolute paths.
fn folders() -> impl Iterator<Item = PathBuf> {
    let own = env::current_exe().ok();
    let beside = own.and_then(|own| Some(own.parent()?.to_path_buf()));
    let path = env::var_os("PATH").unwrap_or_default();
    let path: Vec<_> = env::split_paths(&path)
        .filter(|folder| folder.is_absolute())
        .collect();
    beside.into_iter().chain(path)
}

/// Whether this user may execute the file at `path`.
fn check(path: &Path) -> io::Result<()> {
    if path.metadata()?.is_dir() {
        return Err(io::ErrorKind::IsADirectory.into());
    }
    access(path, Access::EXEC_OK).map_err(|errno| match errno {
        rustix::io::Errno::ACCESS => io::Error::other("it is not executable (chmod +x)"),
        errno => errno.into(),
    })
}
