//! Types of the messages in `interfaces`, and the ROS releases that differ in them, written by
//! `build.rs`.

// Generated code.
#![allow(clippy::derivable_impls, clippy::possible_missing_else, clippy::unnecessary_cast)]

use crate::cdr::{Cdr, LONGEST_TEXT, Malformed, Pass};

include!(concat!(env!("OUT_DIR"), "/msg.rs"));

#[cfg(test)]
mod tests;
