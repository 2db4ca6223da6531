//! Tests with third-party hosts, as the protocol notes describe them.
//!
//! They share no code with the wire module, so that its mistakes cannot cancel out.

use std::{
    net::UdpSocket,
    time::{Duration, Instant},
};

use common::clock::Pace;

use crate::support::{PATIENCE, Sim, receive};

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

/// Foreign host with its unread bytes.
struct Host {
    wire: UdpSocket,
    bytes: Vec<u8>,
    acks: usize,
}

impl Host {
    fn new(wire: UdpSocket) -> Self {
        Self { wire, bytes: Vec::new(), acks: 0 }
    }

    fn send(&self, did: u8, data: &[u8]) {
        let mut frame = vec![0x5e, 0x02, 0x01, 0, did, data.len() as u8];
        frame.extend(data);
        frame.push(checksum(&frame[2..]));
        frame.extend([0x5e, 0x0d]);
        self.wire.send(&frame).unwrap();
    }

    /// Returns the DID and data of the next frame, which is whole and addressed to a host.
    fn next(&mut self) -> (u8, Vec<u8>) {
        if self.bytes.is_empty() {
            self.bytes = receive(&self.wire);
        }
        let length = 9 + usize::from(self.bytes[5]);
        let frame: Vec<u8> = self.bytes.drain(..length).collect();
        assert_eq!(frame[..3], [0x5e, 0x02, 0x00], "{frame:x?}");
        assert_eq!(frame[length - 3..], [checksum(&frame[2..length - 3]), 0x5e, 0x0d]);
        self.acks += usize::from(frame[4] == 255 && frame[6] == 1);
        (frame[4], frame[6..length - 3].to_vec())
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

const QUICK: &str = "robot.rate_hz = 20\nperimeter.width_m = 200";

#[test]
fn one_that_waits_for_an_ack_of_each_command() {
    let sim = Sim::start(QUICK, Pace::Rate(5.0));
    let mut host = Host::new(sim.host());
    let speeds: [i16; 6] = [-400, 400, -32_768, -32_768, -32_768, -32_768];
    for (did, data) in [
        (7, &[13, 0, 2][..]),
        (7, &[14, 1, 2]),
        (7, &[8, 0, 1, 15, 0, 2, 0, 0, 3, 0, 0]),
        (30, &[1, 0]),
        (27, &speeds.map(i16::to_le_bytes).concat()),
    ] {
        let acks = host.acks;
        host.send(did, data);
        while host.acks == acks {
            host.next();
        }
    }
    let before = host.counts()[1];
    let [left, right] = [(); 11].map(|()| host.counts())[10];
    assert_eq!(host.acks, 5, "one ACK for one command");
    assert!(right - before > 100);
    assert!(left > 32_768 - 20_000 && right < 20_000, "{left} {right}");
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
    let second = Host::new(second);
    let began = Instant::now();
    // The second host keeps asking; the first has sent nothing since.
    second.send(255, &[0]);
    while second.wire.recv(&mut [0; 512]).is_err() {
        second.send(255, &[0]);
        assert!(began.elapsed() < PATIENCE, "never served");
    }
    assert!(began.elapsed().as_secs_f64() > 1.0, "{:?}", began.elapsed());
}
