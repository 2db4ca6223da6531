//! Sensor readings since the last tick, with checks for stuck and blind lasers.

mod robot_time;

use std::f64::consts::TAU;

use common::{
    clock::MissionTime,
    driver::{Heard, LaserScan, Motion, counts::WheelCounts},
    mission::{Body, Mission, Sensor},
    samples::{LONGEST_SWEEP_NS, RangeReading, RangeStatus},
};
use robot_time::RobotTime;

/// Wheel turn after which a bitwise constant scan is stuck, radians.
const STUCK_RAD: f64 = 1.0;
/// A laser that sees nothing is blind if more than one beam in this many just ended within half its
/// reach: nothing that large vanishes at once.
const BLIND_ONE_IN: usize = 20;

#[derive(Clone, Debug)]
pub(crate) struct Sensors {
    body: Body,
    table: Vec<Sensor>,
    newest: Vec<RangeReading>,
    lasers: Vec<Laser>,
    ticks: u64,
    robot_time: RobotTime,
    /// Newest counts, and the wheels' angles.
    counts: Option<WheelCounts>,
    turned: [f64; 2],
}

impl Sensors {
    pub(crate) fn new(mission: &Mission) -> Self {
        let table = mission.sensor_table();
        let lasers = mission.lasers().into_iter();
        Self {
            body: mission.body(),
            newest: absent(&table),
            lasers: lasers.map(|(row, sensor)| Laser::new(row, sensor)).collect(),
            table,
            ticks: 0,
            robot_time: RobotTime::default(),
            counts: None,
            turned: [0.0; 2],
        }
    }

    /// Takes a driver's message, with its arrival time if `own_wire`. Returns its readings; a
    /// scan's nearest beam is its laser's reading.
    pub(crate) fn take_heard(
        &mut self,
        heard: &mut Heard,
        own_wire: Option<MissionTime>,
    ) -> Vec<RangeReading> {
        if let Some(Motion { wheels, endless, .. }) = &heard.motion {
            let counts = WheelCounts::of(wheels, endless.as_ref());
            let since = self.counts.replace(counts).map_or([0.0; 2], |then| counts.since(then));
            let radians = since.map(|counts| counts * TAU / self.body.counts_per_turn);
            self.turned = [0, 1].map(|wheel| self.turned[wheel] + radians[wheel]);
        }
        let mut readings = std::mem::take(&mut heard.readings);
        for scan in std::mem::take(&mut heard.scans) {
            if let Some(laser) = self.lasers.iter_mut().find(|laser| laser.row == scan.row) {
                readings.push(laser.take_scan((scan, own_wire), self.turned, &self.body));
            }
        }
        readings.retain(|reading| usize::from(reading.sensor) < self.newest.len());
        for reading in &readings {
            self.newest[usize::from(reading.sensor)] = *reading;
        }
        readings
    }

    pub(crate) fn for_tick(
        &mut self,
        motion: &Motion,
        now: MissionTime,
    ) -> (Vec<RangeReading>, Vec<LaserScan>) {
        let tick = self.ticks;
        self.ticks += 1;
        let mut readings = std::mem::replace(&mut self.newest, absent(&self.table));
        assert_eq!(readings.len(), self.table.len());
        debug_assert!((0..).zip(&readings).all(|(row, reading)| reading.sensor == row));
        for (reading, sensor) in readings.iter_mut().zip(&self.table) {
            if !tick.is_multiple_of(sensor.every_ticks) {
                *reading = RangeReading { sensor: reading.sensor, ..RangeReading::default() };
            }
        }
        if let Some(stamp_ns) = motion.stamp_ns {
            self.robot_time.tick(stamp_ns, now);
        }
        let taken = |laser: &mut Laser| {
            let (mut scan, own_wire) = laser.scan.take()?;
            let first_beam_ns = &mut scan.sweep.first_beam_ns;
            let stamp_ns = scan.stamp_ns.filter(|_| motion.stamp_ns.is_some());
            let stated_ns = stamp_ns.and_then(|stamp_ns| self.robot_time.since_tick_ns(stamp_ns));
            // The robot's clock may have been set since the scan.
            let stated_ns = stated_ns.filter(|ns| ns.abs() <= LONGEST_SWEEP_NS);
            match (own_wire, stated_ns) {
                (Some(came), _) => *first_beam_ns -= now.since(came).as_nanos() as i64,
                (None, Some(stated_ns)) => *first_beam_ns = stated_ns,
                (None, None) => {}
            }
            Some(scan)
        };
        (readings, self.lasers.iter_mut().filter_map(taken).collect())
    }
}

fn absent(table: &[Sensor]) -> Vec<RangeReading> {
    (0..).zip(table).map(|(sensor, _)| RangeReading { sensor, ..RangeReading::default() }).collect()
}

#[derive(Clone, Debug)]
struct Laser {
    row: usize,
    sensor: Sensor,
    /// The newest that differed, and the wheels' angles then.
    newest_scan: (Vec<f32>, [f64; 2]),
    /// Near beams of the newest scan with any, and the wheels' angles then.
    near: (usize, [f64; 2]),
    is_blind: bool,
    /// Scan for the next tick, with its arrival time on an own wire.
    scan: Option<(LaserScan, Option<MissionTime>)>,
}

impl Laser {
    const fn new(row: usize, sensor: Sensor) -> Self {
        let newest_scan = (Vec::new(), [0.0; 2]);
        Self { row, sensor, newest_scan, near: (0, [0.0; 2]), is_blind: false, scan: None }
    }

    /// Returns the nearest beam; invalid if blind or stuck.
    fn take_scan(
        &mut self,
        scan: (LaserScan, Option<MissionTime>),
        turned: [f64; 2],
        body: &Body,
    ) -> RangeReading {
        let beams = &scan.0.beams;
        let (newest, turned_then) = &self.newest_scan;
        let [bits_then, bits_now] =
            [newest, beams].map(|beams| beams.iter().map(|beam| beam.to_bits()));
        let is_same = beams.iter().any(|beam| beam.is_finite()) && bits_then.eq(bits_now);
        let went = |wheel: usize| (turned[wheel] - turned_then[wheel]).abs();
        let is_stuck = is_same && went(0).max(went(1)) > STUCK_RAD;
        self.look_for_blindness(beams, turned, body);
        let is_refused = is_stuck || self.is_blind;
        if !is_same {
            self.newest_scan = (beams.clone(), turned);
        }
        let nearest = beams.iter().copied().fold(f32::NAN, f32::min);
        let (status, range_m) = match nearest {
            nearest if is_refused || nearest.is_nan() => (RangeStatus::Invalid, 0.0),
            nearest if nearest.is_infinite() => (RangeStatus::Nothing, 0.0),
            nearest => (RangeStatus::Measured, nearest.into()),
        };
        if !is_refused {
            self.scan = Some(scan).filter(|(scan, _)| !scan.beams.is_empty());
        }
        RangeReading { sensor: self.row as u8, range_m, raw: 0, status: status.into() }
    }

    fn look_for_blindness(&mut self, beams: &[f32], turned: [f64; 2], body: &Body) {
        if beams.iter().any(|beam| beam.is_finite()) {
            let near_m = self.sensor.reach_m as f32 / 2.0;
            let near = beams.iter().filter(|beam| **beam < near_m).count();
            (self.near, self.is_blind) = ((near, turned), false);
        } else if beams.iter().any(|beam| beam.is_infinite()) {
            let (near, turned_then) = self.near;
            let wheels = [0, 1].map(|wheel| turned[wheel] - turned_then[wheel]);
            let turn = body.unlimited().twist(wheels).omega;
            // Turns remove things from a partial view.
            assert!(self.sensor.fan().1 > 0.0);
            let is_circle = self.sensor.field_of_view_deg >= 360.0;
            let lost = if is_circle { 0.0 } else { turn.abs() / self.sensor.fan().1 };
            self.is_blind |= near > beams.len() / BLIND_ONE_IN + lost.ceil() as usize;
        }
    }
}

#[cfg(test)]
mod tests;
