//! RPLIDAR beside the robot: it always rotates clockwise, and sends each measurement when made, on
//! request.

use common::{
    kinematics::Pose2,
    mission::{Mission, Rplidar as Product},
};
use rplidar_protocol::{Answer, Node, Request, Requests};

use crate::{laser::Laser, world::World};

/// Quality of each reading, 0 to 63. Nominal.
const QUALITY: u8 = 47;

pub struct Rplidar {
    pub laser: Laser,
    product: Product,
    requests: Requests,
    /// Mission time of the next measurement while scanning.
    next_s: Option<f64>,
    turn: f64,
}

impl Rplidar {
    pub fn new(mission: &Mission, seed: u64) -> Option<Self> {
        let (_, sensor, product) = mission.rplidars().into_iter().next()?;
        assert!(product.sample_us > 0 && product.turns_hz > 0.0);
        let laser = Laser::with_own_wire(sensor, mission, seed);
        Some(Self { laser, product, requests: Requests::default(), next_s: None, turn: 0.0 })
    }

    pub const fn is_scanning(&self) -> bool {
        self.next_s.is_some()
    }

    /// Ignores unknown requests, like old firmware.
    pub fn answer(&mut self, bytes: &[u8], now: f64) -> Vec<u8> {
        let mut answers = Vec::new();
        for request in self.requests.push(bytes) {
            let answer = match request {
                Request::Scan | Request::ForceScan => {
                    self.next_s = Some(now);
                    Answer::Scan
                }
                Request::Stop | Request::Reset => {
                    self.next_s = None;
                    continue;
                }
                Request::Health => Answer::Health { status: 0, code: 0 },
                Request::SampleRate => Answer::SampleRate {
                    standard_us: self.product.sample_us,
                    express_us: self.product.sample_us / 2,
                },
                Request::Info => {
                    // Model, firmware version 1.29, hardware version, serial number.
                    let mut info = [0x5a; 20];
                    info[..4].copy_from_slice(&[self.product.number, 29, 1, 7]);
                    Answer::Info(info)
                }
            };
            answers.extend(answer.encode());
        }
        answers
    }

    /// Returns the measurements since the last call up to `now`, when the robot is at `pose`.
    pub fn measured(&mut self, world: &World, pose: Pose2, now: f64) -> Vec<u8> {
        let mut bytes = Vec::new();
        let Some(mut at) = self.next_s.filter(|at| *at <= now) else {
            return bytes;
        };
        let near = self.laser.near(world, pose);
        while at <= now {
            let turn = at * self.product.turns_hz;
            let degrees = turn.fract() * 360.0;
            let range = self.laser.clockwise(&near, at, degrees.to_radians());
            let range = range.filter(|range| *range > 0.0);
            let node = Node {
                is_first: turn.floor() > self.turn.floor(),
                quality: range.map_or(0, |_| QUALITY),
                angle_q6: (degrees * 64.0) as u16,
                distance_q2: range.map_or(0, |range| (range * 4000.0).round() as u16),
            };
            bytes.extend(node.encode());
            self.turn = turn;
            at += f64::from(self.product.sample_us) * 1e-6;
        }
        self.next_s = Some(at);
        bytes
    }
}

#[cfg(test)]
mod tests {

    use rplidar_protocol::{Decoder, Said};

    use super::*;
    use crate::testing::mission;

    /// A wall 2 m to the right and a shorter one 1 m ahead.
    fn at_the_walls(model: &str) -> (Rplidar, World) {
        let mission = mission(&format!(
            "robot.protocol = 'arduino'\nrobot.counts_per_turn = 1320\nworld.wall = [{{ points = [[-9, -2], [9, -2]] }}, {{ points = [[1, -1], [1, 1]] }}]\n[[robot.sensor]]\nname = 'laser'\nkind = 'scan'\nmodel = '{model}'\nforward_m = 0\nbearing_deg = 0\n"
        ));
        let mut laser = Rplidar::new(&mission, 1).unwrap();
        laser.laser.follow(0.0, Pose2::default());
        (laser, World::new(&mission))
    }

    #[test]
    fn a_laser_measures_after_a_request_only_each_sample_in_its_time_and_clockwise() {
        for (model, a_second, turns) in [("rplidar-a1", 1969, 5), ("rplidar-c1", 5000, 9)] {
            let (mut laser, world) = at_the_walls(model);
            let express = [0xa5, 0x82, 5, 0, 0, 0, 0, 0, 0x22];
            assert!(laser.answer(&express, 0.0).is_empty());
            assert!(laser.measured(&world, Pose2::default(), 1.0).is_empty());
            let mut decoder = Decoder::default();
            let answer = laser.answer(&[0xa5, 0x20], 1.0);
            assert_eq!(decoder.push(&answer), [Said::Answer(Answer::Scan)]);
            let said: Vec<_> = (1..=200)
                .flat_map(|ms| {
                    let now = 1.0 + f64::from(ms) * 0.005;
                    decoder.push(&laser.measured(&world, Pose2::default(), now))
                })
                .collect();
            assert!(said.len().abs_diff(a_second) < 4, "{}", said.len());
            let node = |said: &Said| match said {
                Said::Node(node) => *node,
                other => panic!("{other:?}"),
            };
            let nodes: Vec<_> = said.iter().map(node).collect();
            let first = nodes.iter().filter(|node| node.is_first).count();
            assert!(first.abs_diff(turns) < 2, "{first}");
            let at = |degrees: u16| {
                let near = |node: &&Node| node.angle_q6.abs_diff(degrees * 64) < 48;
                nodes.iter().filter(near).map(|node| node.distance_q2 / 4).max().unwrap()
            };
            assert!(at(90).abs_diff(2000) < 100 && at(1).abs_diff(1000) < 60 && at(180) == 0);
            assert!(laser.answer(&[0xa5, 0x25], 2.0).is_empty());
            assert!(laser.measured(&world, Pose2::default(), 3.0).is_empty());
        }
    }
}
