//! Simulated robot as a process, and a proxy between it and its link.

use std::{
    io::{BufRead as _, BufReader, ErrorKind},
    net::{SocketAddr, UdpSocket},
    process::{Child, Stdio},
    sync::{
        Arc, Mutex,
        mpsc::{Receiver, channel},
    },
};

use common::ground_truth::{GroundTruthHeader, GroundTruthTick};

use super::{PATIENCE, firsthand, kill, start_piped, wait_until};

/// Simulated robot, which ends with the thread of its test.
pub struct Robot {
    process: Child,
    scheme: &'static str,
    pub listening: String,
    pub laser: Option<String>,
    /// Ground truth records, received at once because the robot waits for a slow reader.
    truth: Receiver<GroundTruthTick>,
    went: f64,
}

impl Robot {
    /// Starts a simulated robot in the world of the default mission, on a free port.
    pub fn on_the_course() -> Self {
        Self::start("obstacle-course", "udp", "127.0.0.1:0")
    }

    pub fn start(mission: &str, transport: &str, listen: &str) -> Self {
        let scheme = match transport {
            "tcp" => "tcp://",
            "pty" => "serial://",
            _ => "udp://",
        };
        let arguments = ["--transport", transport, "--listen", listen];
        Self { scheme, ..Self::start_with(mission, &arguments) }
    }

    /// Returns the arguments that make this the robot of a run.
    pub fn as_robot(&self) -> String {
        format!("--set robot.address=\"{}{}\"", self.scheme, self.listening)
    }

    /// Starts a simulated robot with further arguments of `firsthand sim`.
    pub fn start_with(mission: &str, arguments: &[&str]) -> Self {
        let mut process = firsthand(&["sim", mission, "--ground-truth"]);
        let mut process = start_piped(process.args(arguments).stderr(Stdio::null()));
        let output = BufReader::new(process.stdout.take().unwrap());
        let mut lines = output.lines().map_while(Result::ok);
        let header = serde_json::from_str(&lines.next().unwrap());
        let GroundTruthHeader { listening, laser } = header.unwrap();
        let (tell, truth) = channel();
        std::thread::spawn(move || {
            let mut ticks = lines.map_while(|line| serde_json::from_str(&line).ok());
            ticks.all(|tick| tell.send(tick).is_ok())
        });
        Self { process, scheme: "udp://", listening, laser, truth, went: 0.0 }
    }

    pub fn wait_until_driven(&mut self, metres: f64) {
        while self.went < metres {
            self.went = from_start(&self.truth.recv_timeout(PATIENCE).unwrap());
        }
    }

    /// Waits for the next ground truth record. Returns whether both wheels are at rest.
    pub fn wait_for_a_tick(&mut self) -> bool {
        rests(&self.truth.recv_timeout(PATIENCE).unwrap())
    }

    pub fn wait_until_at_rest(&mut self) {
        wait_until("the robot rests", || self.wait_for_a_tick());
    }

    /// Returns whether both wheels are at rest in the newest record.
    pub fn is_at_rest(&mut self) -> bool {
        let newest = self.truth.try_iter().last();
        newest.map_or_else(|| self.wait_for_a_tick(), |truth| rests(&truth))
    }

    pub fn kill(mut self) -> f64 {
        kill(&mut self.process);
        let last = self.truth.iter().last();
        last.map_or(self.went, |truth| from_start(&truth))
    }
}

fn rests(truth: &GroundTruthTick) -> bool {
    truth.v.abs() < 0.01 && truth.omega.abs() < 0.05
}

fn from_start(truth: &GroundTruthTick) -> f64 {
    truth.x.hypot(truth.y)
}

/// Forwarder of datagrams between link and robot, until the process ends.
#[derive(Debug)]
pub struct Proxy {
    address: SocketAddr,
}

/// Function from received bytes to forwarded bytes.
pub type Pass = dyn FnMut(&[u8]) -> Vec<u8> + Send;

impl Proxy {
    pub fn before(robot: &Robot, mut to_robot: Box<Pass>, mut to_link: Box<Pass>) -> Self {
        let host = UdpSocket::bind("127.0.0.1:0").unwrap();
        let wire = UdpSocket::bind("127.0.0.1:0").unwrap();
        wire.connect(&robot.listening).unwrap();
        let address = host.local_addr().unwrap();
        let (sending, answering) = (wire.try_clone().unwrap(), host.try_clone().unwrap());
        let link = Arc::new(Mutex::new(None));
        let link_too = Arc::clone(&link);
        forward(host, move |bytes, from| {
            *link.lock().unwrap() = Some(from);
            let _ = sending.send(&to_robot(bytes));
        });
        forward(wire, move |bytes, _| {
            let bytes = to_link(bytes);
            if let Some(link) = *link_too.lock().unwrap() {
                let _ = answering.send_to(&bytes, link);
            }
        });
        Self { address }
    }

    /// Returns the arguments that make the proxy the robot of a run.
    pub fn as_robot(&self) -> String {
        format!("--set robot.address=\"udp://{}\"", self.address)
    }
}

/// Passes each datagram of `socket` and its sender on, until the process ends.
fn forward(socket: UdpSocket, mut pass: impl FnMut(&[u8], SocketAddr) + Send + 'static) {
    std::thread::spawn(move || {
        let mut buffer = [0; 2048];
        loop {
            match socket.recv_from(&mut buffer) {
                Ok((length, from)) => pass(&buffer[..length], from),
                // The other end does not listen now.
                Err(error) => assert_eq!(error.kind(), ErrorKind::ConnectionRefused, "{error}"),
            }
        }
    });
}
