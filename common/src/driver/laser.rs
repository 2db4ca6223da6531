//! The laser of a robot, which may be stuck or blind.

use super::{LaserScan, Readings, odometry::drive};
use crate::{
    kinematics::WheelSpeeds,
    mission::{Body, Mission, Sensor},
    samples::{RangeReading, RangeStatus},
};

/// A laser is stuck if its scans stay the same to the bit while a wheel turns this far, radians.
const STUCK_RAD: f64 = 1.0;
/// A laser whose beams all see nothing is blind if, in the scan before, more than one beam in so many ended within half its reach:
/// nothing that fills so much of its view leaves it in a moment.
const BLIND_ONE_IN: usize = 20;

#[derive(Clone, Debug)]
pub struct Laser {
    body: Body,
    row: usize,
    sensor: Sensor,
    /// The newest scan that differed from the one before, and the wheels' angles then.
    newest_scan: (Vec<f32>, [f64; 2]),
    /// The beams that ended near in the newest scan that saw anything, and the wheels' angles then.
    near: (usize, [f64; 2]),
    is_blind: bool,
    turned: [f64; 2],
    scan: LaserScan,
}

impl Laser {
    pub fn new(mission: &Mission) -> Option<Self> {
        let (row, sensor) = mission.laser()?;
        Some(Self {
            body: mission.body(),
            row,
            sensor,
            newest_scan: (Vec::new(), [0.0; 2]),
            near: (0, [0.0; 2]),
            is_blind: false,
            turned: [0.0; 2],
            scan: LaserScan::default(),
        })
    }

    pub const fn sensor(&self) -> &Sensor {
        &self.sensor
    }

    pub const fn turned(&mut self, turned: [f64; 2]) {
        self.turned = turned;
    }

    /// A beam as the topic `scan` has it: infinite for none or one beyond reach, no number for one too short to be a range.
    pub fn beam(&self, range: Option<f32>) -> f32 {
        let (least_m, reach_m) = (self.sensor.model.least_m() as f32, self.sensor.reach_m as f32);
        match range {
            Some(range) if range < least_m || range.is_nan() => f32::NAN,
            Some(range) if range <= reach_m => range,
            _ => f32::INFINITY,
        }
    }

    pub fn for_tick(&mut self) -> LaserScan {
        std::mem::take(&mut self.scan)
    }

    /// Takes beams as [`Laser::beam`] gives them. The nearest counts as the reading of the laser's row; none does if the laser is blind
    /// or stuck.
    pub fn take(&mut self, scan: LaserScan, readings: &mut Readings) {
        let beams = &scan.beams;
        let (newest, turned_then) = &self.newest_scan;
        let [bits_then, bits_now] =
            [newest, beams].map(|beams| beams.iter().map(|beam| beam.to_bits()));
        let is_same = beams.iter().any(|beam| beam.is_finite()) && bits_then.eq(bits_now);
        let went = |wheel: usize| (self.turned[wheel] - turned_then[wheel]).abs();
        let is_stuck = is_same && went(0).max(went(1)) > STUCK_RAD;
        self.look_for_blindness(&scan.beams);
        let is_refused = is_stuck || self.is_blind;
        if !is_same {
            self.newest_scan = (scan.beams.clone(), self.turned);
        }
        let nearest = scan.beams.iter().copied().fold(f32::NAN, f32::min);
        let (status, range_m) = match nearest {
            nearest if is_refused || nearest.is_nan() => (RangeStatus::Invalid, 0.0),
            nearest if nearest.is_infinite() => (RangeStatus::Nothing, 0.0),
            nearest => (RangeStatus::Measured, nearest.into()),
        };
        let status = status.into();
        readings.take(self.row, RangeReading { range_m, status, ..RangeReading::default() });
        if !is_refused {
            self.scan = scan;
        }
    }

    fn look_for_blindness(&mut self, beams: &[f32]) {
        if beams.iter().any(|beam| beam.is_finite()) {
            let near_m = self.sensor.reach_m as f32 / 2.0;
            let near = beams.iter().filter(|beam| **beam < near_m).count();
            (self.near, self.is_blind) = ((near, self.turned), false);
        } else if beams.iter().any(|beam| beam.is_infinite()) {
            let (near, turned_then) = self.near;
            let [left, right] = [0, 1].map(|wheel| self.turned[wheel] - turned_then[wheel]);
            let turn = drive(&self.body).twist(WheelSpeeds { right, left }).omega;
            // A turn removes things from a view that is no whole circle.
            let is_circle = self.sensor.field_of_view_deg >= 360.0;
            let lost = if is_circle { 0.0 } else { turn.abs() / self.sensor.fan().1 };
            self.is_blind |= near > beams.len() / BLIND_ONE_IN + lost.ceil() as usize;
        }
    }
}
