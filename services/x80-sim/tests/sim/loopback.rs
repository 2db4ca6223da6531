//! Tests of the process shell on a real loopback socket, at both paces.

use std::net::{SocketAddr, UdpSocket};

use common::{
    clock::Pace,
    wire::{Addressing, Command, Decoder, Report, SystemSignal},
};
use x80_sim::{SimError, SimOptions, Transport, run};

use crate::support::{self, Sim, mission, receive};

fn encoded(command: Command) -> Vec<u8> {
    let mut bytes = Vec::new();
    command.encode(Addressing::Numbered, &mut bytes);
    bytes
}

fn forward(counts: i16) -> Command {
    Command::velocity([Some(-counts), Some(counts)], 250)
}

const PING: Command = Command::System(SystemSignal::Ping);
const ACK: Report = Report::System(SystemSignal::Ack);

fn reports(datagram: &[u8]) -> Vec<Report> {
    let mut decoder = Decoder::default();
    decoder.push(datagram);
    let mut reports = Vec::new();
    while let Some(frame) = decoder.next_frame() {
        reports.push(Report::parse(&frame).unwrap());
    }
    reports
}

fn exchange(host: &UdpSocket, command: Command) -> [Vec<u8>; 2] {
    host.send(&encoded(command)).unwrap();
    [receive(host), receive(host)]
}

#[test]
fn at_max_each_motion_command_moves_time_by_one_period_and_nothing_else_does() {
    let mut sim = Sim::start("", Pace::Max);
    let host = sim.host();
    let start = sim.next_truth();
    assert_eq!((start.tick, start.time_s, start.x), (0, 0.0, 0.0));

    let [ack, first] = exchange(&host, PING);
    assert_eq!(reports(&ack), [ACK]);
    let [_, again] = exchange(&host, PING);
    assert_eq!(first, again, "a ping changes nothing");

    for tick in 1..=20_u64 {
        let [ack, frames] = exchange(&host, forward(500));
        assert_eq!(reports(&ack), [ACK]);
        let ground_truth = sim.next_truth();
        assert_eq!(ground_truth.tick, tick);
        assert!((ground_truth.time_s - tick as f64 / 7.0).abs() < 1e-9);
        let Some(Report::Motor(motor)) = reports(&frames).last().copied() else {
            panic!("no motor frame in {frames:?}");
        };
        let shown = motor.encoders.map(|encoder| encoder.position);
        let reversed = (32_768 - ground_truth.left_counts) % 32_768;
        assert_eq!(shown, [reversed, ground_truth.right_counts]);
        let [_, current] = exchange(&host, PING);
        assert_eq!(frames, current, "a ping shows the tick once more");
    }
    assert!(sim.stop().is_ok());
}

#[test]
fn at_max_the_same_seed_and_commands_give_the_same_bytes() {
    let mission = "[simulation]\nrealism = 'measured'\n[[world.drum]]\nat = [2, 0.3]\nradius_m = 0.3\n[[world.wall]]\npoints = [[-1, 1.5], [4, 1.5]]";
    let run = |seed: u64| {
        let sim = Sim::start(&format!("seed = {seed}\n{mission}"), Pace::Max);
        let host = sim.host();
        let mut bytes = Vec::new();
        for tick in 0..60_i16 {
            bytes.extend(exchange(&host, forward(300 + tick)).concat());
            bytes.extend(exchange(&host, PING).concat());
        }
        bytes
    };
    let first = run(7);
    assert!(first == run(7), "the same seed gave other bytes");
    assert!(first != run(8), "another seed gave the same bytes");
}

fn listen_only(mut line: impl std::io::Read) {
    let mut decoder = Decoder::default();
    let (mut motor, mut standard) = (0, 0);
    while motor < 3 || standard < 3 {
        let mut bytes = [0; 512];
        let length = line.read(&mut bytes).expect("frames come unasked");
        assert!(length > 0, "the robot hung up");
        decoder.push(&bytes[..length]);
        while let Some(frame) = decoder.next_frame() {
            match Report::parse(&frame) {
                Ok(Report::Motor(_)) => motor += 1,
                Ok(Report::Standard(_)) => standard += 1,
                _ => {}
            }
        }
    }
}

#[test]
fn a_client_that_only_listens_hears_the_streams_over_tcp_and_on_a_serial_line() {
    let sim = Sim::start_on("robot.rate_hz = 20", Pace::Rate(5.0), Transport::Tcp);
    let line = std::net::TcpStream::connect(&sim.listening).unwrap();
    line.set_read_timeout(Some(support::PATIENCE)).unwrap();
    listen_only(line);
    let sim = Sim::start_on("robot.rate_hz = 20", Pace::Rate(5.0), Transport::Pty);
    listen_only(std::fs::File::open(&sim.listening).unwrap());
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
    exchange(&first, PING);
    let ping = encoded(PING);
    first.send(&ping[..4]).unwrap();
    second.send(&ping[..7]).unwrap();
    first.send(&ping[4..]).unwrap();
    assert_eq!(reports(&receive(&first)), [ACK]);
    second.send(&ping[7..]).unwrap();
    assert_eq!(reports(&receive(&second)), [ACK]);
}

#[test]
fn a_port_in_use_is_named_with_its_remedy() {
    let taken = UdpSocket::bind("127.0.0.1:0").unwrap();
    let listen = taken.local_addr().unwrap();
    let (stop, _other) = std::os::unix::net::UnixStream::pair().unwrap();
    let options = SimOptions {
        mission: mission(""),
        pace: Pace::Max,
        listen,
        transport: Transport::Udp,
        own_user_only: false,
        keep: None,
        ground_truth: None,
        meeting: None,
    };
    let error = run(options, stop).expect_err("the port was free after all");
    assert!(matches!(error, SimError::Bind { address, .. } if address == listen));
    let text = error.to_string();
    assert!(text.contains(&listen.to_string()) && text.contains("port 0"), "{text}");
}

#[test]
fn a_robot_whose_truth_nobody_reads_goes_on() {
    let (reader, writer) = std::os::unix::net::UnixStream::pair().unwrap();
    drop(reader);
    let (stop, stopped) = std::os::unix::net::UnixStream::pair().unwrap();
    // Take a port that was just free: the ground truth, which states it, is closed.
    let listen: SocketAddr = {
        let probe = UdpSocket::bind("127.0.0.1:0").unwrap();
        probe.local_addr().unwrap()
    };
    let options = SimOptions {
        mission: mission(""),
        pace: Pace::Max,
        listen,
        transport: Transport::Udp,
        own_user_only: false,
        keep: None,
        ground_truth: Some(Box::new(writer)),
        meeting: None,
    };
    let sim = std::thread::spawn(move || run(options, stopped));
    let host = UdpSocket::bind("127.0.0.1:0").unwrap();
    host.connect(listen).unwrap();
    host.set_read_timeout(Some(std::time::Duration::from_millis(50))).unwrap();
    let deadline = std::time::Instant::now() + support::PATIENCE;
    let mut answered = false;
    while !answered && std::time::Instant::now() < deadline {
        // Sending and receiving fail until the robot listens.
        let _ = host.send(&encoded(forward(100)));
        answered = host.recv(&mut [0; 2048]).is_ok();
    }
    assert!(answered);
    drop(stop);
    assert!(sim.join().unwrap().is_ok());
}
