//! Tests with third-party hosts, as the protocol notes describe them.
//!
//! They share no code with the wire module, so that its mistakes cannot cancel out.

use std::{
    collections::VecDeque,
    fs::{File, OpenOptions},
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

impl Wire for TcpStream {
    fn send(&mut self, bytes: &[u8]) {
        self.write_all(bytes).unwrap();
    }
    fn receive(&mut self) -> Vec<u8> {
        read_some(self)
    }
}

impl Wire for File {
    fn send(&mut self, bytes: &[u8]) {
        self.write_all(bytes).unwrap();
    }
    fn receive(&mut self) -> Vec<u8> {
        read_some(self)
    }
}

fn read_some(stream: &mut impl Read) -> Vec<u8> {
    // A small buffer splits frames.
    let mut buffer = [0; 13];
    let length = stream.read(&mut buffer).expect("the robot sends");
    buffer[..length].to_vec()
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
fn one_that_only_sends_velocities_and_expects_the_streams() {
    let sim = Sim::start(QUICK, Pace::Rate(5.0));
    let mut host = Host::new(sim.host());
    host.send(26, &[0, 0x70, 0xfe]);
    host.send(26, &[1, 0x90, 0x01]);
    let mut seen = [0_usize; 256];
    for _ in 0..60 {
        seen[usize::from(host.next().0)] += 1;
    }
    assert!([123, 124, 125].iter().all(|&did| seen[did] >= 19), "streams are missing");
    let [left, right] = host.counts();
    assert!((200..20_000).contains(&right), "it moved {right} counts");
    assert!((32_768 - 20_000..32_768 - 200).contains(&left), "it moved {left} counts");
}

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
    let before = host.counts()[1];
    for _ in 0..10 {
        host.counts();
    }
    assert!(host.counts()[1] > before + 100);
}

#[test]
fn one_that_acks_every_motor_frame_and_gives_up_after_two_seconds_of_silence() {
    let sim = Sim::start(QUICK, Pace::Rate(5.0));
    let socket = sim.host();
    socket.set_read_timeout(Some(Duration::from_secs(2))).unwrap();
    let mut host = Host::new(socket);
    host.send(255, &[0]);
    for _ in 0..40 {
        host.counts();
        host.send(255, &[1]);
    }
    assert_eq!(host.acks, 1, "the ping's: an ACK is not acknowledged");
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
    drive(Host::new(stream));
    drive(Host::new(TcpStream::connect(&sim.listening).unwrap()));

    let sim = Sim::start_on(QUICK, Pace::Rate(5.0), Transport::Pty);
    let line = OpenOptions::new().read(true).write(true).open(&sim.listening).unwrap();
    drive(Host::new(line));
}

/// Sends a velocity command in two pieces, and asserts its ACK and motion.
fn drive<W: Wire>(mut host: Host<W>) {
    host.wire.send(&[0x5e, 0x02, 0x01]);
    host.wire.send(&[0x00, 0xff, 0x01, 0x00, 0xdb, 0x5e, 0x0d]);
    host.wait_for_ack(1);
    host.send(26, &[1, 0x90, 0x01]);
    host.wait_for_ack(2);
    let before = host.counts()[1];
    for _ in 0..10 {
        host.counts();
    }
    assert!(host.counts()[1] > before + 50);
}

#[test]
fn one_of_another_host_is_ignored_until_the_first_is_silent() {
    let sim = Sim::start(QUICK, Pace::Rate(5.0));
    let ping = |socket: &UdpSocket| {
        let mut host = Host::new(socket.try_clone().unwrap());
        host.send(255, &[0]);
    };
    let first = sim.host();
    ping(&first);
    Host::new(first.try_clone().unwrap()).counts();
    let second = UdpSocket::bind("127.0.0.2:0").unwrap();
    second.connect(&sim.listening).unwrap();
    let short = Duration::from_millis(300);
    second.set_read_timeout(Some(short)).unwrap();
    let began = Instant::now();
    // The second host keeps asking; the first has sent nothing since.
    loop {
        ping(&second);
        if second.recv(&mut [0; 512]).is_ok() {
            break;
        }
        assert!(began.elapsed() < PATIENCE, "never served");
    }
    assert!(began.elapsed().as_secs_f64() > 1.0, "{:?}", began.elapsed());
}
