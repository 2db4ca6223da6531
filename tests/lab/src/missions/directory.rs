//! The directory of an evaluation: a new one, or the one of an evaluation that is resumed.

use std::{
    fs, io,
    path::{Path, PathBuf},
};

use common::file::FileError;
use thiserror::Error;

/// Name of the file of the command that gives its rows.
const PLAN_FILE: &str = "plan.txt";
const PAGE_FILE: &str = "index.html";

#[derive(Debug, Error)]
pub enum DirectoryError {
    #[error("--resume: the command in {} was another: {earlier}", directory.display())]
    Another { directory: PathBuf, earlier: String },
    /// The directory has results, and `resume` is not set.
    #[error("{} contains results; continue them with --resume, or give another --out", directory.display())]
    Taken { directory: PathBuf },
    #[error("cannot use {} for results: {source}; give another --out", path.display())]
    System { path: PathBuf, source: io::Error },
}

/// Make `directory` for the rows of `command`, or check that its rows are of that command. Returns its absolute path.
pub fn claim(directory: &Path, command: &str, resume: bool) -> Result<PathBuf, DirectoryError> {
    let file = directory.join(PLAN_FILE);
    let system = |path: &Path| {
        let path = path.to_path_buf();
        move |source| DirectoryError::System { path, source }
    };
    match fs::read_to_string(&file) {
        Ok(earlier) if resume && earlier.trim() == command => {}
        Ok(earlier) if resume => {
            return Err(DirectoryError::Another {
                directory: directory.to_path_buf(),
                earlier: earlier.trim().to_owned(),
            });
        }
        Ok(_) => {
            return Err(DirectoryError::Taken { directory: directory.to_path_buf() });
        }
        Err(_) => {
            fs::create_dir_all(directory).map_err(system(directory))?;
            fs::write(&file, format!("{command}\n")).map_err(system(&file))?;
        }
    }
    fs::canonicalize(directory).map_err(system(directory))
}

/// Write the page of the results into `directory`. Returns its path.
///
/// # Errors
/// The file cannot be written.
pub fn save_page(directory: &Path, page: &str) -> Result<PathBuf, FileError> {
    let file = directory.join(PAGE_FILE);
    fs::write(&file, page).map_err(FileError::of("write", &file))?;
    Ok(file)
}
