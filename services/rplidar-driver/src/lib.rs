//! Driver of RPLIDARs, which turn clockwise and report single measurements by [`rplidar_protocol`].

use std::f64::consts::{PI, TAU};

use common::{
    driver::{Driver, Heard, LaserScan, WireTally, beam},
    mission::{Rplidar as Product, Sensor},
    samples::{LONGEST_SWEEP_NS, Sweep},
};
use rplidar_protocol::{Answer, Decoder, Node, Request, Said};

/// Padding after a stop: the sensor needs 1 ms before a request, and 64 invalid bytes take longer
/// at 460,800 baud.
const PAUSE: [u8; 64] = [0; 64];
const HEALTH_ERROR: u8 = 2;

#[derive(Debug)]
pub struct Rplidar {
    row: usize,
    sensor: Sensor,
    decoder: Decoder,
    sample_ns: i64,
    count: i64,
    /// None before the first turn, and after a loss until the next.
    turn: Option<Turn>,
    tally: WireTally,
}

/// Turn in progress.
#[derive(Clone, Debug)]
struct Turn {
    /// Number of its first measurement.
    began: i64,
    first_beam: usize,
    beams: Vec<f32>,
}

impl Rplidar {
    pub fn new(row: usize, sensor: Sensor, product: Product) -> Self {
        Self {
            row,
            sensor,
            decoder: Decoder::default(),
            sample_ns: i64::from(product.sample_us) * 1000,
            count: 0,
            turn: None,
            tally: WireTally::default(),
        }
    }

    fn take_node(&mut self, node: Node) -> Option<LaserScan> {
        let degrees = f64::from(node.angle_q6) / 64.0;
        // Counter-clockwise in the robot's frame, unless upside down.
        let bearing = if self.sensor.is_upside_down { degrees } else { -degrees }.to_radians();
        let step = TAU / self.sensor.beams as f64;
        let at = ((bearing + PI).rem_euclid(TAU) / step).round() as usize % self.sensor.beams;
        let mut over = None;
        if node.is_first {
            let beams = vec![f32::NAN; self.sensor.beams];
            over = self.turn.replace(Turn { began: self.count, first_beam: at, beams });
        }
        self.turn.take_if(|turn| (self.count - turn.began) * self.sample_ns > LONGEST_SWEEP_NS);
        if let Some(held) = self.turn.as_mut().and_then(|turn| turn.beams.get_mut(at)) {
            let is_reading = node.quality > 0 && node.distance_q2 > 0;
            let range = is_reading.then(|| f32::from(node.distance_q2) / 4000.0);
            *held = held.min(beam(&self.sensor, range));
        }
        let scan = over.map(|turn| self.scan_of(turn));
        self.count += 1;
        scan
    }

    /// Returns the scan, with a measurement number for its first beam's time.
    fn scan_of(&self, turn: Turn) -> LaserScan {
        let Turn { began, first_beam, mut beams } = turn;
        // The sensor reports lost echoes as nothing in reach, which is trusted only where no
        // neighbour beam ended.
        let ended: Vec<_> = beams.iter().map(|beam| beam.is_finite()).collect();
        let count = ended.len();
        for (beam, range) in beams.iter_mut().enumerate().filter(|(_, range)| range.is_infinite()) {
            if [beam + count - 1, beam + 1].into_iter().any(|beam| ended[beam % count]) {
                *range = f32::NAN;
            }
        }
        let beam_ns = (self.count - began) * self.sample_ns / beams.len().max(1) as i64;
        let sweep = Sweep {
            first_beam_ns: began,
            beam_ns: if self.sensor.is_upside_down { beam_ns } else { -beam_ns },
            first_beam: first_beam as u64,
        };
        LaserScan { row: self.row, beams, sweep, stamp_ns: None }
    }
}

impl Driver for Rplidar {
    fn hear(&mut self, bytes: &[u8]) -> Heard {
        let mut heard = Heard::default();
        for said in self.decoder.push(bytes) {
            match said {
                Said::Node(node) => heard.scans.extend(self.take_node(node)),
                Said::Answer(Answer::Health { status: HEALTH_ERROR, code }) => {
                    heard.refused = Some(format!(
                        "the laser {:?} reports the health error {code:#06x} and does not scan; cut its power for a moment",
                        self.sensor.name
                    ).into());
                }
                Said::Answer(Answer::SampleRate { standard_us: us @ 50..=2000, .. }) => {
                    self.sample_ns = i64::from(us) * 1000;
                }
                Said::Answer(Answer::Scan) => self.turn = None,
                Said::Answer(_) => {}
                Said::Noise => {
                    self.turn = None;
                    self.tally.bytes_dropped += 1;
                }
            }
        }
        // The decoder holds back the newest.
        for LaserScan { sweep, .. } in &mut heard.scans {
            sweep.first_beam_ns = (sweep.first_beam_ns - self.count) * self.sample_ns;
        }
        self.tally.messages += heard.scans.len() as u64;
        heard.anything = !heard.scans.is_empty();
        heard
    }

    fn reset(&mut self) {
        self.decoder = Decoder::default();
        self.turn = None;
    }

    fn tally(&self) -> WireTally {
        self.tally
    }

    fn greeting(&self) -> Vec<u8> {
        let requests = [Request::Stop, Request::Health, Request::SampleRate, Request::Scan];
        requests.map(Request::encode).join(&PAUSE[..])
    }
}

#[cfg(test)]
mod tests;
