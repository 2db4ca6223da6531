//! State of a robot as one value, for dashboards, bridges and reports. Each lists the topics that
//! it reads.
//!
//! A [`Feed`] reads [`Sample`]s from a robot's bus; [`Sample::decoded`] reads them from a
//! recording. [`RobotState::apply`] takes either.
//!
//! The guide's page `attach.md` has a dashboard, compiled with this crate's doc tests.

mod events;
mod sample;
mod state;
mod words;

use std::path::PathBuf;

use common::{domain::Domain, run::Run};

pub use self::{
    events::{Event, Kind},
    sample::{Feed, Sample, TOPICS},
    state::{RobotState, drop_every_second},
    words::{death_in_words, failsafe_in_words, guidance_in_words, words},
};

pub fn newest_run(domain: &Domain) -> Option<(PathBuf, Run)> {
    // The link changes when the next run begins.
    let directory = domain.run_directory().canonicalize().ok()?;
    let run = Run::load(&directory).ok()?;
    Some((directory, run))
}

/// Doc test of the guide's Rust.
#[cfg(doctest)]
#[doc = include_str!("../../guide/attach.md")]
pub struct Attach;
