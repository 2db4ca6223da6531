//! What can go wrong between a process and shared memory, each with its remedy.

use thiserror::Error;

/// What can go wrong between a process and shared memory.
#[derive(Debug, Error)]
pub enum BusError {
    /// The robot has no bus.
    #[error(
        "robot {robot:?} is not running here ({detail}); start it with `firsthand run`, or name another with --robot"
    )]
    NotRunning {
        /// The robot.
        robot: String,
        /// What was missing.
        detail: String,
    },
    /// Two builds that do not agree on a payload.
    #[error(
        "topic {topic:?} carries another payload than this program was built for; build it against the firsthand that runs (`firsthand --version`)"
    )]
    Incompatible {
        /// The topic.
        topic: &'static str,
    },
    /// The middleware refused.
    #[error("cannot {action} topic {topic:?}: {detail}; is {shm} full, or the topic's last place taken?", shm = crate::domain::SHARED_MEMORY)]
    Refused {
        /// What was tried.
        action: &'static str,
        /// The topic.
        topic: &'static str,
        /// The middleware's word.
        detail: String,
    },
    /// The process could not join the domain.
    #[error("cannot join the bus of robot {robot:?}: {detail}; if it runs, is it this user's, and is {shm} writable and not full?", shm = crate::domain::SHARED_MEMORY)]
    Join {
        /// The robot.
        robot: String,
        /// The middleware's word.
        detail: String,
    },
    /// Waiting failed.
    #[error("cannot wait for samples: {0}")]
    Wait(#[source] std::io::Error),
}
