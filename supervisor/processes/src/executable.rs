use std::{
    env, io,
    path::{Path, PathBuf},
};

use rustix::fs::{Access, access};

/// `named` is a path, or a plain name beside this executable or on `PATH`.
pub fn find(named: &Path) -> io::Result<PathBuf> {
    let has_slash = named.as_os_str().as_encoded_bytes().contains(&b'/');
    let is_name = named.components().count() == 1 && !has_slash;
    let found = if is_name {
        folders()
            .map(|folder| folder.join(named))
            .find(|candidate| check(candidate).is_ok())
            .ok_or_else(|| io::Error::other("it is neither beside firsthand nor on PATH"))?
    } else {
        let absolute = std::path::absolute(named)?;
        check(&absolute)?;
        absolute
    };
    match found.to_str() {
        Some(_) => Ok(found),
        None => Err(io::Error::other("its path is not UTF-8")),
    }
}

fn folders() -> impl Iterator<Item = PathBuf> {
    let beside = env::current_exe().ok().and_then(|own| Some(own.parent()?.to_path_buf()));
    let path: Vec<_> = env::split_paths(&env::var_os("PATH").unwrap_or_default())
        .filter(|folder| folder.is_absolute())
        .collect();
    beside.into_iter().chain(path)
}

fn check(path: &Path) -> io::Result<()> {
    if path.metadata()?.is_dir() {
        return Err(io::ErrorKind::IsADirectory.into());
    }
    access(path, Access::EXEC_OK).map_err(|errno| match errno {
        rustix::io::Errno::ACCESS => io::Error::other("it is not executable (chmod +x)"),
        errno => errno.into(),
    })
}
