//! Lookup of the user who sends datagrams, in the system's socket table.

use std::{
    collections::VecDeque,
    fs,
    net::SocketAddr,
    time::{Duration, Instant},
};

/// Lifetime of a lookup: another user may get the sender's port later.
const ASKED_AGAIN: Duration = Duration::from_millis(500);
const MOST_SENDERS: usize = 16;
const READINGS: usize = 3;

/// Filter that admits only this user on this machine.
#[derive(Default)]
pub struct OwnUser {
    senders: VecDeque<(SocketAddr, Instant, bool)>,
    told: bool,
}

impl OwnUser {
    pub fn admits(&mut self, sender: SocketAddr) -> bool {
        let known = self.senders.iter().position(|(known, ..)| *known == sender);
        let known = known.and_then(|known| self.senders.remove(known));
        let (asked, own) = match known {
            Some((_, asked, own)) if asked.elapsed() < ASKED_AGAIN => (asked, own),
            before => {
                let found = if sender.ip().is_loopback() { is_own(sender) } else { Some(false) };
                (Instant::now(), found.unwrap_or(before.is_some_and(|(.., own)| own)))
            }
        };
        self.senders.truncate(MOST_SENDERS - 1);
        self.senders.push_front((sender, asked, own));
        if !own && !self.told {
            self.told = true;
            tracing::warn!(%sender, "another user sends datagrams to this run's simulated robot; the robot ignores them");
        }
        own
    }
}

/// Returns whether all sockets of the sender's port are this user's; `None` if none shows.
///
/// Readings may miss sockets while others come and go, and the sender may have ended. Systems that
/// hide sockets show none of other users.
fn is_own(sender: SocketAddr) -> Option<bool> {
    (0..READINGS).find_map(|_| read(sender))
}

fn read(sender: SocketAddr) -> Option<bool> {
    let table = if sender.is_ipv4() { "/proc/net/udp" } else { "/proc/net/udp6" };
    let Ok(table) = fs::read_to_string(table) else {
        return Some(true);
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
    (!users.is_empty()).then(|| users.iter().all(|found| *found == user))
}

#[cfg(test)]
mod tests {
    use std::net::UdpSocket;

    use super::*;

    #[test]
    fn a_sender_that_no_reading_of_the_table_shows_is_whose_it_was() {
        let mut own = OwnUser::default();
        let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
        let sender = socket.local_addr().unwrap();
        assert!(own.admits(sender));
        drop(socket);
        own.senders[0].1 -= 2 * ASKED_AGAIN;
        assert!(own.admits(sender));
        // It had no owner.
        assert!(!OwnUser::default().admits(sender));
    }
}
