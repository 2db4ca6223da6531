//! Five hops between processes by what the machine itself has: what any bus is measured against.

use std::{
    fs::File,
    io::{self, Read as _, Write as _},
    os::{
        fd::{AsFd as _, OwnedFd},
        unix::net::UnixDatagram,
    },
    thread,
    time::{Duration, Instant},
};

use common::{clock::monotonic_ns, latency::Histogram, poll, start::become_child};
use processes::process::{Process, firsthand};
use rustix::event::{EventfdFlags, eventfd};

use super::hops::{PLACES, WARM_UP};
use crate::error::{LOST, LOST_SAMPLE, OrCannot as _, Result};

/// The bytes of a sample; an eventfd takes no more.
const SAMPLE: [u8; 8] = 1_u64.to_ne_bytes();

/// The forwarder's place on the command line.
pub const PLAIN: &str = "plain";

#[derive(Clone, Copy, Debug)]
pub enum Carrier {
    /// Wakes, and carries no data: that would be in shared memory.
    Eventfd,
    UnixDatagram,
}

impl Carrier {
    /// The two ends of a hop: where it is read, and where it is written.
    fn hop(self) -> io::Result<(OwnedFd, OwnedFd)> {
        Ok(match self {
            Self::Eventfd => {
                let end = eventfd(0, EventfdFlags::CLOEXEC)?;
                (end.try_clone()?, end)
            }
            Self::UnixDatagram => {
                let (read, written) = UnixDatagram::pair()?;
                (read.into(), written.into())
            }
        })
    }
}

/// Send `trips` samples around the forwarders, one every `period`, or back to back.
pub fn measure(carrier: Carrier, trips: u64, period: Option<Duration>) -> Result<Histogram> {
    let hop = || carrier.hop().or_cannot("open a hop");
    let own = std::process::id().to_string();
    let (mut from, start) = hop()?;
    let mut forwarders = Vec::new();
    for _ in PLACES {
        let (read, written) = hop()?;
        // Without a bus the robot's name names nothing.
        let arguments = ["bench", "tick", "--forwarder", PLAIN, "--supervisor", &own];
        let mut command = firsthand(&arguments);
        command.args(["--robot", PLAIN]).stdin(from).stdout(written);
        forwarders.push(Process::spawn(command).or_cannot("start a forwarder")?);
        from = read;
    }
    let (mut start, mut end) = (File::from(start), File::from(from));
    let mut latencies = Histogram::default();
    for trip in 0..WARM_UP + trips {
        let (began, began_ns) = (Instant::now(), monotonic_ns());
        start.write_all(&SAMPLE).or_cannot("send a sample")?;
        if !poll::is_readable(end.as_fd(), LOST).or_cannot("wait for a sample")? {
            return Err(LOST_SAMPLE.into());
        }
        end.read_exact(&mut SAMPLE.clone()).or_cannot("read a sample")?;
        if trip >= WARM_UP {
            latencies.record(monotonic_ns() - began_ns);
            thread::sleep(period.map_or(Duration::ZERO, |it| it.saturating_sub(began.elapsed())));
        }
    }
    for forwarder in &mut forwarders {
        forwarder.end(LOST);
    }
    Ok(latencies)
}

/// Forward what comes in on standard input to standard output, until the parent ends this process.
pub fn run_forwarder(supervisor: u32) -> Result {
    become_child(PLAIN, supervisor)?;
    let own = |end: io::Result<OwnedFd>| end.map(File::from).or_cannot("open a hop");
    let mut from = own(io::stdin().as_fd().try_clone_to_owned())?;
    let mut to = own(io::stdout().as_fd().try_clone_to_owned())?;
    let mut sample = SAMPLE;
    loop {
        from.read_exact(&mut sample).or_cannot("read a sample")?;
        to.write_all(&sample).or_cannot("send a sample")?;
    }
}
