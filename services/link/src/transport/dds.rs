//! Topics of ROS 2: one participant of a DDS domain that reads what the robot publishes and writes what it is told.
//!
//! A piece that is received is one message: the row of its topic in [`Topics`] and its payload with its encapsulation, not decoded.
//! Readers are best-effort and volatile, so they match every publisher. Between calls the library keeps at most [`DEPTH`] messages of
//! a topic, and older ones are dropped. Its threads ring the descriptor; no call here waits.

use std::{
    collections::BTreeMap,
    convert::Infallible,
    env, fmt, io,
    net::Ipv4Addr,
    os::fd::{AsFd, BorrowedFd, OwnedFd},
    sync::Arc,
    task::{Wake, Waker},
};

use ros2_driver::topics::{Topic, Topics};
use rustdds::{
    DomainParticipant, DomainParticipantBuilder, Duration, GUID, QosPolicies, QosPolicyBuilder,
    RTPSEntity as _, RepresentationIdentifier, StatusEvented as _, TopicKind,
    bytes::Bytes,
    dds::statusevents::DomainParticipantStatusEvent,
    no_key::{
        DataWriter, Decode, DefaultDecoder, DeserializerAdapter, SerializerAdapter,
        SimpleDataReader,
    },
    policy::{Durability, History, Reliability},
};
use rustix::{
    event::{EventfdFlags, eventfd},
    io::{read, write},
};

use super::counts::Tally;

/// So many messages of a topic wait at most.
const DEPTH: i32 = 16;
/// The longest message, bytes.
const LONGEST: usize = 65_535;
/// Another writer of commands is one after so long. The stop guard of an earlier link leaves sooner.
const STAYS_NS: u64 = 2_000_000_000;
/// So many other writers are followed.
const MOST_WRITERS: usize = 16;

/// A message as DDS delivers it.
type Payload = Vec<u8>;

/// Takes payloads as they are.
#[derive(Clone, Copy)]
struct Raw;

impl DeserializerAdapter<Payload> for Raw {
    type Error = Infallible;
    type Decoded = Payload;

    fn supported_encodings() -> &'static [RepresentationIdentifier] {
        use RepresentationIdentifier as Encoding;
        // The driver refuses what it does not decode, with its reason.
        const { &[Encoding::CDR_LE, Encoding::CDR_BE, Encoding::CDR2_LE, Encoding::CDR2_BE] }
    }

    fn transform_decoded(payload: Payload) -> Payload {
        payload
    }
}

impl DefaultDecoder<Payload> for Raw {
    type Decoder = Self;
    const DECODER: Self = Self;
}

impl Decode<'_, Payload> for Raw {
    type Error = Infallible;

    fn decode_bytes(
        self,
        bytes: &[u8],
        as_: RepresentationIdentifier,
    ) -> Result<Payload, Infallible> {
        // An oversized message is cut, and the driver refuses it.
        let bytes = bytes.get(..LONGEST).unwrap_or(bytes);
        Ok([&as_.to_bytes()[..], &[0, 0], bytes].concat())
    }
}

impl SerializerAdapter<Payload> for Raw {
    type Error = Infallible;

    fn output_encoding() -> RepresentationIdentifier {
        RepresentationIdentifier::CDR_LE
    }

    fn to_bytes(payload: &Payload) -> Result<Bytes, Infallible> {
        // The library writes the encapsulation itself.
        Ok(Bytes::copy_from_slice(payload.get(4..).unwrap_or_default()))
    }
}

/// Makes a descriptor readable.
struct Bell(OwnedFd);

impl Wake for Bell {
    fn wake(self: Arc<Self>) {
        // It fails when the descriptor has been rung very often, and is readable then.
        let _ = write(&self.0, &1_u64.to_ne_bytes());
    }
}

/// Another writer of commands.
struct OtherWriter {
    since_ns: u64,
    is_told: bool,
}

/// A participant for one robot.
pub(super) struct Dds {
    /// The readers, in the order of the topics' rows.
    readers: Vec<SimpleDataReader<Payload, Raw>>,
    writer: DataWriter<Payload, Raw>,
    commands: Topic,
    others: BTreeMap<GUID, OtherWriter>,
    rung: OwnedFd,
    bell: Waker,
    /// The row of the reader that is asked next, so that a flood on one topic does not hold back the others.
    next: usize,
    tally: Tally,
    participant: DomainParticipant,
}

impl Dds {
    /// A participant of `domain` for the robot with these topics.
    pub(super) fn open(domain: u16, topics: &Topics) -> io::Result<Self> {
        let mut builder = DomainParticipantBuilder::new(domain);
        if is_local() {
            builder = builder.with_only_networks([Ipv4Addr::LOCALHOST]);
        }
        let participant = builder.build().map_err(io::Error::other)?;
        let rung = eventfd(0, EventfdFlags::NONBLOCK | EventfdFlags::CLOEXEC)?;
        let bell = Waker::from(Arc::new(Bell(rung.try_clone()?)));
        let heard = quality(Reliability::BestEffort, DEPTH);
        let subscriber = participant.create_subscriber(&heard).map_err(io::Error::other)?;
        let mut readers = Vec::new();
        for (_, topic) in &topics.heard {
            let topic = topic_of(&participant, topic, &heard)?;
            let reader = subscriber
                .create_simple_datareader_no_key(&topic, Some(heard.clone()))
                .map_err(io::Error::other)?;
            reader.set_waker(Some(bell.clone()));
            readers.push(reader);
        }
        let told = quality(Reliability::Reliable { max_blocking_time: Duration::ZERO }, 1);
        let publisher = participant.create_publisher(&told).map_err(io::Error::other)?;
        let topic = topic_of(&participant, &topics.command, &told)?;
        let writer =
            publisher.create_datawriter_no_key(&topic, Some(told)).map_err(io::Error::other)?;
        Ok(Self {
            readers,
            writer,
            commands: topics.command.clone(),
            others: BTreeMap::new(),
            rung,
            bell,
            next: 0,
            tally: Tally::default(),
            participant,
        })
    }

    pub(super) const fn is_open(&self) -> bool {
        true
    }

    /// Copy the next message into `buffer`, after the row of its topic. Returns its length, or none if all were taken.
    pub(super) fn receive(&mut self, buffer: &mut [u8]) -> Option<usize> {
        // The bell is reset before the readers are asked, so that it rings for what comes after they said that they have nothing.
        let _ = read(&self.rung, &mut [0_u8; 8]);
        let count = self.readers.len();
        for turn in 0..count {
            let row = (self.next + turn) % count;
            let Some(message) = self.take(row) else {
                continue;
            };
            self.next = (row + 1) % count;
            let payload = &message;
            let length = (payload.len() + 1).min(buffer.len());
            let (first, rest) = buffer.get_mut(..length)?.split_first_mut()?;
            *first = row as u8;
            rest.copy_from_slice(&payload[..length - 1]);
            return Some(length);
        }
        None
    }

    /// The next message of the topic in `row`.
    fn take(&self, row: usize) -> Option<Payload> {
        let reader = self.readers.get(row)?;
        reader.set_waker(Some(self.bell.clone()));
        reader.drain_read_notifications();
        // A message in an encoding that is unknown here is an error, and the next may be another.
        (0..DEPTH).find_map(|_| match reader.try_take_one() {
            Ok(message) => Some(message.map(|message| message.sample)),
            Err(_) => None,
        })?
    }

    /// Send a payload. It is lost if the library does not accept it now.
    pub(super) fn send(&mut self, payload: &[u8]) {
        // A driver has nothing to send where topics need no greeting.
        if !payload.is_empty() && self.writer.write(payload.to_vec(), None).is_err() {
            self.tally.unsent += 1;
        }
    }

    pub(super) const fn tally(&self) -> Tally {
        self.tally
    }

    /// Warn once of each other writer that stays on the topic of commands.
    pub(super) fn look_for_other_writers(&mut self, now_ns: u64) {
        let own = self.participant.guid().prefix;
        let events = self.participant.status_listener();
        while let Some(event) = events.try_recv_status() {
            match event {
                DomainParticipantStatusEvent::WriterDetected { writer }
                    if writer.topic_name == self.commands.dds_name()
                        && writer.guid.prefix != own
                        && self.others.len() < MOST_WRITERS =>
                {
                    let seen = OtherWriter { since_ns: now_ns, is_told: false };
                    self.others.entry(writer.guid).or_insert(seen);
                }
                DomainParticipantStatusEvent::WriterLost { guid, .. } => {
                    self.others.remove(&guid);
                }
                _ => {}
            }
        }
        let topic = &self.commands.name;
        for (guid, other) in &mut self.others {
            if !other.is_told && now_ns.saturating_sub(other.since_ns) >= STAYS_NS {
                other.is_told = true;
                tracing::warn!(
                    topic,
                    ?guid,
                    "another node publishes what the robot is told; end it"
                );
            }
        }
    }
}

/// What a participant demands and offers.
fn quality(reliability: Reliability, depth: i32) -> QosPolicies {
    QosPolicyBuilder::new()
        .reliability(reliability)
        .durability(Durability::Volatile)
        .history(History::KeepLast { depth })
        .build()
}

fn topic_of(
    participant: &DomainParticipant,
    topic: &Topic,
    quality: &QosPolicies,
) -> io::Result<rustdds::Topic> {
    let (name, type_name) = (topic.dds_name(), topic.type_name.to_owned());
    participant.create_topic(name, type_name, quality, TopicKind::NoKey).map_err(io::Error::other)
}

/// Whether the environment keeps ROS on this machine.
fn is_local() -> bool {
    let is = |name: &str, value: &str| env::var(name).is_ok_and(|set| set == value);
    is("ROS_LOCALHOST_ONLY", "1") || is("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
}

impl AsFd for Dds {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.rung.as_fd()
    }
}

impl fmt::Debug for Dds {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Dds").field("commands", &self.commands).finish_non_exhaustive()
    }
}
