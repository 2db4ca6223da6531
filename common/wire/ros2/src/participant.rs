//! Participant of a DDS domain. Messages are undecoded payloads.
//!
//! The library's threads signal the participant's descriptor; calls here never wait.

use std::{
    collections::BTreeMap,
    convert::Infallible,
    env, fmt, io, mem,
    net::Ipv4Addr,
    os::fd::{AsFd, BorrowedFd, OwnedFd},
    sync::Arc,
    task::{Wake, Waker},
    time::{self, Instant},
};

use rustdds::{
    DataWriterStatus, DomainParticipant, DomainParticipantBuilder,
    DomainParticipantStatusEvent as Status, Duration, GUID, QosPolicies, QosPolicyBuilder,
    RTPSEntity as _, RepresentationIdentifier, StatusEvented as _, TopicKind, WriteOptionsBuilder,
    bytes::Bytes,
    no_key::{
        DataWriter, Decode, DefaultDecoder, DeserializerAdapter, SerializerAdapter,
        SimpleDataReader,
    },
    policy::{Durability, History, Reliability},
    rpc::SampleIdentity,
};
use rustix::{
    event::{EventfdFlags, eventfd},
    io::{read, write},
};
use serde::{Deserialize, Serialize};

use crate::{cdr::ENCAPSULATION, topic::Topic};

/// Longest message; the decoder rejects a truncated one. A map of 8192 x 8192 cells has 67 MB.
const LONGEST: usize = 1 << 27;
/// Longest reply that fits into a datagram.
const LONGEST_REPLY: usize = 65_000;
/// Undecodable messages skipped at a time.
const MOST_BROKEN: usize = 16;
/// Tracked writers of a [`LateReader`]'s topic; further ones do not open it.
const MOST_WRITERS: usize = 256;
/// Tracked readers of a [`Server`]'s replies. Replies to further ones wait for [`KNOWN_WITHIN`].
const MOST_READERS: usize = 256;
/// Waiting replies of a [`Server`]; the oldest of more is sent at once.
const MOST_UNSENT: usize = 64;
/// Time from a reader's detection until it hears replies. The library reports a reader before it
/// sends the first heartbeat, and readers ignore messages older than that.
const SETTLED: time::Duration = time::Duration::from_millis(100);
/// Longest wait of a reply for its reader. A starved participant takes seconds to know one.
const KNOWN_WITHIN: time::Duration = time::Duration::from_secs(10);

type Payload = Vec<u8>;
pub type Gid = [u8; 16];

#[derive(Clone, Copy, Debug)]
pub struct Quality {
    /// Lost messages are sent again.
    pub is_reliable: bool,
    /// A reader that joins later gets the newest messages.
    pub is_latched: bool,
    pub depth: u16,
}

impl Quality {
    fn policies(self) -> QosPolicies {
        let reliability = if self.is_reliable {
            Reliability::Reliable { max_blocking_time: Duration::ZERO }
        } else {
            Reliability::BestEffort
        };
        let durability =
            if self.is_latched { Durability::TransientLocal } else { Durability::Volatile };
        QosPolicyBuilder::new()
            .reliability(reliability)
            .durability(durability)
            .history(History::KeepLast { depth: self.depth.into() })
            .build()
    }
}

#[derive(Clone, Copy)]
struct Raw;

impl DeserializerAdapter<Payload> for Raw {
    type Error = Infallible;
    type Decoded = Payload;

    fn supported_encodings() -> &'static [RepresentationIdentifier] {
        use RepresentationIdentifier as Encoding;
        // The message decoder rejects other encodings with a reason.
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
        Ok([&as_.to_bytes()[..], &[0, 0], bytes.get(..LONGEST).unwrap_or(bytes)].concat())
    }
}

impl SerializerAdapter<Payload> for Raw {
    type Error = Infallible;

    fn output_encoding() -> RepresentationIdentifier {
        RepresentationIdentifier::CDR_LE
    }

    fn to_bytes(payload: &Payload) -> Result<Bytes, Infallible> {
        // The library writes the encapsulation itself.
        Ok(Bytes::copy_from_slice(payload.get(ENCAPSULATION..).unwrap_or_default()))
    }
}

struct Bell(OwnedFd);

impl Wake for Bell {
    fn wake(self: Arc<Self>) {
        // The write fails only on counter overflow, and the descriptor is readable then.
        let _ = write(&self.0, &1_u64.to_ne_bytes());
    }
}

pub struct Participant {
    inner: DomainParticipant,
    only: Option<Ipv4Addr>,
    rung: OwnedFd,
    bell: Waker,
}

impl Participant {
    /// Joins by the interface with the address `only`, else by all, or only on this machine if the
    /// ROS environment says so.
    pub fn join(domain: u16, only: Option<Ipv4Addr>) -> io::Result<Self> {
        let inner = joined(domain, only)?;
        let rung = eventfd(0, EventfdFlags::NONBLOCK | EventfdFlags::CLOEXEC)?;
        let bell = Waker::from(Arc::new(Bell(rung.try_clone()?)));
        Ok(Self { inner, only, rung, bell })
    }

    /// Rejoins with the same descriptor; earlier readers and writers become useless.
    ///
    /// The library's threads end silently if a call is interrupted, as when the process is stopped
    /// and continued.
    pub fn rejoin(&mut self) -> io::Result<()> {
        self.inner = joined(self.inner.domain_id(), self.only)?;
        Ok(())
    }

    pub fn reader(&self, topic: &Topic, quality: Quality) -> io::Result<Reader> {
        let policies = quality.policies();
        let subscriber = self.inner.create_subscriber(&policies).map_err(io::Error::other)?;
        let topic = self.topic(topic, &policies)?;
        let reader = subscriber
            .create_simple_datareader_no_key(&topic, Some(policies))
            .map_err(io::Error::other)?;
        reader.set_waker(Some(self.bell.clone()));
        Ok(Reader { inner: reader, bell: self.bell.clone() })
    }

    /// Returns a [`LateReader`], which joins the same domain.
    pub fn late_reader(&self, topic: Topic, quality: Quality) -> io::Result<LateReader> {
        let participant = Self::join(self.inner.domain_id(), self.only)?;
        Ok(LateReader { participant, topic, quality, writers: Writers::default(), reader: None })
    }

    pub fn writer(&self, topic: &Topic, quality: Quality) -> io::Result<Writer> {
        let policies = quality.policies();
        let publisher = self.inner.create_publisher(&policies).map_err(io::Error::other)?;
        let topic = self.topic(topic, &policies)?;
        let writer = publisher.create_datawriter_no_key(&topic, Some(policies));
        writer.map(Writer).map_err(io::Error::other)
    }

    pub fn server(&self, [requests, replies]: [&Topic; 2], quality: Quality) -> io::Result<Server> {
        let requests = self.reader(requests, quality)?;
        let replies = self.writer(replies, quality)?;
        Ok(Server { requests, replies, readers: Readers::default(), unsent: Vec::new() })
    }

    fn topic(&self, topic: &Topic, policies: &QosPolicies) -> io::Result<rustdds::Topic> {
        self.inner
            .create_topic(topic.dds_name(), topic.type_name.clone(), policies, TopicKind::NoKey)
            .map_err(io::Error::other)
    }

    /// Resets the descriptor. Take from the readers afterwards: it signals only messages that come
    /// after a reader was empty.
    pub fn unring(&self) {
        let _ = read(&self.rung, &mut [0_u8; 8]);
    }

    pub fn bell(&self) -> Waker {
        self.bell.clone()
    }
}

/// Length of Cyclone DDS's request prefix, repeated in the reply: client and request numbers of 8
/// bytes each.
const CYCLONE_HEADER: usize = 16;

/// Identity of a request. Fast DDS sends it beside the message, by the standard; Cyclone DDS
/// inside. A later process may reply.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Request {
    identity: SampleIdentity,
    /// Repeated in the reply; empty for Fast DDS.
    header: Vec<u8>,
}

impl Request {
    pub fn without_header(&self, payload: &[u8]) -> Payload {
        let (encapsulation, rest) = payload.split_at(payload.len().min(ENCAPSULATION));
        [encapsulation, rest.get(self.header.len()..).unwrap_or_default()].concat()
    }
}

#[derive(Debug)]
pub struct Message {
    pub payload: Payload,
    pub from: Gid,
    pub request: Request,
}

pub struct Reader {
    inner: SimpleDataReader<Payload, Raw>,
    bell: Waker,
}

impl Reader {
    pub fn take(&self) -> Option<Message> {
        self.inner.set_waker(Some(self.bell.clone()));
        self.inner.drain_read_notifications();
        // A message in an unsupported encoding is an error, and so may be the next.
        let message = (0..MOST_BROKEN).find_map(|_| self.inner.try_take_one().ok())??;
        let asked = message.related_sample_identity();
        // A Fast DDS client names the waiting reader; the number is that of the request itself.
        let writer_guid = asked.map_or(message.writer_guid, |asked| asked.writer_guid);
        let after_encapsulation = message.sample.get(ENCAPSULATION..).unwrap_or_default();
        let header = match asked {
            Some(_) => &[],
            None => after_encapsulation.get(..CYCLONE_HEADER).unwrap_or_default(),
        };
        let identity = SampleIdentity { writer_guid, sequence_number: message.sequence_number };
        let request = Request { identity, header: header.to_vec() };
        Some(Message { from: message.writer_guid.to_bytes(), payload: message.sample, request })
    }

    /// Yields the messages; endless while a writer floods the topic.
    pub fn messages(&self) -> impl Iterator<Item = Message> {
        std::iter::from_fn(|| self.take())
    }
}

/// Writers of one topic, and whether each is lost. The library may report a lost writer again, so
/// lost writers stay until their places are needed.
#[derive(Debug, Default)]
struct Writers(BTreeMap<GUID, bool>);

impl Writers {
    fn on_detected(&mut self, writer: GUID) {
        if self.0.contains_key(&writer) {
            return;
        }
        if self.0.len() >= MOST_WRITERS {
            self.0.retain(|_, is_lost| !*is_lost);
        }
        if self.0.len() < MOST_WRITERS {
            self.0.insert(writer, false);
        }
    }

    fn on_lost(&mut self, lost: impl Fn(GUID) -> bool) {
        let writers = self.0.iter_mut().filter(|(writer, _)| lost(**writer));
        writers.for_each(|(_, is_lost)| *is_lost = true);
    }

    fn has_one(&self) -> bool {
        self.0.values().any(|is_lost| !is_lost)
    }
}

/// Reader for messages that a node publishes once.
///
/// A node publishes when it knows a reader, but the library drops messages of writers that it does
/// not know yet. Fast DDS repeats them after its heartbeat period of 3 s, too late for
/// `ros2 topic pub --once`. This reader therefore opens only once its writer is known.
///
/// Nodes that join later also see a participant's closed readers. This reader therefore has a
/// separate participant, and rejoins after its last writer. It misses messages within a millisecond
/// after the node knows it, or while another writer keeps it open.
#[derive(Debug)]
pub struct LateReader {
    participant: Participant,
    topic: Topic,
    quality: Quality,
    writers: Writers,
    reader: Option<Reader>,
}

impl LateReader {
    /// Opens or closes the reader, and returns at most `most` messages.
    pub fn take(&mut self, most: usize) -> io::Result<Vec<Message>> {
        let listener = self.participant.inner.status_listener();
        while let Some(status) = listener.try_recv_status() {
            match status {
                Status::WriterDetected { writer } if writer.topic_name == self.topic.dds_name() => {
                    self.writers.on_detected(writer.guid);
                }
                Status::WriterLost { guid, .. } => self.writers.on_lost(|writer| writer == guid),
                Status::ParticipantLost { id, .. } => {
                    self.writers.on_lost(|writer| writer.prefix == id);
                }
                _ => {}
            }
        }
        let is_written = self.writers.has_one();
        if self.reader.is_none() && is_written {
            self.reader = Some(self.participant.reader(&self.topic, self.quality)?);
        }
        let messages: Vec<_> = self.reader.iter().flat_map(Reader::messages).take(most).collect();
        if messages.is_empty() && !is_written && self.reader.take().is_some() {
            self.writers = Writers::default();
            self.participant.rejoin()?;
        }
        Ok(messages)
    }
}

pub struct Writer(DataWriter<Payload, Raw>);

impl Writer {
    /// Returns whether the library took it.
    pub fn write(&self, payload: Payload) -> bool {
        self.0.write(payload, None).is_ok()
    }
}

/// Readers of a [`Server`]'s replies, and when each became known.
#[derive(Debug, Default)]
struct Readers(BTreeMap<GUID, Instant>);

impl Readers {
    fn on_matched(&mut self, reader: GUID, is_lost: bool) {
        if is_lost {
            self.0.remove(&reader);
        } else if self.0.len() < MOST_READERS {
            self.0.insert(reader, Instant::now());
        }
    }

    fn hears(&self, client: GUID, now: Instant) -> bool {
        self.0.iter().any(|(reader, since)| {
            reader.prefix == client.prefix && now.saturating_duration_since(*since) >= SETTLED
        })
    }
}

/// Service of a node.
///
/// A reply reaches only readers that the library knows. A client may ask before its own reader is
/// known here, so a reply waits for that reader.
#[derive(Debug)]
pub struct Server {
    pub requests: Reader,
    pub replies: Writer,
    readers: Readers,
    /// Oldest first.
    unsent: Vec<(Instant, SampleIdentity, Payload)>,
}

impl Server {
    pub fn take(&mut self, most: usize) -> Vec<Message> {
        self.send();
        self.requests.messages().take(most).collect()
    }

    /// Replies as soon as the library knows the client's reader, or after [`KNOWN_WITHIN`]. Drops a
    /// reply that fits into no datagram.
    pub fn reply(&mut self, to: &Request, payload: &[u8]) {
        let (encapsulation, rest) = payload.split_at(payload.len().min(ENCAPSULATION));
        let payload = [encapsulation, &to.header, rest].concat();
        if payload.len() <= LONGEST_REPLY {
            self.unsent.push((Instant::now(), to.identity, payload));
            self.send();
        }
    }

    fn send(&mut self) {
        while let Some(status) = self.replies.0.try_recv_status() {
            if let DataWriterStatus::PublicationMatched { reader, current, .. } = status {
                self.readers.on_matched(reader, current.count_change() < 0);
            }
        }
        let surplus = self.unsent.len().saturating_sub(MOST_UNSENT);
        for (place, (since, to, payload)) in mem::take(&mut self.unsent).into_iter().enumerate() {
            let is_known = self.readers.hears(to.writer_guid, Instant::now());
            if !is_known && place >= surplus && since.elapsed() < KNOWN_WITHIN {
                self.unsent.push((since, to, payload));
                continue;
            }
            let options = WriteOptionsBuilder::new().related_sample_identity(to).build();
            let _ = self.replies.0.write_with_options(payload, options);
        }
    }
}

fn joined(domain: u16, only: Option<Ipv4Addr>) -> io::Result<DomainParticipant> {
    let mut builder = DomainParticipantBuilder::new(domain);
    if let Some(only) = only.or_else(|| is_local().then_some(Ipv4Addr::LOCALHOST)) {
        builder = builder.with_only_networks([only]);
    }
    builder.build().map_err(io::Error::other)
}

fn is_local() -> bool {
    let is = |name: &str, value: &str| env::var(name).is_ok_and(|set| set == value);
    is("ROS_LOCALHOST_ONLY", "1") || is("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
}

impl AsFd for Participant {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.rung.as_fd()
    }
}

macro_rules! named_by_guid {
    ($($name:ident.$inner:tt)*) => {$(
        impl $name {
            pub fn gid(&self) -> Gid {
                self.$inner.guid().to_bytes()
            }
        }

        impl fmt::Debug for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, "{} {:?}", stringify!($name), self.$inner.guid())
            }
        }
    )*};
}

named_by_guid! { Participant.inner Reader.inner Writer.0 }

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_client_hears_a_reply_once_its_reader_is_known_for_a_moment_and_until_it_is_lost() {
        let [reader, client, other] =
            [1_u128, 2, 1 << 120].map(|number| GUID::from_bytes(number.to_be_bytes()));
        let mut readers = Readers::default();
        let hears =
            |readers: &Readers, client, after| readers.hears(client, Instant::now() + after);
        assert!(!hears(&readers, client, SETTLED));
        readers.on_matched(reader, false);
        // A heartbeat may follow the report.
        assert!(!readers.hears(client, Instant::now()));
        assert!(hears(&readers, client, SETTLED) && !hears(&readers, other, SETTLED));
        readers.on_matched(reader, true);
        assert!(!hears(&readers, client, SETTLED));
    }

    #[test]
    fn writers_that_came_and_went_take_no_later_writers_place() {
        let guid = |number: usize| GUID::from_bytes((number as u128).to_be_bytes());
        let mut writers = Writers::default();
        for number in 0..MOST_WRITERS {
            writers.on_detected(guid(number));
            writers.on_lost(|writer| writer == guid(number));
            // The library reports it again.
            writers.on_detected(guid(number));
        }
        assert!(!writers.has_one());
        writers.on_detected(guid(MOST_WRITERS));
        assert!(writers.has_one());
    }
}
