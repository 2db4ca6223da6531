//! The declaration of what a stage's process opens on the bus and what it persists. The table of stages refers to it, and the
//! process opens through it: a topic that is not listed is refused, and one that is listed and not opened ends the process.

use std::fmt;

use thiserror::Error;

use crate::{
    bus::AnyTopic,
    topics::{FAULTS, HEALTH, INPUTS, ROSTER},
};

/// Rows of the table of topics.
pub type Topics = &'static [&'static dyn AnyTopic];

/// Every stage's process also reads the requests of faults, and the roster, which names the processes that it admits.
pub static EVERY_STAGE_READS: Topics = &[&FAULTS, &ROSTER];
/// Every stage's process also writes its heartbeats, and the inputs of its step.
pub static EVERY_STAGE_WRITES: Topics = &[&HEALTH, &INPUTS];

/// The topics that a stage reads, is woken by and writes, and the state that it persists.
pub struct Wiring {
    /// The stage's name: of the process, of `firsthand stage NAME`, of the folder under `services/`.
    pub stage: &'static str,
    /// Topics it reads, whose writers start before it.
    pub inputs: Topics,
    /// Topics it reads whose writers start after it: those that close the loop, and those that consumers write.
    pub feedback: Topics,
    /// Topics that start a turn of its work loop.
    pub wakes: Topics,
    /// Topics that it alone writes. The last one that is published each tick answers the tick. Topics that follow each frame
    /// of the robot are opened after the first heartbeat that says ready.
    pub outputs: Topics,
    pub persists: Persists,
}

/// The state that a stage's next process goes on from, in the file `STAGE.checkpoint` of the run's directory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Persists {
    /// Nothing is persisted: the next inputs bring everything.
    Nothing,
    /// The state, of at most so many bytes, is saved after each step.
    State(usize),
    /// The inputs since a snapshot are saved. The mission says how large a snapshot is.
    Journal,
}

/// How a process opens a topic.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    Read,
    Write,
}

impl fmt::Display for Access {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        to.write_str(match self {
            Self::Read => "reading",
            Self::Write => "writing",
        })
    }
}

impl Wiring {
    /// A stage that opens and persists nothing: declarations start from it.
    pub const fn of(stage: &'static str) -> Self {
        Self {
            stage,
            inputs: &[],
            feedback: &[],
            wakes: &[],
            outputs: &[],
            persists: Persists::Nothing,
        }
    }

    /// The names of the topics that it opens for `access`.
    pub fn listed(&self, access: Access) -> impl Iterator<Item = &'static str> {
        let (first, second): (Topics, Topics) = match access {
            Access::Read => (self.inputs, self.feedback),
            Access::Write => (self.outputs, &[]),
        };
        first.iter().chain(second).map(|topic| topic.spec().name)
    }
}

/// The topics of its wiring that a process has opened.
pub(crate) struct Opened {
    pub(crate) wiring: &'static Wiring,
    topics: Vec<(Access, &'static str)>,
}

/// A process opens something else than its wiring lists.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
pub enum WiringError {
    /// The process opens a topic that is not listed.
    #[error("topic {1} is opened for {0} and not in the wiring of the stage; list it there")]
    NotListed(Access, &'static str),
    /// The process has not opened a topic that is listed.
    #[error("topic {1} is in the wiring of the stage for {0} and not opened; remove it there")]
    NotOpened(Access, &'static str),
}

impl Opened {
    pub(crate) const fn none_of(wiring: &'static Wiring) -> Self {
        Self { wiring, topics: Vec::new() }
    }

    /// Note that `topic` is opened, if it is listed.
    pub(crate) fn add(&mut self, access: Access, topic: &'static str) -> Result<(), WiringError> {
        if !self.wiring.listed(access).any(|listed| listed == topic) {
            return Err(WiringError::NotListed(access, topic));
        }
        self.topics.push((access, topic));
        Ok(())
    }

    /// An error where a listed topic is not opened.
    pub(crate) fn check_all(&self) -> Result<(), WiringError> {
        for access in [Access::Read, Access::Write] {
            let mut listed = self.wiring.listed(access);
            if let Some(topic) = listed.find(|topic| !self.topics.contains(&(access, topic))) {
                return Err(WiringError::NotOpened(access, topic));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::topics::{COMMAND, GUIDANCE, POSE};

    static WIRING: Wiring = Wiring {
        inputs: &[&GUIDANCE],
        feedback: &[&POSE],
        outputs: &[&COMMAND],
        ..Wiring::of("test")
    };

    #[test]
    fn a_topic_that_is_not_listed_is_refused() {
        let mut opened = Opened::none_of(&WIRING);
        assert_eq!(opened.add(Access::Read, "guidance"), Ok(()));
        let refused = opened.add(Access::Write, "guidance");
        assert_eq!(refused, Err(WiringError::NotListed(Access::Write, "guidance")));
        let refused = opened.add(Access::Read, "ranges");
        assert_eq!(refused, Err(WiringError::NotListed(Access::Read, "ranges")));
    }

    #[test]
    fn a_listed_topic_that_is_not_opened_is_found() {
        let mut opened = Opened::none_of(&WIRING);
        for (access, topic) in
            [(Access::Read, "guidance"), (Access::Write, "command"), (Access::Read, "pose")]
        {
            assert!(opened.check_all().is_err(), "before {topic}");
            opened.add(access, topic).unwrap();
        }
        assert_eq!(opened.check_all(), Ok(()));
    }
}
