//! A type for each message in the files of `interfaces`, and the releases of ROS that differ in them. `build.rs` writes them.

// Nobody reads what is written.
#![allow(clippy::derivable_impls, clippy::possible_missing_else, clippy::unnecessary_cast)]

use crate::cdr::{Cdr, LONGEST_TEXT, Malformed, Pass};

include!(concat!(env!("OUT_DIR"), "/msg.rs"));

#[cfg(test)]
mod tests;
