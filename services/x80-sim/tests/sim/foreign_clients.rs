//! Tests with third-party hosts, as the protocol notes describe them.
//!
//! They share no code with the wire module, so that its mistakes cannot cancel out.

use std::{
    collections::VecDeque,
    fs::OpenOptions,
    io::{Read, Write},
    net::{TcpStream, UdpSocket},
    time::{Duration, Instant},
};

use common::clock::Pace;
use x80_sim::Transport;

use crate::support::{self, PATIENCE, Sim};

/// Computes the CRC bit by bit, as in the vendor's documents.
fn checksum(bytes: &[u8]) -> u8 {
    let mut register = 0_u8;
    for &byte in bytes {
        for bit in 0..8 {
            let feedback = (register ^ (byte >> bit)) & 1;
            register >>= 1;
            if feedback == 1 {
                register ^= 0x8c;
            }
        }
    }
    register
}

/// Transport to the robot, as a foreign host opens it.
trait Wire {
    fn send(&mut self, bytes: &[u8]);
    fn receive(&mut self) -> Vec<u8>;
}

impl Wire for UdpSocket {
    fn send(&mut self, bytes: &[u8]) {
        UdpSocket::send(self, bytes).unwrap();
    }
    fn receive(&mut self) -> Vec<u8> {
        support::receive(self)
    }
}

/// A connection or a line.
struct Stream<S>(S);

impl<S: Read + Write> Wire for Stream<S> {
    fn send(&mut self, bytes: &[u8]) {
        self.0.write_all(bytes).unwrap();
    }
    fn receive(&mut self) -> Vec<u8> {
        // A small buffer splits frames.
        let mut buffer = [0; 13];
        let length = self.0.read(&mut buffer).expect("the robot sends");
        buffer[..length].to_vec()
    }
}

/// Foreign host with its frame end and unread bytes.
struct Host<W> {
    wire: W,
    end: [u8; 2],
    bytes: Vec<u8>,
    frames: VecDeque<(u8, Vec<u8>)>,
    acks: usize,
}

impl<W: Wire> Host<W> {
    fn new(wire: W) -> Self {
        Self { wire, end: [0x5e, 0x0d], bytes: Vec::new(), frames: VecDeque::new(), acks: 0 }
    }

    fn send(&mut self, did: u8, data: &[u8]) {
        let mut frame = vec![0x5e, 0x02, 0x01, 0, did, data.len() as u8];
        frame.extend(data);
        frame.push(checksum(&frame[2..]));
        frame.extend(self.end);
        self.wire.send(&frame);
    }

    /// Returns the next frame except ACKs, whole and addressed to this host.
    fn next(&mut self) -> (u8, Vec<u8>) {
        loop {
            if let Some(frame) = self.frames.pop_front() {
                return frame;
            }
            self.hear();
        }
    }

    fn hear(&mut self) {
        let came = self.wire.receive();
        self.bytes.extend(came);
        while self.bytes.len() >= 6 {
            let length = 9 + usize::from(self.bytes[5]);
            if self.bytes.len() < length {
                return;
            }
            let frame: Vec<u8> = self.bytes.drain(..length).collect();
            assert_eq!(frame[..2], [0x5e, 0x02], "{frame:x?}");
            assert_eq!(frame[2], 0x00, "addressed to somebody else");
            assert_eq!(frame[length - 3], checksum(&frame[2..length - 3]));
            assert_eq!(frame[length - 2..], [0x5e, 0x0d]);
            if frame[4] == 255 {
                assert_eq!(frame[6], 1, "an ACK");
                self.acks += 1;
            } else {
                self.frames.push_back((frame[4], frame[6..length - 3].to_vec()));
            }
        }
    }

    /// Returns the counts of channel 1 in `frames` motor frames.
    fn way(&mut self, frames: usize) -> u16 {
        let before = self.counts()[1];
        (0..frames).map(|_| self.counts()[1]).last().unwrap() - before
    }

    fn wait_for_ack(&mut self, acks: usize) {
        while self.acks < acks {
            self.hear();
        }
    }

    /// Returns channel counts of the next motor frame.
    fn counts(&mut self) -> [u16; 2] {
        loop {
            let (did, data) = self.next();
            if did == 123 {
                assert_eq!(data.len(), 33);
                return [24, 28].map(|at| u16::from_le_bytes([data[at], data[at + 1]]));
            }
        }
    }
}

fn words(values: &[i16]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

const QUICK: &str = "robot.rate_hz = 20\nperimeter.width_m = 200";

#[test]
fn one_that_waits_for_an_ack_of_each_command() {
    let sim = Sim::start(QUICK, Pace::Rate(5.0));
    let mut host = Host::new(sim.host());
    let setup: [(u8, Vec<u8>); 8] = [
        (7, vec![13, 0, 2]),
        (7, vec![13, 1, 2]),
        (7, vec![14, 0, 2]),
        (7, vec![14, 1, 2]),
        (7, vec![8, 0, 1, 15, 0, 2, 0, 0, 3, 0, 0]),
        (30, vec![1, 0]),
        (30, vec![1, 1]),
        (27, words(&[-400, 400, -32_768, -32_768, -32_768, -32_768])),
    ];
    for (sent, (did, data)) in setup.iter().enumerate() {
        host.send(*did, data);
        host.wait_for_ack(sent + 1);
        assert_eq!(host.acks, sent + 1, "one ACK for one command");
    }
    assert!(host.way(11) > 100);
    let [left, right] = host.counts();
    assert!(left > 32_768 - 20_000 && right < 20_000, "{left} {right}");
}

#[test]
fn one_that_begins_with_zeros_ends_wrong_and_leaves_channels_alone_its_own_way() {
    let sim = Sim::start(QUICK, Pace::Rate(5.0));
    let mut host = Host::new(sim.host());
    host.end = [0x5e, 0x13];
    Wire::send(&mut host.wire, &[0; 65]);
    // The command has LEN 15: a flag precedes the time.
    let mut data = words(&[-400, 400, -32_767, -32_767, -32_767, -32_767]);
    data.extend([28, 0xf4, 0x01]);
    host.send(27, &data);
    host.wait_for_ack(1);
    let mut counts = [0; 2];
    for _ in 0..20 {
        counts = host.counts();
    }
    // The wheel turned 400 counts/s for half a second of mission time, then stood.
    assert!((195..=205).contains(&counts[1]), "it moved {counts:?}");
    assert_eq!(host.counts(), counts);
}

#[test]
fn one_on_a_connection_and_one_on_a_serial_line() {
    let sim = Sim::start_on(QUICK, Pace::Rate(5.0), Transport::Tcp);
    let stream = TcpStream::connect(&sim.listening).unwrap();
    stream.set_read_timeout(Some(PATIENCE)).unwrap();
    drive(stream);
    drive(TcpStream::connect(&sim.listening).unwrap());

    let sim = Sim::start_on(QUICK, Pace::Rate(5.0), Transport::Pty);
    let line = OpenOptions::new().read(true).write(true).open(&sim.listening).unwrap();
    drive(line);
}

/// Listens, sends a velocity command in two pieces, and asserts its ACK and motion.
fn drive(stream: impl Read + Write) {
    let mut host = Host::new(Stream(stream));
    for stream in [123, 125] {
        while host.next().0 != stream {}
    }
    host.wire.send(&[0x5e, 0x02, 0x01]);
    host.wire.send(&[0x00, 0xff, 0x01, 0x00, 0xdb, 0x5e, 0x0d]);
    host.wait_for_ack(1);
    host.send(26, &[1, 0x90, 0x01]);
    host.wait_for_ack(2);
    assert!(host.way(11) > 50);
}

#[test]
fn one_of_another_host_is_ignored_until_the_first_is_silent() {
    let sim = Sim::start(QUICK, Pace::Rate(5.0));
    let mut first = Host::new(sim.host());
    first.send(255, &[0]);
    first.counts();
    let second = UdpSocket::bind("127.0.0.2:0").unwrap();
    second.connect(&sim.listening).unwrap();
    second.set_read_timeout(Some(Duration::from_millis(300))).unwrap();
    let mut second = Host::new(second);
    let began = Instant::now();
    // The second host keeps asking; the first has sent nothing since.
    second.send(255, &[0]);
    while second.wire.recv(&mut [0; 512]).is_err() {
        second.send(255, &[0]);
        assert!(began.elapsed() < PATIENCE, "never served");
    }
    assert!(began.elapsed().as_secs_f64() > 1.0, "{:?}", began.elapsed());
}
