//! Set-ups of the tests.

use std::path::Path;

use common::mission::Mission;

pub(crate) fn mission(text: &str) -> Mission {
    Mission::parse(text, Path::new("test.toml")).unwrap()
}
