//! Tests of the process shell on a real loopback socket, at both paces.

use common::{
    clock::Pace,
    wire::{Command, Report, SystemSignal},
};

use crate::support::{Sim, encoded, receive, reports};

const PING: Command = Command::System(SystemSignal::Ping);
const ACK: Report = Report::System(SystemSignal::Ack);

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
    let ping = encoded(PING);
    first.send(&ping).unwrap();
    receive(&first);
    receive(&first);
    first.send(&ping[..4]).unwrap();
    second.send(&ping[..7]).unwrap();
    first.send(&ping[4..]).unwrap();
    assert_eq!(reports(&receive(&first)), [ACK]);
    second.send(&ping[7..]).unwrap();
    assert_eq!(reports(&receive(&second)), [ACK]);
}
