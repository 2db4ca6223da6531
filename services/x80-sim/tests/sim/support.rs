//! Simulated robot in a thread, and its host.

use std::{
    io::{BufRead, BufReader},
    net::{SocketAddr, UdpSocket},
    os::unix::net::UnixStream,
    path::PathBuf,
    sync::mpsc::{Receiver, channel},
    thread::JoinHandle,
    time::Duration,
};

use common::{
    clock::Pace,
    ground_truth::{GroundTruthHeader, GroundTruthTick},
    mission::{Mission, Realism},
    wire::{Addressing, Command, Decoder, Report},
};
use x80_sim::{SimError, SimOptions, Transport, run};

/// Timeout of waits; every test finishes earlier.
pub(crate) const PATIENCE: Duration = Duration::from_secs(20);

/// Returns a mission with ideal sensors and wheels, unless `text` names a realism.
pub(crate) fn mission(text: &str) -> Mission {
    let mut mission = Mission::parse(&format!("target = [3, 0]\n{text}"), "test.toml").unwrap();
    if !text.contains("realism") {
        mission.simulation.realism = Realism::Laboratory;
    }
    mission
}

/// Returns a host's end of a wire to a robot in memory.
pub(crate) fn port(number: u16) -> SocketAddr {
    SocketAddr::from(([127, 0, 0, 1], number))
}

pub(crate) fn encoded(command: Command) -> Vec<u8> {
    let mut bytes = Vec::new();
    command.encode(Addressing::Numbered, &mut bytes);
    bytes
}

pub(crate) fn forward(counts: i16, limit_ms: u16) -> Vec<u8> {
    encoded(Command::velocity([Some(-counts), Some(counts)], limit_ms))
}

pub(crate) fn reports(bytes: &[u8]) -> Vec<Report> {
    let mut decoder = Decoder::default();
    decoder.push(bytes);
    std::iter::from_fn(|| Some(Report::parse(&decoder.next_frame()?).unwrap())).collect()
}

pub(crate) struct Sim {
    pub listening: String,
    /// Lines, read as they come: a robot waits for a slow reader.
    ground_truth: Receiver<String>,
    stop: UnixStream,
    thread: JoinHandle<Result<(), SimError>>,
}

impl Sim {
    pub(crate) fn start(text: &str, pace: Pace) -> Self {
        Self::start_with(text, pace, None)
    }

    /// Starts a robot in a world with another one; the sockets are its own and the other's.
    pub(crate) fn start_with(text: &str, pace: Pace, meeting: Option<[PathBuf; 2]>) -> Self {
        let (truth_reader, truth_writer) = UnixStream::pair().unwrap();
        let (stop, stopped) = UnixStream::pair().unwrap();
        let options = SimOptions {
            mission: mission(text),
            pace,
            listen: port(0),
            transport: Transport::Udp,
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
        Self { listening: header.listening, ground_truth, stop, thread }
    }

    pub(crate) fn next_truth(&mut self) -> GroundTruthTick {
        serde_json::from_str(&self.ground_truth.recv_timeout(PATIENCE).unwrap()).unwrap()
    }

    /// Stops the robot. Returns the unread ticks.
    pub(crate) fn finish(self) -> Vec<GroundTruthTick> {
        drop(self.stop);
        self.thread.join().unwrap().unwrap();
        self.ground_truth.iter().map(|line| serde_json::from_str(&line).unwrap()).collect()
    }

    pub(crate) fn host(&self) -> UdpSocket {
        let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
        socket.connect(&self.listening).unwrap();
        socket.set_read_timeout(Some(PATIENCE)).unwrap();
        socket
    }
}

pub(crate) fn receive(socket: &UdpSocket) -> Vec<u8> {
    let mut buffer = [0; 2048];
    let length = socket.recv(&mut buffer).expect("the robot answers");
    buffer[..length].to_vec()
}
