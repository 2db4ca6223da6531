use std::{
    io::Write,
    net::{SocketAddr, TcpListener, TcpStream, UdpSocket},
    os::fd::{AsFd, OwnedFd},
    path::{Path, PathBuf},
    time::Duration,
};

use common::{
    poll,
    wire::{Addressing, Command, Decoder},
};
use rustix::{
    fs::{Mode, OFlags, fcntl_getfl, fcntl_setfl, open},
    io::{Errno, read, write},
    pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt},
    termios::{ControlModes, LocalModes, OptionalActions, tcgetattr, tcsetattr},
};
use tempfile::TempDir;

use super::*;
use crate::testing::*;

fn open_at(address: &Address) -> Transport {
    Transport::open(address, super::Line { baud: BAUD, lowers_dtr: false }).unwrap()
}

fn ready(descriptor: impl AsFd) {
    assert!(poll::is_readable(descriptor, Duration::from_secs(10)).unwrap(), "nothing came");
}

impl Transport {
    fn wait(&self) {
        ready(self.descriptor().unwrap());
    }

    fn changes_at(&mut self, ms: u64) -> Option<bool> {
        self.maintain(ms * MS).unwrap()
    }

    fn maintain_until(&mut self, open: bool, now_ms: u64) {
        while self.changes_at(now_ms) != Some(open) {
            self.wait();
        }
    }

    fn connected(&mut self, listener: &TcpListener, now_ms: u64) -> TcpStream {
        self.maintain_until(true, now_ms);
        listener.accept().unwrap().0
    }

    fn expect(&mut self, wanted: &[u8], now_ms: u64) {
        let mut came = Vec::new();
        while came.len() < wanted.len() {
            match self.receive(now_ms * MS).unwrap() {
                Some(bytes) => came.extend_from_slice(bytes),
                None => self.wait(),
            }
        }
        assert_eq!(came, wanted);
    }

    fn expect_closing(&mut self, now_ms: u64) {
        while self.is_open() {
            self.wait();
            assert_eq!(self.receive(now_ms * MS).unwrap(), None);
        }
        assert_eq!(self.changes_at(now_ms), Some(false));
    }
}

fn trouble(transport: &Transport) -> String {
    transport.trouble().unwrap().to_string()
}

#[test]
fn a_foreign_datagram_is_dropped_and_counted_and_the_port_of_the_robots_host_is_kept() {
    let [robot, other] = [(); 2].map(|()| UdpSocket::bind("127.0.0.1:0").unwrap());
    let mut transport = open_at(&Address::Udp(robot.local_addr().unwrap()));
    transport.send(b"where?").unwrap();
    let (_, link) = robot.recv_from(&mut [0; 16]).unwrap();
    other.send_to(b"go left", link).unwrap();
    transport.wait();
    assert_eq!(transport.receive(0).unwrap(), None);
    assert_eq!(transport.tally().foreign_datagrams, 1);
    // It may be the robot, if the mission has a wrong port.
    let port = other.local_addr().unwrap().port();
    let trouble = trouble(&transport);
    assert!(trouble.contains(&format!("answers from port {port}; name that port")), "{trouble}");
    robot.send_to(b"hello", link).unwrap();
    transport.expect(b"hello", 0);
}

#[test]
fn a_wire_that_cannot_be_opened_is_tried_ever_less_often_and_says_why_with_the_remedy_until_bytes_come()
 {
    let (listener, address) = listener();
    drop(listener);
    let mut transport = open_at(&Address::Tcp(address));
    assert_eq!(transport.changes_at(0), Some(false));
    let (mut later_ms, mut pauses) = (0, Vec::new());
    for _ in 0..7 {
        // Refused at once or a moment later; the wire stays closed.
        while transport.attempts(later_ms * MS).unwrap().next_ns == 0 {
            assert_eq!(transport.changes_at(later_ms), None);
        }
        let wait_ms = transport.attempts(later_ms * MS).unwrap().next_ns / MS;
        pauses.push(wait_ms);
        later_ms += wait_ms;
    }
    assert_eq!(pauses, [100, 200, 400, 800, 1600, 2000, 2000]);
    let trouble = transport.trouble().unwrap();
    assert_eq!(trouble.input, format!("tcp://{address}"));
    assert!(trouble.what.contains("refused") && trouble.remedy.contains("robot.address"));
    let listener = TcpListener::bind(address).unwrap();
    let mut robot = transport.connected(&listener, later_ms);
    robot.write_all(b"hello").unwrap();
    transport.expect(b"hello", later_ms);
    assert_eq!(transport.trouble(), None);
}

fn listener() -> (TcpListener, SocketAddr) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    (listener, address)
}

/// Returns a robot that listens, the open transport to it, and its connection.
fn connection() -> (TcpListener, Transport, TcpStream) {
    let (listener, address) = listener();
    let mut transport = open_at(&Address::Tcp(address));
    let robot = transport.connected(&listener, 0);
    (listener, transport, robot)
}

#[test]
fn a_robot_that_ends_one_connection_after_another_serves_another_program_too() {
    let (listener, mut transport, mut robot) = connection();
    let mut now_ms = 0;
    for cuts in 1..=2 {
        robot.write_all(b"frame").unwrap();
        transport.expect(b"frame", now_ms);
        drop(robot);
        transport.expect_closing(now_ms);
        assert_eq!(transport.is_cut(), cuts > 1);
        now_ms += 10_000;
        robot = transport.connected(&listener, now_ms);
    }
    let why = trouble(&transport);
    assert!(why.contains("end the other program that connects to it"), "{why}");
    // A connection that lasts is its own.
    robot.write_all(b"frame").unwrap();
    transport.expect(b"frame", now_ms + 11_000);
    assert!(!transport.is_cut());
    // Nor is a robot that is off in anybody's hands.
    for _ in 0..2 {
        drop(robot);
        transport.expect_closing(now_ms);
        now_ms += 20_000;
        robot = transport.connected(&listener, now_ms);
        robot.write_all(b"frame").unwrap();
        transport.expect(b"frame", now_ms);
    }
    assert!(transport.is_cut());
    drop((robot, listener));
    transport.expect_closing(now_ms);
    while transport.is_cut() {
        now_ms += 3000;
        assert_eq!(transport.changes_at(now_ms), None);
    }
    let why = trouble(&transport);
    assert!(why.contains("switch the robot on"), "{why}");
}

#[test]
fn a_connection_without_a_word_is_taken_for_dead() {
    let (listener, mut transport, _robot) = connection();
    assert_eq!([4999, 5000].map(|ms| transport.changes_at(ms)), [None, Some(false)]);
    transport.connected(&listener, 5000);
}

#[test]
fn a_line_that_takes_no_more_loses_whole_frames_only() {
    let (line, mut transport) = open_line();
    let mut message = Vec::new();
    Command::velocity([Some(400), Some(-400)], 250).encode(Addressing::default(), &mut message);
    // The robot does not read until commands are lost, and then while more are sent.
    let mut sent = 0;
    while transport.tally().unsent < 3 {
        transport.send(&message).unwrap();
        sent += 1;
        assert!(sent < 10_000_000, "it takes everything");
    }
    let mut decoder = Decoder::default();
    let mut frames = 0;
    let mut buffer = [0; 65_536];
    for _ in 0..2 {
        while poll::is_readable(&line.robot, Duration::from_millis(200)).unwrap() {
            let length = read(&line.robot, &mut buffer).unwrap();
            decoder.push(&buffer[..length]);
            while decoder.next_frame().is_some() {
                frames += 1;
            }
            transport.changes_at(0);
        }
        transport.send(&message).unwrap();
        sent += 1;
    }
    assert_eq!(decoder.tally().bad_crc, 0, "half a frame went out");
    // The last one is in flight.
    assert_eq!(frames + 1, sent - transport.tally().unsent);
}

/// Robot's end of a serial line, and a stable path to the other.
struct Line {
    robot: OwnedFd,
    name: PathBuf,
    _directory: TempDir,
}

fn plug_in(name: &Path) -> OwnedFd {
    let robot = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).unwrap();
    grantpt(&robot).unwrap();
    unlockpt(&robot).unwrap();
    let path = ptsname(&robot, Vec::new()).unwrap();
    std::os::unix::fs::symlink(path.to_str().unwrap(), name).unwrap();
    fcntl_setfl(&robot, fcntl_getfl(&robot).unwrap() | OFlags::NONBLOCK).unwrap();
    robot
}

fn line() -> Line {
    let directory = tempfile::tempdir().unwrap();
    let name = directory.path().join("ttyUSB0");
    Line { robot: plug_in(&name), name, _directory: directory }
}

/// Returns a line and the open transport to it.
fn open_line() -> (Line, Transport) {
    let line = line();
    let mut transport = open_at(&Address::Serial(line.name.clone()));
    transport.maintain_until(true, 0);
    (line, transport)
}

fn read_from(robot: &OwnedFd, length: usize) -> Vec<u8> {
    let mut heard = Vec::new();
    let mut buffer = [0; 256];
    while heard.len() < length {
        ready(robot);
        match read(robot, &mut buffer) {
            Ok(length) => heard.extend_from_slice(&buffer[..length]),
            Err(error) => assert_eq!(error, Errno::AGAIN),
        }
    }
    heard
}

#[test]
fn a_serial_line_is_set_to_115200_8n1_and_carries_every_byte_as_it_is() {
    let (line, mut transport) = open_line();
    let settings = tcgetattr(&line.robot).unwrap();
    assert_eq!(settings.output_speed(), 115_200);
    let frame = ControlModes::CSIZE | ControlModes::PARENB | ControlModes::CSTOPB;
    assert_eq!(settings.control_modes & frame, ControlModes::CS8);
    assert!(!settings.local_modes.contains(LocalModes::ECHO));
    let bytes = Vec::from_iter(0..=255);
    transport.send(&bytes).unwrap();
    assert_eq!(read_from(&line.robot, 256), bytes);
    write(&line.robot, &bytes).unwrap();
    transport.expect(&bytes, 0);
}

#[test]
fn a_line_to_an_arduino_has_the_boards_speed_and_is_closed_without_a_hangup_that_would_restart_it()
{
    let line = line();
    let mut settings = tcgetattr(&line.robot).unwrap();
    settings.control_modes.insert(ControlModes::HUPCL);
    tcsetattr(&line.robot, OptionalActions::Now, &settings).unwrap();
    let address = Address::Serial(line.name);
    let mut transport = Transport::of_base(&address, &mission(ARDUINO)).unwrap();
    transport.maintain_until(true, 0);
    let settings = tcgetattr(&line.robot).unwrap();
    assert_eq!(settings.output_speed(), 57_600);
    assert!(!settings.control_modes.contains(ControlModes::HUPCL));
}

#[test]
fn a_serial_line_that_is_pulled_out_is_opened_again_when_it_is_back() {
    let (mut line, mut transport) = open_line();
    write(&line.robot, b"here").unwrap();
    transport.expect(b"here", 0);
    std::fs::remove_file(&line.name).unwrap();
    // The line hangs up when the robot's end is closed.
    drop(line.robot);
    transport.expect_closing(0);
    assert_eq!([0, 100, 300].map(|ms| transport.changes_at(ms)), [None; 3], "it is not there");
    line.robot = plug_in(&line.name);
    assert_eq!(transport.changes_at(699), None);
    transport.maintain_until(true, 700);
    transport.send(b"stand").unwrap();
    assert_eq!(read_from(&line.robot, 5), b"stand");
}

#[test]
fn a_serial_line_is_for_one_link_and_free_again_when_that_is_killed() {
    let (line, first) = open_line();
    let mut second = open_at(&Address::Serial(line.name.clone()));
    assert_eq!(second.changes_at(0), Some(false));
    // Another process holds the line, as a simulated robot does.
    let _holder = open(&line.name, OFlags::RDWR | OFlags::NOCTTY, Mode::empty()).unwrap();
    drop(first);
    second.maintain_until(true, 100);
}

#[test]
fn a_file_that_is_no_serial_line_is_never_written_to() {
    let mut transport = open_at(&Address::Serial("/dev/null".into()));
    assert_eq!(transport.changes_at(0), Some(false));
    transport.send(b"ping").unwrap();
    assert_eq!(transport.tally().unsent, 1);
}
