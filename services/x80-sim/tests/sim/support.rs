//! A simulated robot in a thread, and a host that talks to it.

use std::{
    io::{BufRead, BufReader},
    net::{SocketAddr, UdpSocket},
    os::unix::net::UnixStream,
    path::{Path, PathBuf},
    sync::mpsc::{Receiver, channel},
    thread::JoinHandle,
    time::Duration,
};

use common::{
    clock::Pace,
    ground_truth::{GroundTruthHeader, GroundTruthTick},
    mission::{Mission, Realism},
};
use x80_sim::{SimError, SimOptions, Transport, run};

/// The time after which a waiting test has failed; nothing here takes as long.
pub(crate) const PATIENCE: Duration = Duration::from_secs(20);

/// A mission with ideal sensors and wheels, unless `text` names a realism.
pub(crate) fn mission(text: &str) -> Mission {
    let mut mission =
        Mission::parse(&format!("target = [3, 0]\n{text}"), Path::new("test.toml")).unwrap();
    if !text.contains("realism") {
        mission.simulation.realism = Realism::Laboratory;
    }
    mission
}

/// A running simulated robot; dropping it stops it.
pub(crate) struct Sim {
    pub(crate) listening: String,
    /// Lines of ground truth, read as they come: a robot waits for a slow reader.
    ground_truth: Receiver<String>,
    stop: Option<UnixStream>,
    thread: Option<JoinHandle<Result<(), SimError>>>,
}

impl Sim {
    pub(crate) fn start(text: &str, pace: Pace) -> Self {
        Self::start_on(text, pace, Transport::Udp)
    }

    pub(crate) fn start_on(text: &str, pace: Pace, transport: Transport) -> Self {
        Self::start_with(text, pace, transport, None)
    }

    /// In a world with another robot; the sockets are this robot's and the other's.
    pub(crate) fn start_with(
        text: &str,
        pace: Pace,
        transport: Transport,
        meeting: Option<[PathBuf; 2]>,
    ) -> Self {
        let (truth_reader, truth_writer) = UnixStream::pair().unwrap();
        let (stop, stopped) = UnixStream::pair().unwrap();
        let options = SimOptions {
            mission: mission(text),
            pace,
            listen: SocketAddr::from(([127, 0, 0, 1], 0)),
            transport,
            own_user_only: false,
            keep: None,
            ground_truth: Some(Box::new(truth_writer)),
            meeting,
        };
        let thread = std::thread::spawn(move || run(options, stopped));
        let (line, ground_truth) = channel();
        std::thread::spawn(move || {
            for read in BufReader::new(truth_reader).lines() {
                if line.send(read.unwrap()).is_err() {
                    return;
                }
            }
        });
        let header: GroundTruthHeader =
            serde_json::from_str(&ground_truth.recv().unwrap()).unwrap();
        Self { listening: header.listening, ground_truth, stop: Some(stop), thread: Some(thread) }
    }

    /// The ground truth of the next tick.
    pub(crate) fn next_truth(&mut self) -> GroundTruthTick {
        serde_json::from_str(&self.ground_truth.recv_timeout(PATIENCE).unwrap()).unwrap()
    }

    /// Stop the robot; its ground truth stays to be read.
    pub(crate) fn finish(&mut self) {
        drop(self.stop.take());
        self.thread.take().unwrap().join().unwrap().unwrap();
    }

    /// The ground truth of the next tick of a robot that has finished.
    pub(crate) fn last_truth(&mut self) -> Option<GroundTruthTick> {
        let line = self.ground_truth.recv().ok()?;
        Some(serde_json::from_str(&line).unwrap())
    }

    /// A host's socket that speaks to this robot alone.
    pub(crate) fn host(&self) -> UdpSocket {
        let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
        socket.connect(&self.listening).unwrap();
        socket.set_read_timeout(Some(PATIENCE)).unwrap();
        socket
    }

    /// Stop the robot, and return how it ended.
    pub(crate) fn stop(mut self) -> Result<(), SimError> {
        drop(self.stop.take());
        self.thread.take().unwrap().join().unwrap()
    }
}

impl Drop for Sim {
    fn drop(&mut self) {
        drop(self.stop.take());
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// The next datagram.
pub(crate) fn receive(socket: &UdpSocket) -> Vec<u8> {
    let mut buffer = [0; 2048];
    let length = socket.recv(&mut buffer).expect("the robot answers");
    buffer[..length].to_vec()
}
