//! Topics of ROS 2: what the robot publishes is read, and what it is told is written.
//!
//! A piece that is received is one message: the row of its topic in [`Topics`] and its payload. Readers are best-effort and volatile,
//! so they match every publisher. Between calls at most [`DEPTH`] messages of a topic are kept, and older ones are dropped.

use std::{
    collections::BTreeMap,
    io,
    os::fd::{AsFd, BorrowedFd},
};

use ros2::{
    participant::{Change, Gid, Participant, Quality, Reader, Writer},
    topic::Topic,
};
use ros2_driver::topics::Topics;

use super::counts::Tally;

/// So many messages of a topic wait at most.
const DEPTH: u16 = 16;
/// Another writer of commands is one after so long. The stop guard of an earlier link leaves sooner.
const STAYS_NS: u64 = 2_000_000_000;
/// So many other writers are followed.
const MOST_WRITERS: usize = 16;

/// Another writer of commands.
#[derive(Debug)]
struct OtherWriter {
    since_ns: u64,
    is_told: bool,
}

/// A participant for one robot.
#[derive(Debug)]
pub(super) struct Dds {
    /// The readers, in the order of the topics' rows.
    readers: Vec<Reader>,
    writer: Writer,
    commands: Topic,
    others: BTreeMap<Gid, OtherWriter>,
    /// The row of the reader that is asked next, so that a flood on one topic does not hold back the others.
    next: usize,
    tally: Tally,
    participant: Participant,
}

impl Dds {
    /// A participant of `domain` for the robot with these topics.
    pub(super) fn open(domain: u16, topics: &Topics) -> io::Result<Self> {
        let participant = Participant::join(domain, None)?;
        let heard = Quality { is_reliable: false, is_latched: false, depth: DEPTH };
        let readers = topics.heard.iter().map(|(_, topic)| participant.reader(topic, heard));
        let told = Quality { is_reliable: true, is_latched: false, depth: 1 };
        Ok(Self {
            readers: readers.collect::<io::Result<_>>()?,
            writer: participant.writer(&topics.command, told)?,
            commands: topics.command.clone(),
            others: BTreeMap::new(),
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
        self.participant.unring();
        let count = self.readers.len();
        for row in (0..count).map(|turn| (self.next + turn) % count) {
            let Some(message) = self.readers.get(row).and_then(Reader::take) else {
                continue;
            };
            self.next = (row + 1) % count;
            let length = (message.payload.len() + 1).min(buffer.len());
            let (first, rest) = buffer.get_mut(..length)?.split_first_mut()?;
            *first = row as u8;
            rest.copy_from_slice(&message.payload[..length - 1]);
            return Some(length);
        }
        None
    }

    /// Send a payload. It is lost if the library does not accept it now.
    pub(super) fn send(&mut self, payload: &[u8]) {
        // A driver has nothing to send where topics need no greeting.
        if !payload.is_empty() && !self.writer.write(payload.to_vec()) {
            self.tally.unsent += 1;
        }
    }

    pub(super) const fn tally(&self) -> Tally {
        self.tally
    }

    /// Warn once of each other writer that stays on the topic of commands.
    pub(super) fn look_for_other_writers(&mut self, now_ns: u64) {
        let commands = self.commands.dds_name();
        for change in self.participant.changes() {
            match change {
                Change::Writer { gid, dds_topic }
                    if dds_topic == commands && self.others.len() < MOST_WRITERS =>
                {
                    let seen = OtherWriter { since_ns: now_ns, is_told: false };
                    self.others.entry(gid).or_insert(seen);
                }
                Change::Gone { gid } => {
                    self.others.remove(&gid);
                }
                Change::Writer { .. } => {}
            }
        }
        let topic = &self.commands.name;
        for (gid, other) in &mut self.others {
            if !other.is_told && now_ns.saturating_sub(other.since_ns) >= STAYS_NS {
                other.is_told = true;
                tracing::warn!(
                    topic,
                    ?gid,
                    "another node publishes what the robot is told; end it"
                );
            }
        }
    }
}

impl AsFd for Dds {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.participant.as_fd()
    }
}
