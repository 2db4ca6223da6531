//! Process around [`crate::robot`]: a socket, a pace and the ground truth.

mod in_memory;
mod meeting;
mod session;

use std::{io::Write, net::SocketAddr, os::fd::AsFd, path::PathBuf, time::Duration};

use common::{
    checkpoint::Checkpoint,
    clock::{Pace, monotonic_ns},
    file::append,
    ground_truth::GroundTruthHeader,
    json_wire::line,
    mission::Mission,
    poll,
};
use serde::Serialize;

pub use self::in_memory::InMemory;
use self::{meeting::Meeting, session::Session};
use crate::{
    error::{Result, SimError},
    robot::Robot,
    saved_state::{self, SavedState},
    transport::{Transport, Way},
};

pub struct SimOptions {
    pub mission: Mission,
    /// Pace of mission time.
    ///
    /// At [`Pace::Max`], mission time stands until a motion command comes. The body then moves one
    /// period, and the next tick's frames are sent. A ping repeats this tick's frames. Equal
    /// commands give equal bytes.
    ///
    /// At [`Pace::Rate`], mission time follows the machine's clock, and frames are sent unasked.
    /// Mission time waits for a process that was unscheduled for more than a period.
    pub pace: Pace,
    /// Listening address. Port 0 takes a free one; a pseudo-terminal gets its path from the system.
    pub listen: SocketAddr,
    pub transport: Transport,
    /// Whether datagrams of other users or machines are refused.
    pub own_user_only: bool,
    /// File that saves and restores the robot's state.
    pub keep: Option<PathBuf>,
    /// Sink of a [`common::ground_truth::GroundTruthHeader`], then a
    /// [`common::ground_truth::GroundTruthTick`] per tick.
    ///
    /// Each is a JSON line in one write. The robot waits for a slow reader and continues without a
    /// vanished one.
    pub ground_truth: Option<Box<dyn Write + Send>>,
    pub meeting: Option<[PathBuf; 2]>,
}

/// Runs until `stop` is readable or its other end is closed.
///
/// # Errors
/// If it cannot listen, the transport fails, or the state cannot be saved.
pub fn run(options: SimOptions, stop: impl AsFd) -> Result {
    let SimOptions {
        mission,
        pace,
        listen,
        transport,
        own_user_only,
        keep,
        mut ground_truth,
        meeting,
    } = options;
    let way = Way::open(transport, listen, own_user_only)?;
    tracing::info!(address = way.address(), %pace, "a simulated X80 listens");
    let laser_way = match (mission.rplidars().first(), transport) {
        (None, _) | (_, Transport::Udp) => None,
        _ => Some(Way::open(transport, SocketAddr::new(listen.ip(), 0), own_user_only)?),
    };
    if let Some(way) = &laser_way {
        tracing::info!(address = way.address(), "its laser listens");
    }
    let (saved, checkpoint, _lock) = match keep {
        None => (None, None, None),
        Some(file) => {
            // The previous process may still be coming to rest.
            let lock = append(&file).and_then(|lock| lock.lock().map(|()| lock));
            let lock = lock.map_err(|source| SimError::Lock { file: file.clone(), source })?;
            const { assert!(size_of::<SavedState>() < saved_state::CAPACITY) };
            let (checkpoint, saved) = Checkpoint::open::<SavedState>(&file, saved_state::CAPACITY)?;
            (saved, Some(checkpoint), Some(lock))
        }
    };
    let robot = match &saved {
        None => Robot::new(&mission),
        Some(saved) => {
            tracing::info!(?saved, "the robot starts at the last process's pose");
            Robot::restored(&mission, saved)
        }
    };
    let meeting = meeting
        .map(|sockets| Meeting::open(&mission, sockets, &stop, pace == Pace::Max))
        .transpose()?;
    let (listening, laser) = (way.address(), laser_way.as_ref().map(Way::address));
    tell(&mut ground_truth, &GroundTruthHeader { listening, laser });
    let ground_truth = Box::new(move |tick| tell(&mut ground_truth, &tick));
    let (ways, others) = ((way, laser_way), (meeting, checkpoint));
    let mut session = Session::new(&mission, robot, pace, ways, ground_truth, others)?;
    let mut buffer = vec![0; 65_536];
    loop {
        let mut descriptors = session.readable();
        descriptors.push(stop.as_fd());
        let came = poll::readable(&descriptors, session.patience());
        let mut came = came.map_err(SimError::Wait)?;
        if came.pop() == Some(true) {
            return session.end();
        }
        if came.contains(&true) {
            session.listen(&mut buffer)?;
        }
        session.catch_up()?;
    }
}

/// Writes a JSON line of the ground truth, if it has a reader.
fn tell(reader: &mut Option<Box<dyn Write + Send>>, record: &impl Serialize) {
    let Some(listens) = reader else {
        return;
    };
    // One write per line: a pipe write costs far more than its bytes.
    let written = listens.write_all(&line(record)).and_then(|()| listens.flush());
    if let Err(error) = written {
        tracing::warn!(%error, "the ground truth has lost its reader; the robot continues without one");
        *reader = None;
    }
}

/// None in lockstep.
struct SimClock {
    /// Machine time at mission time 0, and mission seconds per machine second.
    runs: Option<(u64, f64)>,
    period_s: f64,
}

impl SimClock {
    fn new(pace: Pace, period_s: f64, begin_s: f64) -> Self {
        let runs = match pace {
            Pace::Max => None,
            Pace::Rate(rate) => {
                let gone_ns = (begin_s / rate * 1e9) as u64;
                Some((monotonic_ns().saturating_sub(gone_ns), rate))
            }
        };
        Self { runs, period_s }
    }

    fn now(&self, machine_ns: u64) -> Option<f64> {
        let (epoch, rate) = self.runs?;
        Some(machine_ns.saturating_sub(epoch) as f64 * 1e-9 * rate)
    }

    /// Returns the time until `due`, which is 0 only if `due` has come; none in lockstep.
    fn wait_for(&self, due: f64, machine_ns: u64) -> Option<Duration> {
        let (_, rate) = self.runs?;
        let seconds = (due - self.now(machine_ns)?) / rate;
        Some(Duration::from_nanos((seconds * 1e9).ceil() as u64))
    }

    /// Shifts late mission time to the next tick `due`, so that an unscheduled process makes up no
    /// lost time.
    fn forgive(&mut self, due: f64, machine_ns: u64) {
        let owed = self.now(machine_ns).map_or(0.0, |now| now - due);
        if let Some((epoch, rate)) = &mut self.runs
            && owed > self.period_s
        {
            *epoch += (owed / *rate * 1e9) as u64;
        }
    }
}

#[cfg(test)]
mod tests {
    use std::{net::UdpSocket, os::unix::net::UnixStream};

    use super::*;
    use crate::testing::near;

    #[test]
    fn mission_time_runs_at_its_rate_and_waits_for_a_process_that_was_held_up() {
        let mut clock = SimClock { runs: Some((1_000_000_000, 2.0)), period_s: 0.1 };
        assert_eq!(clock.now(2_500_000_000), Some(3.0));
        let wait = clock.wait_for(3.5, 2_500_000_000).unwrap();
        assert_eq!(wait, Duration::from_millis(250));
        clock.forgive(2.95, 2_500_000_000);
        // Half a period is caught up.
        assert_eq!(clock.now(2_500_000_000), Some(3.0));
        clock.forgive(1.0, 2_500_000_000);
        near(clock.now(2_500_000_000).unwrap(), 1.0, 1e-6);
    }

    #[test]
    fn a_robot_whose_truth_nobody_reads_goes_on() {
        let (reader, writer) = UnixStream::pair().unwrap();
        drop(reader);
        let mut truth: Option<Box<dyn Write + Send>> = Some(Box::new(writer));
        tell(&mut truth, &"a tick");
        assert!(truth.is_none());
        tell(&mut truth, &"the next");
    }

    #[test]
    fn a_port_in_use_is_named_with_its_remedy() {
        let taken = UdpSocket::bind("127.0.0.1:0").unwrap();
        let listen = taken.local_addr().unwrap();
        let error = Way::open(Transport::Udp, listen, false).err().unwrap();
        assert!(matches!(error, SimError::Bind { address, .. } if address == listen));
        let text = error.to_string();
        assert!(text.contains(&listen.to_string()) && text.contains("port 0"), "{text}");
    }
}
