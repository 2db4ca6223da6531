//! Robot without a process: it has the bytes of one.

use common::{
    clock::Pace,
    ground_truth::GroundTruthTick,
    json_wire::{Order, line},
    wire::{Command, SystemSignal},
};
use rplidar_protocol::START;
use x80_sim::InMemory;

use crate::support::{Sim, encoded, forward, mission, port};

#[test]
fn at_max_its_datagrams_and_its_truth_are_those_of_a_process() {
    let world =
        "[simulation]\nrealism = 'measured'\n[[world.wall]]\npoints = [[-1, 1.5], [4, 1.5]]";
    let radio = format!("{world}\n[simulation.radio]\nloss_share = 0.2\nsplit_share = 0.3");
    let json = format!("robot.model = 'turtlebot3-waffle'\n{world}");
    let drive = line(&Order::Drive { wheels: [4.0, 3.0], twist: [0.1, 0.1], for_s: 0.25 });
    let ping = encoded(Command::System(SystemSignal::Ping));
    let json_ping = line(&Order::Ping {});
    let arduino = format!(
        "robot.protocol = 'arduino'\nrobot.counts_per_turn = 1320\n{world}\n[[robot.sensor]]\nname = 'laser'\nkind = 'scan'\nmodel = 'rplidar-a1'\nforward_m = 0\nbearing_deg = 0"
    );
    let requests = [b"e\rm 30 20\r".to_vec(), vec![START, 0x20]];
    for (text, orders) in [
        (world, [forward(400, 250), ping.clone()]),
        (&radio, [forward(400, 250), ping]),
        (&json, [drive, json_ping]),
        (&arduino, requests),
    ] {
        let sim = Sim::start(text, Pace::Max);
        // Of the robot, and of its laser.
        let hosts = [7, 8].map(|number| (port(number), sim.host()));
        let mut robot = InMemory::start(&mission(text), Pace::Max).unwrap();
        assert_eq!(robot.next_due_ns(), None);
        let mut buffer = vec![0; 65_536];
        for order in orders.iter().cycle().take(60) {
            let (from, host) = &hosts[usize::from(order.starts_with(&[START]))];
            host.send(order).unwrap();
            robot.hear(*from, order).unwrap();
            for (to, datagram) in robot.sent() {
                let (_, host) = hosts.iter().find(|(at, _)| *at == to).unwrap();
                let length = host.recv(&mut buffer).unwrap();
                assert!(datagram == buffer[..length], "{text}");
            }
        }
        let as_told = |tick: GroundTruthTick| -> GroundTruthTick {
            serde_json::from_str(&serde_json::to_string(&tick).unwrap()).unwrap()
        };
        let process = sim.finish();
        assert!(process.len() > 30, "{text}");
        let truth: Vec<_> = robot.truth.into_iter().map(as_told).collect();
        assert_eq!(truth, process, "{text}");
    }
}
