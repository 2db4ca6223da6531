//! Simulated robot without process, socket, file or thread.

use std::{
    net::SocketAddr,
    sync::mpsc::{Receiver, channel},
};

use common::{
    clock::{Pace, monotonic_ns},
    ground_truth::GroundTruthTick,
    mission::Mission,
};

use super::session::Session;
use crate::{
    error::Result,
    robot::Robot,
    transport::{Source, Way},
};

/// Robot that a simulation drives, by the clock of its [machine](common::machine).
pub struct InMemory {
    session: Session,
    sent: Receiver<(SocketAddr, Vec<u8>)>,
    told: Receiver<GroundTruthTick>,
    pub truth: Vec<GroundTruthTick>,
}

impl InMemory {
    pub fn start(mission: &Mission, pace: Pace) -> Result<Self> {
        let ((host, sent), (truth, told)) = (channel(), channel());
        // Without a reader, the ground truth is lost.
        let tell = Box::new(move |tick| {
            let _ = truth.send(tick);
        });
        let (robot, ways) = (Robot::new(mission), (Way::to(host), None));
        let session = Session::new(mission, robot, pace, ways, tell, (None, None))?;
        Ok(Self { session, sent, truth: told.try_iter().collect(), told })
    }

    /// Takes a datagram of the host's wire at `from`. Each wire needs its own port, as robot and
    /// laser share an address.
    pub fn hear(&mut self, from: SocketAddr, datagram: &[u8]) -> Result {
        self.session.take(Source::Peer(from), datagram)?;
        self.pass()
    }

    /// Does nothing in lockstep.
    pub fn pass(&mut self) -> Result {
        self.session.catch_up()?;
        self.truth.extend(self.told.try_iter());
        Ok(())
    }

    /// On the monotonic clock; none in lockstep.
    pub fn next_due_ns(&self) -> Option<u64> {
        let after = self.session.patience()?;
        Some(monotonic_ns() + after.as_nanos() as u64)
    }

    /// Returns the datagrams sent since the last call, each with the wire that receives it.
    pub fn sent(&mut self) -> impl Iterator<Item = (SocketAddr, Vec<u8>)> {
        self.sent.try_iter()
    }
}
