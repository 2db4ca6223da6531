//! Tests of the process shell on a real loopback socket, at both paces.

use std::{
    net::UdpSocket,
    time::{Duration, Instant},
};

use common::{
    clock::Pace,
    wire::{Command, Report, SystemSignal},
};

use crate::support::{PATIENCE, Sim, encoded, forward, receive, reports};

const PING: Command = Command::System(SystemSignal::Ping);
const ACK: Report = Report::System(SystemSignal::Ack);

fn exchange(host: &UdpSocket, command: &[u8]) -> [Vec<u8>; 2] {
    host.send(command).unwrap();
    [receive(host), receive(host)]
}

#[test]
fn at_max_each_motion_command_moves_time_by_one_period_and_nothing_else_does() {
    let world = "simulation.realism = 'measured'\nworld.wall = [{ points = [[1, -1], [1, 1]] }]";
    let mut sim = Sim::start(world, Pace::Max);
    let host = sim.host();
    let start = sim.next_truth();
    assert_eq!((start.tick, start.time_s, start.x), (0, 0.0, 0.0));

    let [ack, first] = exchange(&host, &encoded(PING));
    assert_eq!(reports(&ack), [ACK]);
    let [_, again] = exchange(&host, &encoded(PING));
    // A ping changes nothing.
    assert_eq!(first, again);

    for tick in 1..=20_u64 {
        let [ack, frames] = exchange(&host, &forward(500, 250));
        assert_eq!(reports(&ack), [ACK]);
        let ground_truth = sim.next_truth();
        assert_eq!(ground_truth.tick, tick);
        assert!((ground_truth.time_s - tick as f64 / 7.0).abs() < 1e-9);
        let [_, current] = exchange(&host, &encoded(PING));
        // A ping shows the tick once more.
        assert_eq!(frames, current);
    }
    sim.finish();
}

#[test]
fn the_stream_goes_to_whoever_spoke_last_and_noise_is_no_speech() {
    let sim = Sim::start("robot.rate_hz = 50", Pace::Rate(2.0));
    let (first, second) = (sim.host(), sim.host());
    first.send(&encoded(PING)).unwrap();
    receive(&first);
    second.send(&[0x5e, 0x02, 1, 0, 0xff, 1, 0, 0, 0x5e, 0x0d]).unwrap();
    for _ in 0..5 {
        receive(&first);
    }
    second.send(&encoded(PING)).unwrap();
    for _ in 0..5 {
        receive(&second);
    }
}

#[test]
fn half_a_frame_of_one_host_does_not_garble_the_other() {
    let sim = Sim::start("", Pace::Max);
    let (first, second) = (sim.host(), sim.host());
    exchange(&first, &encoded(PING));
    let ping = encoded(PING);
    first.send(&ping[..4]).unwrap();
    second.send(&ping[..7]).unwrap();
    first.send(&ping[4..]).unwrap();
    assert_eq!(reports(&receive(&first)), [ACK]);
    second.send(&ping[7..]).unwrap();
    assert_eq!(reports(&receive(&second)), [ACK]);
}

#[test]
fn one_of_another_host_is_ignored_until_the_first_is_silent() {
    let sim = Sim::start("robot.rate_hz = 20", Pace::Rate(5.0));
    let (first, ping) = (sim.host(), encoded(PING));
    first.send(&ping).unwrap();
    receive(&first);
    let second = UdpSocket::bind("127.0.0.2:0").unwrap();
    second.connect(&sim.listening).unwrap();
    second.set_read_timeout(Some(Duration::from_millis(300))).unwrap();
    let began = Instant::now();
    // The second host keeps asking; the first has sent nothing since.
    second.send(&ping).unwrap();
    while second.recv(&mut [0; 512]).is_err() {
        second.send(&ping).unwrap();
        assert!(began.elapsed() < PATIENCE);
    }
    assert!(began.elapsed().as_secs_f64() > 1.0, "{:?}", began.elapsed());
}
