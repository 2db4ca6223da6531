//! What can go wrong between a process and shared memory, each with its remedy.

use std::fmt::Debug;

use iceoryx2::service::builder::publish_subscribe::PublishSubscribeOpenError;
use thiserror::Error;

use crate::domain::SHARED_MEMORY;

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
    #[error("cannot {action} topic {topic:?}: {detail}; is {shm} full, `ulimit -n` reached, or the topic's last place taken?", shm = SHARED_MEMORY)]
    Refused {
        /// What was tried.
        action: &'static str,
        /// The topic.
        topic: &'static str,
        /// What the middleware reports.
        detail: String,
    },
    /// The process could not join the domain.
    #[error("cannot join the bus of robot {robot:?}: {detail}; if it runs, is it this user's, and is {shm} writable and not full?", shm = SHARED_MEMORY)]
    Join {
        /// The robot.
        robot: String,
        /// What the middleware reports.
        detail: String,
    },
    /// Waiting failed.
    #[error("cannot wait for samples: {0}")]
    Wait(#[source] std::io::Error),
}

pub(super) fn refused<E: Debug>(
    action: &'static str,
    topic: &'static str,
) -> impl FnOnce(E) -> BusError {
    move |detail| BusError::Refused {
        action,
        topic,
        detail: format!("{detail:?}"),
    }
}

pub(super) fn opening(topic: &'static str) -> impl FnOnce(PublishSubscribeOpenError) -> BusError {
    use PublishSubscribeOpenError as E;
    move |error| match error {
        E::IncompatibleTypes | E::VersionMismatch | E::ServiceInCorruptedState => {
            BusError::Incompatible { topic }
        }
        other => refused("open", topic)(other),
    }
}
