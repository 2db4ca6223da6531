//! Stop guard: a process that orders an owed stop after its link ended
//! ([`wire_owner`](crate::wire_owner)).
//!
//! The link starts it and holds the writing end of a pipe, which the kernel closes with the link.
//! The guard has its own session, so signals to the link, the supervisor or their process groups
//! miss it. It uses the same [`Link`], and answers operators at its own socket. [`Orders`] is its
//! part without a process, which a simulation drives.

use std::{
    fs, io,
    net::UdpSocket,
    os::{fd::AsFd as _, unix::process::CommandExt as _},
    path::{Path, PathBuf},
    process::{Child, Command, Stdio},
    thread,
    time::Duration,
};

use common::{
    address::Address,
    bus::close_all_on_exec,
    clock::{MissionClock, monotonic_ns},
    file::append,
    poll,
    run::Run,
    samples::{HoldReason, Order, Rest},
    shell::{Result, StageError},
    stop_socket::{Identity, OwedStop, Request, StopSocket},
};
use rustix::process::setsid;

use crate::{
    shell::LOOKS_AGAIN,
    step::{Effect, Entry, Event, Link, State},
    transport::Transport,
    wire_owner::{Found, Role},
};

/// Argument of `firsthand stage`.
pub const NAME: &str = "stop-guard";

/// Check interval for a silent robot. Frames and requests wake the guard.
const LOOKS_FOR_SILENT: Duration = Duration::from_millis(200);
/// The machine may be out of descriptors or ports.
pub const TRIES_AGAIN: Duration = Duration::from_secs(1);

pub(crate) struct StopGuard {
    process: Child,
    _pipe: io::PipeWriter,
    pub(crate) link: Identity,
}

impl StopGuard {
    pub(crate) fn start(directory: &Path, link: Identity) -> io::Result<Self> {
        let (ended, pipe) = io::pipe()?;
        let process = spawn("/proc/self/exe".into(), directory, &link, ended.into())?;
        Ok(Self { process, _pipe: pipe, link })
    }

    pub(crate) fn has_ended(&mut self) -> bool {
        !matches!(self.process.try_wait(), Ok(None))
    }
}

/// Starts a guard; `ended` closes with the link.
pub fn spawn(
    program: PathBuf,
    directory: &Path,
    link: &Identity,
    ended: Stdio,
) -> io::Result<Child> {
    close_all_on_exec()?;
    Command::new(program)
        .arg0("firsthand")
        .args(["stage", NAME])
        .arg(directory)
        .arg(&link.0)
        .stdin(ended)
        .stdout(Stdio::null())
        .stderr(append(directory.join("link.log"))?)
        .spawn()
}

/// Guards the robot of the link with this socket; standard input closes with the link.
pub fn run(directory: &Path, link: &Identity) -> Result {
    // The link's session may end with it or its terminal.
    let _ = setsid();
    // The directory may vanish with the link.
    let run = Run::load(directory)?;
    if matches!(run.clock, MissionClock::Ticks { .. }) {
        // A robot waits for commands.
        return Ok(());
    }
    let domain = run.robot.domain();
    let mark = OwedStop::of(domain.clone());
    let _ = io::copy(&mut io::stdin().lock(), &mut io::sink());
    if !mark.is_set() || link.is_succeeded(&domain.stop_socket()) {
        return Ok(());
    }
    tracing::warn!("the link ended before it saw the robot at rest; the stop guard orders a stop");
    let socket = StopSocket::bind(domain.guard_socket())
        .inspect_err(|error| tracing::error!(%error, "operators cannot reach this stop guard"))
        .ok();
    let own = Identity::now(&domain.guard_socket());
    let is_succeeded =
        || link.is_succeeded(&domain.stop_socket()) || own.is_succeeded(&domain.guard_socket());
    let mut guard = Guard { directory, run: &run, mark, socket, heard_ns: monotonic_ns() };
    while let Err(error) = guard.order_stop(&is_succeeded) {
        tracing::error!(%error, "the stop guard tries again");
        thread::park_timeout(TRIES_AGAIN);
    }
    if !is_succeeded() {
        let _ = guard.mark.set(false, directory);
    }
    // A newer guard has its own.
    if Identity::now(&domain.guard_socket()) == own {
        let _ = fs::remove_file(domain.guard_socket());
    }
    // Fails while another process has files there.
    let _ = fs::remove_dir(domain.directory());
    Ok(())
}

struct Guard<'a> {
    directory: &'a Path,
    run: &'a Run,
    mark: OwedStop,
    socket: Option<StopSocket>,
    heard_ns: u64,
}

impl Guard<'_> {
    /// Orders the stop until the guard leaves. Fails when the wire is unusable.
    fn order_stop(&mut self, is_succeeded: &dyn Fn() -> bool) -> Result {
        let run = self.run;
        let mut orders = Orders::open(run)?;
        loop {
            let now_ns = monotonic_ns();
            let rest = orders.turn(now_ns)?;
            if rest != Rest::Unknown {
                self.heard_ns = now_ns;
            }
            let found = Found {
                link_lives: false,
                is_owed: rest != Rest::AtRest,
                is_succeeded: is_succeeded(),
                is_signed_off: self.answer(rest, now_ns),
                is_robot_gone: run.mission.robot.address.is_none() && !is_taken(&run.address),
            };
            if found.role() != Role::Orders {
                tracing::warn!(?found, "the stop guard leaves");
                return Ok(());
            }
            // A cleaner of temporary files may have removed it.
            let _ = self.mark.set(true, self.directory);
            let socket = self.socket.as_ref().map(|it| it.as_fd());
            let wires: Vec<_> = orders.transport.descriptor().into_iter().chain(socket).collect();
            poll::readable(&wires, Some(orders.pause())).map_err(|error| {
                StageError::Other(format!("cannot wait for the robot: {error}"))
            })?;
        }
    }

    /// Answers operators. Returns whether one signs the robot off.
    fn answer(&mut self, rest: Rest, now_ns: u64) -> bool {
        let Some(socket) = &mut self.socket else {
            return false;
        };
        while let Some(request) = socket.take() {
            match request {
                Request::SignOff => return true,
                Request::Look => {
                    let silent_s = now_ns.saturating_sub(self.heard_ns) / 1_000_000_000;
                    socket.tell(rest, silent_s.min(u8::MAX.into()) as u8);
                }
                Request::Stop | Request::Resume => {}
            }
        }
        if rest == Rest::AtRest {
            socket.tell_at_rest();
        }
        false
    }
}

/// Stop that a guard orders, by each method in turn.
pub struct Orders {
    transport: Transport,
    link: Link,
    clock: MissionClock,
}

impl Orders {
    pub fn open(run: &Run) -> Result<Self> {
        let transport = Transport::of_base(&run.address, &run.mission)?;
        let mut link = Link::new(&run.mission);
        link.restore(State::new(run.clock, 0));
        Ok(Self { transport, link, clock: run.clock })
    }

    /// Returns the rest by the encoders.
    ///
    /// # Errors
    /// If the wire is unusable.
    pub fn turn(&mut self, now_ns: u64) -> Result<Rest> {
        let Self { transport, link, clock } = self;
        let mut effects = Vec::new();
        let now = clock.at(0, now_ns);
        let mut take = |event: Event<'_>| {
            effects.extend(link.step(Entry { event, machine_ns: now_ns, now }));
        };
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
                Effect::Connected(true) => tracing::warn!("the robot answers the stop guard"),
                Effect::Connected(false) => tracing::warn!("the stop guard hears nothing"),
                _ => {}
            }
        }
        Ok(link.rest())
    }

    /// Returns the longest time to the next turn. Datagrams and requests shorten it.
    pub fn pause(&self) -> Duration {
        const { assert!(LOOKS_AGAIN.as_millis() < LOOKS_FOR_SILENT.as_millis()) };
        if self.link.connected() { LOOKS_AGAIN } else { LOOKS_FOR_SILENT }
    }
}

fn is_taken(address: &Address) -> bool {
    match address {
        Address::Udp(address) => UdpSocket::bind(address).is_err(),
        Address::Tcp(_) | Address::Serial(_) | Address::Ros2(_) => true,
    }
}
