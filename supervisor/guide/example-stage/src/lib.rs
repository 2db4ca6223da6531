//! The stage that the page `add-a-stage.md` adds, so that its code is compiled and tested with the workspace.
//!
//! [`odometer`] stands on the page line by line; [`rows`] is what the page adds to `common`. Nothing depends on this crate: no
//! executable contains the stage.

pub mod odometer;
pub mod rows;

#[cfg(test)]
mod page;
