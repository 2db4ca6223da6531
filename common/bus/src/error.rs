use std::fmt::Debug;

use iceoryx2::{
    port::{ReceiveError, subscriber::SubscriberCreateError},
    service::builder::publish_subscribe::PublishSubscribeOpenError,
};
use thiserror::Error;

use super::spec::Spec;
use crate::{bus_instance::VERSION, domain::SHARED_MEMORY};

pub(crate) type Result<T = (), E = BusError> = std::result::Result<T, E>;

#[derive(Debug, Error)]
pub enum BusError {
    #[error(
        "robot {robot:?} is not running here ({detail}); start it with `firsthand run`, or name another with --robot"
    )]
    NotRunning { robot: String, detail: String },
    #[error(
        "robot {robot} runs firsthand {runs}, but this is {VERSION}; use the commands of that version (`firsthand stop` works with all versions)"
    )]
    OtherVersion { robot: String, runs: String },
    #[error(
        "topic {topic:?} carries another payload than this program expects; build the program against the running firsthand (`firsthand --version`)"
    )]
    Incompatible { topic: &'static str },
    #[error(
        "topic {topic:?} has places for {places} readers, and all places for consumers are taken; end another reader, or share one reader"
    )]
    NoPlace {
        topic: &'static str,
        /// Number of places, including those reserved for stages.
        places: usize,
    },
    #[error(
        "this reader holds {most} samples of topic {topic:?}, its limit; drop one before you take the next (the writer does not wait: it overwrites the oldest sample that you have not taken)"
    )]
    HoldsTooMany { topic: &'static str, most: usize },
    #[error(
        "{SHARED_MEMORY} has no memory left for a sample of topic {topic:?}; remove files from it, or end the frozen reader that holds samples"
    )]
    NoMemory { topic: &'static str },
    #[error("cannot {action} topic {topic:?}: {detail}; check whether {shm} is full, `ulimit -n` is reached, or the topic's last place is taken", shm = SHARED_MEMORY)]
    Refused { action: &'static str, topic: &'static str, detail: String },
    #[error("cannot join the bus of robot {robot:?}: {detail}; check that this user started the robot, and that {shm} is writable and has space", shm = SHARED_MEMORY)]
    Join { robot: String, detail: String },
    #[error("cannot wait for samples: {0}")]
    Wait(#[source] std::io::Error),
}

pub(super) fn refused<E: Debug>(
    action: &'static str,
    topic: &'static str,
) -> impl FnOnce(E) -> BusError {
    move |detail| BusError::Refused { action, topic, detail: format!("{detail:?}") }
}

pub(super) fn reading(spec: &Spec) -> impl FnOnce(SubscriberCreateError) -> BusError {
    let topic = spec.name;
    let places = spec.limits.readers;
    move |error| match error {
        SubscriberCreateError::ExceedsMaxSupportedSubscribers => {
            BusError::NoPlace { topic, places }
        }
        other => refused("read", topic)(other),
    }
}

pub(super) fn taking(spec: &Spec) -> impl FnOnce(ReceiveError) -> BusError {
    let topic = spec.name;
    let most = spec.limits.borrowed;
    move |error| match error {
        ReceiveError::ExceedsMaxBorrows => BusError::HoldsTooMany { topic, most },
        other => refused("read", topic)(other),
    }
}

pub(super) fn opening(topic: &'static str) -> impl FnOnce(PublishSubscribeOpenError) -> BusError {
    use PublishSubscribeOpenError as E;
    move |error| match error {
        E::IncompatibleTypes
        | E::IncompatibleAttributes
        | E::VersionMismatch
        | E::ServiceInCorruptedState => BusError::Incompatible { topic },
        other => refused("open", topic)(other),
    }
}
