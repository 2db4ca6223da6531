//! Robot, socket and truth together: what is done with a datagram, and with a tick.

use std::{io::Write, os::fd::BorrowedFd};

use common::{
    clock::Pace,
    mission::Mission,
    truth::TruthHeader,
    wire::{Decoder, Frame},
};

use serde::Serialize;

use super::SimError;
use crate::{
    robot::{Heard, Robot},
    transport::{Source, Udp},
};

/// A robot on a socket.
pub(super) struct Session {
    robot: Robot,
    /// Whether time waits for commands.
    lock_step: bool,
    socket: Udp,
    /// Whoever sent the last valid frame: all streams go there.
    peer: Option<Source>,
    /// The peer's and one other's: half a frame of the one must not garble the other's.
    ears: Vec<Ear>,
    truth: Option<Box<dyn Write + Send>>,
}

/// What has come from one source.
struct Ear {
    source: Source,
    decoder: Decoder,
}

impl Session {
    /// A robot at tick 0, which is written to the truth.
    pub(super) fn new(
        mission: &Mission,
        pace: Pace,
        socket: Udp,
        truth: Option<Box<dyn Write + Send>>,
    ) -> Self {
        let listening = socket.address();
        let mut session = Self {
            robot: Robot::new(mission),
            lock_step: pace == Pace::Max,
            socket,
            peer: None,
            ears: Vec::new(),
            truth,
        };
        session.tell(&TruthHeader { listening });
        let truth = session.robot.truth();
        session.tell(&truth);
        session
    }

    pub(super) fn next_tick_s(&self) -> f64 {
        self.robot.next_tick_s()
    }

    pub(super) fn readable(&self) -> BorrowedFd<'_> {
        self.socket.readable()
    }

    /// Take up to `most` datagrams; `now` tells mission time where a clock makes it.
    pub(super) fn listen_to(
        &mut self,
        buffer: &mut [u8],
        most: usize,
        now: impl Fn() -> Option<f64>,
    ) -> Result<(), SimError> {
        for _ in 0..most {
            let Some((source, bytes)) = self.socket.receive(buffer)? else {
                return Ok(());
            };
            if let Some(now) = now() {
                self.robot.advance_to(now.min(self.robot.next_tick_s()));
            }
            self.hear(source, bytes);
        }
        Ok(())
    }

    /// Pass mission time to the next tick, tell the truth of it, and send its frames.
    pub(super) fn tick(&mut self) {
        self.robot.advance_to_next_tick();
        let truth = self.robot.truth();
        self.tell(&truth);
        let mut frames = Vec::with_capacity(256);
        self.robot.stream(&mut frames);
        self.send(&frames);
    }

    /// Take the bytes of one datagram.
    fn hear(&mut self, source: Source, bytes: &[u8]) {
        let known = self.ears.iter().position(|ear| ear.source == source);
        let mut ear = known.map_or_else(
            || Ear {
                source,
                decoder: Decoder::default(),
            },
            |at| self.ears.swap_remove(at),
        );
        ear.decoder.push(bytes);
        while let Some(frame) = ear.decoder.next_frame() {
            self.on_frame(source, &frame);
        }
        // Of others than the peer, only one is remembered.
        if self.peer != Some(source) {
            let peer = self.peer;
            self.ears.retain(|other| Some(other.source) == peer);
        } else if self.ears.len() > 1 {
            self.ears.remove(0);
        }
        self.ears.push(ear);
    }

    fn on_frame(&mut self, source: Source, frame: &Frame<'_>) {
        let mut answer = Vec::with_capacity(16);
        let heard = self.robot.on_frame(frame, &mut answer);
        if heard == Heard::Stranger {
            return;
        }
        self.peer = Some(source);
        self.send(&answer);
        match heard {
            Heard::Motion if self.lock_step => self.tick(),
            Heard::Ping if self.lock_step => {
                let mut frames = Vec::with_capacity(256);
                self.robot.repeat(&mut frames);
                self.send(&frames);
            }
            _ => {}
        }
    }

    fn send(&self, bytes: &[u8]) {
        if let Some(peer) = self.peer.filter(|_| !bytes.is_empty()) {
            self.socket.send(peer, bytes);
        }
    }

    /// Write one line of truth; when nobody reads it any more, no further ones.
    fn tell(&mut self, record: &impl Serialize) {
        let Some(truth) = &mut self.truth else {
            return;
        };
        // One write a line: a pipe charges each write far more than its bytes.
        let written = serde_json::to_vec(record)
            .map_err(std::io::Error::from)
            .and_then(|mut line| {
                line.push(b'\n');
                truth.write_all(&line)
            })
            .and_then(|()| truth.flush());
        if let Err(error) = written {
            tracing::warn!(%error, "nobody reads the truth any more; the robot goes on without");
            self.truth = None;
        }
    }
}
