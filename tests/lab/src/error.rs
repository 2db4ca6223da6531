//! Failures of the laboratory: sentences that name the input and the remedy.

use std::{fmt::Display, path::Path};

pub use console::failure::{Failure, Result, refuse};

pub trait OrCannot<T>: Sized {
    fn or_cannot(self, action: &str) -> Result<T>;

    fn or_cannot_file(self, action: &str, file: &Path) -> Result<T> {
        self.or_cannot(&format!("{action} {}", file.display()))
    }
}

impl<T, E: Display> OrCannot<T> for Result<T, E> {
    fn or_cannot(self, action: &str) -> Result<T> {
        self.map_err(|cause| format!("cannot {action}: {cause}").into())
    }
}
