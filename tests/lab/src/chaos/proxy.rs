//! UDP proxy between link and simulated robot, in a thread, with a [`FaultInjector`].

use std::{
    io,
    net::{SocketAddr, UdpSocket},
    os::fd::AsFd as _,
    sync::{
        Arc,
        atomic::{AtomicBool, AtomicU64, Ordering::Relaxed},
    },
    time::{Duration, Instant},
};

use common::{mission::Protocol, poll};

use super::{
    fault_injector::{FaultInjector, Late},
    robot_fault::RobotFault,
};
use crate::background::{Turns, socket, to_robot};

const LOOK: Duration = Duration::from_millis(10);
/// Maximum held datagrams: two seconds at a hundred times the usual rate.
const MOST_HELD: usize = 16_384;

#[derive(Debug, Default)]
struct Shared {
    faulty: AtomicBool,
    /// Time of the host's newest moving order after the proxy's start.
    last_moving_ns: AtomicU64,
}

pub struct Proxy {
    pub address: SocketAddr,
    began: Instant,
    shared: Arc<Shared>,
    _thread: Turns,
}

impl Proxy {
    pub fn start(
        robot: SocketAddr,
        fault: RobotFault,
        protocol: Protocol,
        seed: u64,
    ) -> io::Result<Self> {
        let (front, back) = (socket()?, to_robot(robot)?);
        let address = front.local_addr()?;
        let (began, shared) = (Instant::now(), Arc::new(Shared::default()));
        let injector = FaultInjector::new(fault, protocol, seed);
        let (host, held) = (None, Vec::new());
        let mut wire = Wire { front, back, host, injector, held, began, shared: shared.clone() };
        Ok(Self { address, began, shared, _thread: Turns::start(|| move || wire.turn()) })
    }

    pub fn begin_fault(&self) {
        self.shared.faulty.store(true, Relaxed);
    }

    pub fn last_moving(&self) -> Instant {
        self.began + Duration::from_nanos(self.shared.last_moving_ns.load(Relaxed))
    }
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
    fn turn(&mut self) -> io::Result<()> {
        let now = self.began.elapsed();
        let due = self.held.iter().map(|late| late.at.saturating_sub(now));
        let timeout = due.min().unwrap_or(LOOK).min(LOOK);
        poll::readable(&[self.front.as_fd(), self.back.as_fd()], Some(timeout))?;
        if self.shared.faulty.load(Relaxed) {
            self.injector.begin();
        }
        let now = self.began.elapsed();
        let mut buffer = [0; 65_536];
        while let Ok((length, host)) = self.front.recv_from(&mut buffer) {
            self.host = Some(host);
            let moving = &self.shared.last_moving_ns;
            let mut moves = || moving.store(now.as_nanos() as u64, Relaxed);
            let bytes = self.injector.order(&buffer[..length], &mut moves);
            if !bytes.is_empty() {
                let _ = self.back.send(&bytes);
            }
        }
        while let Ok(length) = self.back.recv(&mut buffer) {
            self.held.extend(self.injector.report(&buffer[..length], now));
        }
        self.held.truncate(MOST_HELD);
        for late in self.held.extract_if(.., |late| late.at <= now) {
            if let Some(host) = self.host {
                let _ = self.front.send_to(&late.bytes, host);
            }
        }
        Ok(())
    }
}
