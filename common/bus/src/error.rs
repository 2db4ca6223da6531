//! Errors of the bus, each with its remedy.

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
        "robot {robot} runs firsthand {runs}, and this is {VERSION}: use the commands of that version; `firsthand stop` works all the same"
    )]
    OtherVersion { robot: String, runs: String },
    #[error(
        "topic {topic:?} carries another payload than this program was built for; build it against the firsthand that runs (`firsthand --version`)"
    )]
    Incompatible { topic: &'static str },
    #[error(
        "topic {topic:?} has places for {places} readers, and those for consumers are taken; end one that reads it, or read it once and share it"
    )]
    NoPlace {
        topic: &'static str,
        /// Number of places, including those reserved for stages.
        places: usize,
    },
    #[error(
        "this reader holds {most} samples of topic {topic:?}, as many as one may; drop one before the next is taken (nobody waits for it: the oldest that is not taken is lost)"
    )]
    HoldsTooMany { topic: &'static str, most: usize },
    #[error(
        "{SHARED_MEMORY} has no memory left for a sample of topic {topic:?}; remove what fills it, or end the reader that is stopped and holds samples"
    )]
    NoMemory { topic: &'static str },
    #[error("cannot {action} topic {topic:?}: {detail}; is {shm} full, `ulimit -n` reached, or the topic's last place taken?", shm = SHARED_MEMORY)]
    Refused { action: &'static str, topic: &'static str, detail: String },
    #[error("cannot join the bus of robot {robot:?}: {detail}; if it runs, is it this user's, and is {shm} writable and not full?", shm = SHARED_MEMORY)]
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
    let (topic, places) = (spec.name, spec.limits.readers);
    move |error| match error {
        SubscriberCreateError::ExceedsMaxSupportedSubscribers => {
            BusError::NoPlace { topic, places }
        }
        other => refused("read", topic)(other),
    }
}

pub(super) fn taking(spec: &Spec) -> impl FnOnce(ReceiveError) -> BusError {
    let (topic, most) = (spec.name, spec.limits.borrowed);
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
