//! Topics of ROS 2: the robot's are read, and its commands written.
//!
//! A received piece is one message: the row of its topic in [`Topics`] and its payload. Others' commands are read too, with the number
//! of their writer before the payload. Two publishers of odometry are a piece of their own, too. A killed link writes nothing, so it is no other writer, however long the network remembers it.
//! Readers are best-effort and volatile, so they match every publisher. At most [`DEPTH`] messages of a topic wait; older ones are
//! dropped.

use std::{
    io,
    os::fd::{AsFd, BorrowedFd},
};

use ros2::participant::{Message, Participant, Quality, Reader, Writer};
use ros2_driver::{
    publishers::Publishers,
    topics::{Content, Topics},
};

use super::{Wire, counts::Tally};

const DEPTH: u16 = 16;

/// A participant may be cut off after such a silence, and joins anew.
const DEAF_NS: u64 = 2_000_000_000;
/// A participant that has heard nothing yet waits longer: over a slow network, others discover it late.
const UNDISCOVERED_NS: u64 = 10_000_000_000;

#[derive(Debug)]
pub(super) struct Dds {
    readers: Vec<Reader>,
    writer: Writer,
    topics: Topics,
    commands: Option<usize>,
    odometry: Option<usize>,
    publishers: Publishers,
    /// The reader that is asked next, so that a flood on one topic does not hold back others.
    next: usize,
    heard_ns: Option<u64>,
    joined_ns: Option<u64>,
    tally: Tally,
    participant: Participant,
}

impl Dds {
    /// Fails when the library gives no participant.
    pub(super) fn open(domain: u16, topics: Topics) -> io::Result<Self> {
        let participant = Participant::join(domain, None)?;
        let (readers, writer) = endpoints(&participant, &topics)?;
        let row_of = |wanted| topics.heard.iter().position(|(content, _)| *content == wanted);
        Ok(Self {
            readers,
            writer,
            commands: row_of(Content::Command),
            odometry: row_of(Content::Odometry),
            publishers: Publishers::default(),
            topics,
            next: 0,
            heard_ns: None,
            joined_ns: None,
            tally: Tally::default(),
            participant,
        })
    }

    fn take(&self, row: usize) -> Option<Message> {
        let (reader, own) = (self.readers.get(row)?, self.writer.gid());
        std::iter::from_fn(|| reader.take()).find(|message| message.from != own)
    }
}

impl Wire for Dds {
    fn maintain(&mut self, now_ns: u64) -> io::Result<()> {
        let joined_ns = *self.joined_ns.get_or_insert(now_ns);
        let (since_ns, most_ns) =
            self.heard_ns.map_or((joined_ns, UNDISCOVERED_NS), |heard_ns| (heard_ns, DEAF_NS));
        if now_ns.saturating_sub(since_ns) >= most_ns {
            tracing::info!("nothing was received in the domain; the domain is joined anew");
            self.participant.rejoin()?;
            (self.readers, self.writer) = endpoints(&self.participant, &self.topics)?;
            (self.joined_ns, self.heard_ns) = (Some(now_ns), None);
        }
        Ok(())
    }

    /// Copies the next message, after its topic's row, into `buffer`.
    fn receive(&mut self, buffer: &mut [u8], now_ns: u64) -> io::Result<Option<usize>> {
        self.participant.unring();
        let count = self.readers.len();
        for row in (0..count).map(|turn| (self.next + turn) % count) {
            let Some(Message { payload, from, .. }) = self.take(row) else {
                continue;
            };
            self.next = (row + 1) % count;
            self.heard_ns = Some(now_ns);
            let writer = if self.commands == Some(row) { &from[..] } else { &[] };
            let is_odometry = self.odometry == Some(row);
            // The message that shows two publishers is left out for the piece that names them.
            let two = is_odometry.then(|| self.publishers.take(from, now_ns)).flatten();
            let piece = two.unwrap_or_else(|| [&[row as u8], writer, &payload].concat());
            let length = piece.len().min(buffer.len());
            buffer[..length].copy_from_slice(&piece[..length]);
            return Ok(Some(length));
        }
        Ok(None)
    }

    fn send(&mut self, payload: &[u8]) -> io::Result<()> {
        if !self.writer.write(payload.to_vec()) {
            self.tally.unsent += 1;
        }
        Ok(())
    }

    fn tally(&self) -> Tally {
        self.tally
    }
}

fn endpoints(participant: &Participant, topics: &Topics) -> io::Result<(Vec<Reader>, Writer)> {
    let heard = Quality { is_reliable: false, is_latched: false, depth: DEPTH };
    let readers = topics.heard.iter().map(|(_, topic)| participant.reader(topic, heard));
    let told = Quality { is_reliable: true, is_latched: false, depth: 1 };
    Ok((readers.collect::<io::Result<_>>()?, participant.writer(&topics.command, told)?))
}

impl AsFd for Dds {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.participant.as_fd()
    }
}
