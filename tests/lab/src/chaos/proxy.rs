//! A UDP proxy between link and simulated robot, in a thread, with a [`FaultInjector`].

use std::{
    io,
    net::{Ipv4Addr, SocketAddr, UdpSocket},
    os::fd::AsFd as _,
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
    thread::JoinHandle,
    time::{Duration, Instant},
};

use common::{mission::Protocol, poll};

use crate::chaos::{
    fault_injector::{FaultInjector, Late},
    robot_fault::RobotFault,
};
use crate::error::{OrCannot as _, Result};

/// Longest wait until the thread sees that the fault begins or the proxy ends.
const LOOK: Duration = Duration::from_millis(10);
/// Most datagrams that are held: those of two seconds at a hundred times the usual rate.
const MOST_HELD: usize = 16_384;

#[derive(Debug, Default)]
struct Shared {
    faulty: AtomicBool,
    ends: AtomicBool,
    last_moving: Mutex<Option<Instant>>,
}

#[derive(Debug)]
pub struct Proxy {
    address: SocketAddr,
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

impl Proxy {
    /// Start a proxy between the robot at `robot` and the host that sends first.
    pub fn start(
        robot: SocketAddr,
        fault: RobotFault,
        protocol: Protocol,
        seed: u64,
    ) -> Result<Self> {
        let (front, back) = sockets(robot).or_cannot("open the proxy's sockets")?;
        let address = front.local_addr().or_cannot("name the proxy")?;
        let shared = Arc::new(Shared::default());
        let mut wire = Wire {
            front,
            back,
            host: None,
            injector: FaultInjector::new(fault, protocol, seed),
            held: Vec::new(),
            began: Instant::now(),
            shared: Arc::clone(&shared),
        };
        let thread = std::thread::spawn(move || {
            while !wire.shared.ends.load(Ordering::Relaxed) {
                // A datagram that cannot be sent, for example before the other end listens, is lost, as on a radio.
                let _ = wire.turn();
            }
        });
        Ok(Self { address, shared, thread: Some(thread) })
    }

    pub const fn address(&self) -> SocketAddr {
        self.address
    }

    pub fn begin_fault(&self) {
        self.shared.faulty.store(true, Ordering::Relaxed);
    }

    /// The time when the host last ordered a wheel to turn.
    pub fn last_moving(&self) -> Option<Instant> {
        let last = self.shared.last_moving.lock();
        *last.unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for Proxy {
    fn drop(&mut self) {
        self.shared.ends.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// A socket for the host and one for the robot.
fn sockets(robot: SocketAddr) -> io::Result<(UdpSocket, UdpSocket)> {
    let front = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0))?;
    let back = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0))?;
    back.connect(robot)?;
    front.set_nonblocking(true)?;
    back.set_nonblocking(true)?;
    Ok((front, back))
}

struct Wire {
    front: UdpSocket,
    back: UdpSocket,
    host: Option<SocketAddr>,
    injector: FaultInjector,
    held: Vec<Late>,
    began: Instant,
    shared: Arc<Shared>,
}

impl Wire {
    /// Wait for a datagram, and pass on those that are due.
    fn turn(&mut self) -> io::Result<()> {
        let now = self.began.elapsed();
        let due = self.held.iter().map(|late| late.at.saturating_sub(now));
        let timeout = due.min().unwrap_or(LOOK).min(LOOK);
        poll::readable(&[self.front.as_fd(), self.back.as_fd()], Some(timeout))?;
        if self.shared.faulty.load(Ordering::Relaxed) {
            self.injector.begin();
        }
        let mut buffer = [0; 65_536];
        while let Ok((length, host)) = self.front.recv_from(&mut buffer) {
            self.host = Some(host);
            let shared = &self.shared;
            let mut moves = || {
                let last = shared.last_moving.lock();
                *last.unwrap_or_else(PoisonError::into_inner) = Some(Instant::now());
            };
            let bytes = self.injector.order(&buffer[..length], &mut moves);
            if !bytes.is_empty() {
                let _ = self.back.send(&bytes);
            }
        }
        let now = self.began.elapsed();
        while let Ok(length) = self.back.recv(&mut buffer) {
            let passed = self.injector.report(&buffer[..length], now);
            self.held.extend(passed);
        }
        self.held.truncate(MOST_HELD);
        let (due, held) = self.held.drain(..).partition(|late| late.at <= now);
        self.held = held;
        let due: Vec<Late> = due;
        if let Some(host) = self.host {
            for late in due {
                let _ = self.front.send_to(&late.bytes, host);
            }
        }
        Ok(())
    }
}
