//! The step of a stage: the one trait that every stage implements.
//!
//! A stage is two parts. Its *step* is pure: no shared memory, socket, file, thread or clock. Its *shell*
//! (a [`Process`](crate::shell::Process)) reads topics, calls the step with what it read, saves the step's state, and
//! publishes what the step returned. The step is the part that a test, a fuzzer or a replay drives; it cannot tell
//! which of them it is called by.
//!
//! # What a step may depend on
//! Three things, and nothing else:
//! - the mission, given once to [`Step::new`];
//! - its state, given to [`Step::restore`] when an earlier process of the stage saved one;
//! - its inputs, in the order in which [`Step::step`] takes them, each with the mission time it belongs to.
//!
//! So the same mission, state and inputs give the same outputs to the bit, on any machine. Whatever else a stage
//! needs is made an input: a reading of the machine's clock (the link's), the result of a computation on another
//! thread (the planner's background solve), a random seed (the mission's).
//!
//! # The stages
//!
//! | stage | input | output | state |
//! |---|---|---|---|
//! | `link` | datagram, open or closed wire, command, directive, passing time | datagrams, samples, decisions | next tick |
//! | `dead-reckoning` | wheel counts | pose | pose and the counts it was computed at |
//! | `mapper` | pose with range, reset, fault | the window of the grid that changed | the whole belief |
//! | `planner` | grid part, pose, solved job, fault | guidance, job for the background solver | none: the next keyframe has all |
//! | `controller` | guidance | command | none |
//!
//! # A step of your own
//! This stage measures how far the robot has gone, and its process is replaced by another:
//!
//! ```
//! use std::path::Path;
//! use common::{clock::MissionTime, mission::Mission, samples::PoseSample, step::{ForeignState, Step}};
//! use serde::{Deserialize, Serialize};
//!
//! /// What the next process needs to go on.
//! #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
//! struct State {
//!     last: Option<[f64; 2]>,
//!     way_m: f64,
//! }
//!
//! struct Odometer {
//!     state: State,
//! }
//!
//! impl Step for Odometer {
//!     type Input<'a> = &'a PoseSample;
//!     /// Metres since the start.
//!     type Output = f64;
//!     type State = State;
//!
//!     fn new(_: &Mission) -> Self {
//!         Self { state: State::default() }
//!     }
//!
//!     fn state(&self) -> &State {
//!         &self.state
//!     }
//!
//!     fn restore(&mut self, state: State) -> Result<(), ForeignState> {
//!         self.state = state;
//!         Ok(())
//!     }
//!
//!     fn step(&mut self, pose: &PoseSample, _: MissionTime) -> f64 {
//!         let here = [pose.x_m, pose.y_m];
//!         if let Some([x, y]) = self.state.last.replace(here) {
//!             self.state.way_m += (here[0] - x).hypot(here[1] - y);
//!         }
//!         self.state.way_m
//!     }
//! }
//!
//! let mission = Mission::parse("target = [3, 0]", Path::new("m.toml"))?;
//! let at = |x_m: f64| PoseSample { x_m, ..PoseSample::default() };
//! let mut first = Odometer::new(&mission);
//! first.step(&at(0.0), MissionTime(0));
//! assert_eq!(first.step(&at(0.5), MissionTime(143_000_000)), 0.5);
//!
//! // The process was killed; its successor restores what was saved.
//! let mut second = Odometer::new(&mission);
//! second.restore(first.state().clone())?;
//! assert_eq!(second.step(&at(0.75), MissionTime(286_000_000)), 0.75);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use serde::{Serialize, de::DeserializeOwned};
use thiserror::Error;

use crate::{clock::MissionTime, mission::Mission};

/// The pure part of a stage. See the [module](self) for what it may depend on.
pub trait Step: Sized {
    /// One thing that happened: a sample of a topic, or an enum where a stage takes more than one kind. It may borrow
    /// from shared memory for the length of the call.
    type Input<'a>;

    /// The result of one input: samples to publish (without stamps, which the writer fills in), requests to the process, or
    /// the reason why there is no result.
    type Output;

    /// The state that must survive the process, because it cannot be recomputed from the topics that a new process reads; `()`
    /// if there is none.
    type State: Serialize + DeserializeOwned;

    /// The step at the start of `mission`, before any input.
    fn new(mission: &Mission) -> Self;

    /// The state to save after a step.
    fn state(&self) -> &Self::State;

    /// Go on from the state that an earlier process of the same mission saved. Called at most once, before the first input.
    ///
    /// # Errors
    /// When the state cannot be of this mission. Then the step stays as [`Step::new`] created it.
    fn restore(&mut self, state: Self::State) -> Result<(), ForeignState>;

    /// Take one input at mission time `now`. An input that was taken before (a tick that is given again) must not
    /// count twice.
    fn step(&mut self, input: Self::Input<'_>, now: MissionTime) -> Self::Output;
}

/// A state that was saved by a step of another mission.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
#[error("the saved state is of another mission; the stage starts without it")]
pub struct ForeignState;
