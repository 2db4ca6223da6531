//! The directory of an evaluation: a new one, or that of the same evaluation to go on with.

use std::{
    fs, io,
    path::{Path, PathBuf},
};

use thiserror::Error;

/// In the directory: the command that gives its rows.
const PLAN_FILE: &str = "plan.txt";
/// In the directory: the page of results.
pub const PAGE_FILE: &str = "index.html";

/// Why a directory cannot be used.
#[derive(Debug, Error)]
pub enum DirectoryError {
    /// What is to be gone on with was another.
    #[error("--resume: what was begun in {} was another: {earlier}", directory.display())]
    Another {
        /// The directory.
        directory: PathBuf,
        /// Its command.
        earlier: String,
    },
    /// There is something, and nothing was said of going on with it.
    #[error("{} holds results; go on with them with --resume, or give another --out", directory.display())]
    Taken {
        /// The directory.
        directory: PathBuf,
    },
    /// The file system.
    #[error("cannot use {} for results: {source}; give another --out", path.display())]
    System {
        /// What was to be made or written.
        path: PathBuf,
        /// The system's word.
        source: io::Error,
    },
}

/// `directory` for the rows of `command`, made if it is not there. Returns it as an absolute path.
///
/// # Errors
/// When it holds results and `resume` is not set, or those of another command, or cannot be written.
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
            return Err(DirectoryError::Taken {
                directory: directory.to_path_buf(),
            });
        }
        Err(_) => {
            fs::create_dir_all(directory).map_err(system(directory))?;
            fs::write(&file, format!("{command}\n")).map_err(system(&file))?;
        }
    }
    fs::canonicalize(directory).map_err(system(directory))
}
