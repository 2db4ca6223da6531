//! ROS 2 topics: reads the robot's, and writes its commands.
//!
//! A received piece is one message: its row in [`Topics`] and its payload. Other nodes' commands
//! have their writer's number before the payload, and two odometry publishers yield their own
//! piece. A killed link writes nothing, so it counts as no other writer however long the network
//! remembers it. Readers are best-effort and volatile, so they match every publisher. At most
//! [`DEPTH`] messages of a topic wait; older ones are dropped.

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

/// Silence that suggests a cut-off participant, which then rejoins.
const DEAF_NS: u64 = 2_000_000_000;
/// Silence before the first message that makes a participant rejoin. Discovery takes long on a slow
/// network.
const UNDISCOVERED_NS: u64 = 10_000_000_000;

#[derive(Debug)]
pub(super) struct Dds {
    readers: Vec<Reader>,
    writer: Writer,
    topics: Topics,
    publishers: Publishers,
    /// Next reader, so that a flood on one topic does not hold back others.
    next: usize,
    heard_ns: Option<u64>,
    joined_ns: Option<u64>,
    tally: Tally,
    participant: Participant,
}

impl Dds {
    pub(super) fn open(domain: u16, topics: Topics) -> io::Result<Self> {
        let participant = Participant::join(domain, None)?;
        let (readers, writer) = endpoints(&participant, &topics)?;
        Ok(Self {
            readers,
            writer,
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
        let reader = self.readers.get(row)?;
        let own = self.writer.gid();
        std::iter::from_fn(|| reader.take()).find(|message| message.from != own)
    }
}

impl Wire for Dds {
    fn descriptor(&self) -> Option<BorrowedFd<'_>> {
        Some(self.participant.as_fd())
    }

    fn maintain(&mut self, now_ns: u64) -> io::Result<()> {
        let joined_ns = *self.joined_ns.get_or_insert(now_ns);
        let (since_ns, most_ns) =
            self.heard_ns.map_or((joined_ns, UNDISCOVERED_NS), |heard_ns| (heard_ns, DEAF_NS));
        if now_ns.saturating_sub(since_ns) >= most_ns {
            tracing::info!("the ROS domain is silent; the link joins it again");
            self.participant.rejoin()?;
            (self.readers, self.writer) = endpoints(&self.participant, &self.topics)?;
            self.joined_ns = Some(now_ns);
            self.heard_ns = None;
        }
        Ok(())
    }

    /// Copies the next message after its row.
    fn receive(&mut self, buffer: &mut [u8], now_ns: u64) -> io::Result<Option<usize>> {
        self.participant.unring();
        let count = self.readers.len();
        for row in (0..count).map(|turn| (self.next + turn) % count) {
            let Some(Message { payload, from, .. }) = self.take(row) else {
                continue;
            };
            self.next = (row + 1) % count;
            self.heard_ns = Some(now_ns);
            let content = self.topics.heard.get(row).map(|(content, _)| *content);
            let writer = if content == Some(Content::Command) { &from[..] } else { &[] };
            let is_odometry = content == Some(Content::Odometry);
            // The piece that names two publishers replaces the message that shows them.
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
