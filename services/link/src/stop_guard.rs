//! The stop guard: a process that stops the robot when its link ended and nobody saw it rest.
//!
//! The link starts it and holds the writing end of a pipe, which the kernel closes with the link. A session of its own keeps it from
//! signals to the link, the supervisor or their process groups. It speaks to the robot by the same [`Link`], and leaves when the robot
//! rests or another link runs.

use std::{
    io,
    io::{Read as _, Write as _},
    net::UdpSocket,
    os::{fd::AsFd as _, unix::process::CommandExt as _},
    path::Path,
    process::{Command, Stdio},
    time::Duration,
};

use common::{
    address::Address,
    bus::close_all_on_exec,
    clock::{MissionClock, Pace, monotonic_ns},
    domain::Domain,
    poll,
    run::Run,
    samples::{HoldReason, Order, Rest},
    shell::StageError,
    stop_socket::Identity,
};
use rustix::process::setsid;

use crate::{
    step::{Effect, Entry, Event, Link, State},
    transport::Transport,
};

/// Follows `firsthand stage` in the command line.
pub const NAME: &str = "stop-guard";

const LOOKS_AGAIN: Duration = Duration::from_millis(20);
/// A robot whose encoders say nothing for longer is out of reach, or does not know.
const SILENT: Duration = Duration::from_secs(10);
/// A robot that says that it moves, in spite of all stops, for longer may have wrong encoders.
const TOLD_IN_VAIN: Duration = Duration::from_secs(60);

pub(crate) struct StopGuard {
    pipe: io::PipeWriter,
}

impl StopGuard {
    /// Fails when the process cannot be started.
    pub(crate) fn start(directory: &Path, link: &Identity) -> io::Result<Self> {
        close_all_on_exec()?;
        let (ended, pipe) = io::pipe()?;
        Command::new("/proc/self/exe")
            .arg0("firsthand")
            .args(["stage", NAME])
            .arg(directory)
            .arg(&link.0)
            .stdin(ended)
            .stdout(Stdio::null())
            .spawn()?;
        Ok(Self { pipe })
    }

    pub(crate) fn release(mut self) {
        // A killed guard needs no release.
        let _ = self.pipe.write_all(b"r");
    }
}

/// Be the guard of the link with this socket; standard input ends with the link. Fails when the run file or the wire cannot be used.
pub fn run(directory: &Path, link: &Identity) -> Result<(), StageError> {
    // The link's session may belong to a terminal, or end with the link.
    let _ = setsid();
    let run = Run::load(directory)?;
    let domain = Domain::of(run.robot.clone());
    let released = io::stdin().lock().read(&mut [0]).is_ok_and(|read| read > 0);
    if released || link.is_succeeded(&domain) {
        return Ok(());
    }
    tracing::warn!("the link ended, and nobody saw the robot at rest: it is told to stand");
    let at_rest = stand(&run, || link.is_succeeded(&domain))?;
    tracing::warn!(at_rest, "the stop guard leaves");
    Ok(())
}

/// Tell the robot to stand, by each method of the protocol in turn, until its encoders say that it rests. Returns false if they say
/// nothing or it does not stop, or `leave` returns true. Fails when the wire cannot be used.
pub fn stand(run: &Run, mut leave: impl FnMut() -> bool) -> Result<bool, StageError> {
    let MissionClock::Wall { rate, .. } = run.clock else {
        // In lockstep a robot waits for commands.
        return Ok(true);
    };
    // A simulated robot ends with its supervisor.
    let is_gone = || run.mission.robot.address.is_none() && !is_taken(&run.address);
    let mut transport = Transport::of_base(&run.address, &run.mission)?;
    let mut link = Link::new(&run.mission);
    link.restore(State { pace: Pace::Rate(rate), next_tick: 0 });
    let began_ns = monotonic_ns();
    let mut heard_ns = began_ns;
    loop {
        let now_ns = monotonic_ns();
        let mut effects = Vec::new();
        let now = run.clock.at(0, now_ns);
        let mut take =
            |event: Event<'_>| effects.extend(link.step(Entry { event, machine_ns: now_ns, now }));
        take(Event::Order(Order::Stop, HoldReason::Ending));
        if let Some(open) = transport.maintain(now_ns)? {
            take(Event::Wire(open));
        }
        while let Some(bytes) = transport.receive(now_ns)? {
            take(Event::Datagram(bytes));
        }
        for effect in effects {
            match effect {
                Effect::Send(bytes) => transport.send(&bytes)?,
                Effect::StopBy(method) => {
                    tracing::warn!(by = method, "the robot does not stand; it is told again");
                }
                _ => {}
            }
        }
        match link.rest() {
            Rest::AtRest => return Ok(true),
            Rest::Moving => heard_ns = now_ns,
            Rest::Unknown => {}
        }
        let since = |then_ns: u64| Duration::from_nanos(now_ns.saturating_sub(then_ns));
        if since(heard_ns) >= SILENT || is_gone() || since(began_ns) >= TOLD_IN_VAIN || leave() {
            return Ok(false);
        }
        poll::readable(&[transport.as_fd()], Some(LOOKS_AGAIN))
            .map_err(|error| StageError::Other(format!("cannot wait for the robot: {error}")))?;
    }
}

fn is_taken(address: &Address) -> bool {
    match address {
        Address::Udp(address) => UdpSocket::bind(address).is_err(),
        Address::Tcp(_) | Address::Serial(_) | Address::Ros2(_) => true,
    }
}
