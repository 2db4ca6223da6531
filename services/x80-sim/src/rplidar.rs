//! An RPLIDAR beside the robot: it turns clockwise all the time, and after a request says each measurement when it was made.

use common::{
    kinematics::Pose2,
    mission::{Mission, Rplidar as Product},
};
use rplidar_protocol::{Answer, Node, Request, Requests};

use crate::{laser::Laser, world::World};

/// Of 0 to 63, of each reading. Nominal.
const QUALITY: u8 = 47;

#[derive(Clone, Debug)]
pub(crate) struct Rplidar {
    pub(crate) laser: Laser,
    product: Product,
    requests: Requests,
    /// Mission time of the next measurement while it scans, seconds.
    next_s: Option<f64>,
    turn: f64,
}

impl Rplidar {
    /// None if the robot has no laser with a wire of its own; the noise follows from `seed`.
    pub(crate) fn new(mission: &Mission, seed: u64) -> Option<Self> {
        let (_, _, product) = mission.rplidar()?;
        let laser = Laser::new(mission, seed)?;
        Some(Self { laser, product, requests: Requests::default(), next_s: None, turn: 0.0 })
    }

    pub(crate) const fn is_scanning(&self) -> bool {
        self.next_s.is_some()
    }

    /// Returns the answers. Requests that it does not know are not answered, as by old firmware.
    pub(crate) fn answer(&mut self, bytes: &[u8], now: f64) -> Vec<u8> {
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
                    // Model, version 1.29 of the firmware, version of the hardware, serial number.
                    let mut info = [0x5a; 20];
                    info[..4].copy_from_slice(&[self.product.number, 29, 1, 7]);
                    Answer::Info(info)
                }
                Request::Other => continue,
            };
            answers.extend(answer.encode());
        }
        answers
    }

    /// The bytes of what was measured up to `now` since the call before. The robot is at `pose` now.
    pub(crate) fn measured(&mut self, world: &World, pose: Pose2, now: f64) -> Vec<u8> {
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
