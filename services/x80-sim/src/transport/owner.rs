//! The user whose process sends datagrams, by the system's table of sockets.

use std::{
    collections::VecDeque,
    fs,
    net::SocketAddr,
    time::{Duration, Instant},
};

/// A sender's port may be another user's later.
const ASKED_AGAIN: Duration = Duration::from_millis(500);
const MOST_SENDERS: usize = 16;

/// Admits senders of this user on this machine only.
#[derive(Debug, Default)]
pub(super) struct OwnUser {
    senders: VecDeque<(SocketAddr, Instant, bool)>,
    told: bool,
}

impl OwnUser {
    pub(super) fn admits(&mut self, sender: SocketAddr) -> bool {
        self.senders.retain(|(_, asked, _)| asked.elapsed() < ASKED_AGAIN);
        if let Some((_, _, own)) = self.senders.iter().find(|(known, ..)| *known == sender) {
            return *own;
        }
        let own = sender.ip().is_loopback() && is_own(sender);
        self.senders.truncate(MOST_SENDERS - 1);
        self.senders.push_front((sender, Instant::now(), own));
        if !own && !self.told {
            self.told = true;
            tracing::warn!(%sender, "another user sends to the simulated robot of this run; its datagrams are ignored");
        }
        own
    }
}

/// All sockets of the sender's port are this user's. A system that hides its sockets shows none of another user.
fn is_own(sender: SocketAddr) -> bool {
    let table = if sender.is_ipv4() { "/proc/net/udp" } else { "/proc/net/udp6" };
    let Ok(table) = fs::read_to_string(table) else {
        return true;
    };
    let user = rustix::process::geteuid().as_raw().to_string();
    let port = format!(":{:04X}", sender.port());
    let users: Vec<_> = table
        .lines()
        .filter_map(|line| {
            let mut columns = line.split_whitespace();
            let local = columns.nth(1)?;
            local.ends_with(&port).then(|| columns.nth(5)).flatten()
        })
        .collect();
    !users.is_empty() && users.iter().all(|found| *found == user)
}
