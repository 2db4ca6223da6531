//! The stage that the page `add-a-stage.md` adds, so that its code is compiled and tested with the workspace.
//!
//! [`step`], [`replay`] and [`shell`] stand on the page line by line; [`rows`] is what the page adds to `common`. Nothing depends on
//! this crate: no executable contains the stage.

pub mod replay;
pub mod rows;
pub mod shell;
pub mod step;

#[cfg(test)]
mod page;
