//! Driver of robots that speak ROS 2, free of middleware.
//!
//! A received piece is one message: a byte, its row in [`Topics`], and the payload from DDS. The
//! writer's number precedes another node's command. Sent pieces are command payloads.

mod gyro;
pub mod messages;
pub mod publishers;
pub mod topics;

use std::{f64::consts::TAU, time::Duration};

use common::{
    driver::{
        Base, Commander, Driver, Heard, LaserScan, Motion, Turn, WireTally, beam,
        odometry::{self, motion, twist},
        range_reading,
    },
    geometry::wrap_angle,
    kinematics::Twist,
    mission::{Body, Mission, Sensor, TouchRow},
    samples::{LONGEST_SWEEP_NS, Sweep},
};
use ros2::{
    cdr::Cdr as _,
    msg::{BatteryState, Bool},
};

use self::{
    gyro::Gyro,
    messages::{
        Imu, NO_GROWTH, Odometry, Scan, is_repeated, read_hazards, read_moves, read_range,
        write_twist,
    },
    topics::{Content, Topics},
};

/// Longest absence of a link, with unknown motion.
const UNSEEN_S: f64 = 5.0;
/// Bearing tolerance between a laser's row and its scans, in beam steps.
const SAME_BEARING: f64 = 0.5;
/// Largest lead of a scan's stamp over odometry's.
const AHEAD_NS: i64 = 500_000_000;
/// Relative tolerance of beam steps.
const SAME_STEP: f64 = 0.01;

#[derive(Clone, Debug)]
pub struct Ros2 {
    body: Body,
    period_ns: i64,
    stamped: bool,
    topics: Topics,
    table: Vec<Sensor>,
    touches: Vec<TouchRow>,
    told_of_scan_stamp: bool,
    odometry: odometry::Odometry,
    gyro: Gyro,
    /// By the newest tick's odometry, radians.
    heading: Option<f64>,
    /// Stamp of the newest odometry, and the newest tick's due time, at most half a period before
    /// its own.
    stamps_ns: Option<[i64; 2]>,
    tally: WireTally,
}

impl Ros2 {
    pub fn new(mission: &Mission) -> Self {
        Self {
            body: mission.body(),
            period_ns: (1e9 / mission.robot.rate_hz) as i64,
            stamped: mission.robot.ros2.stamped,
            topics: Topics::of(mission),
            table: mission.sensor_table(),
            touches: mission.touches(),
            told_of_scan_stamp: false,
            odometry: odometry::Odometry::default(),
            gyro: Gyro::default(),
            heading: None,
            stamps_ns: None,
            tally: WireTally::default(),
        }
    }

    /// Takes a message, or refuses it without effect; the error says why.
    fn take(&mut self, piece: &[u8], heard: &mut Heard) -> Result<(), String> {
        if let Some((&publishers::TWO, gids)) = piece.split_first() {
            let odometry =
                self.topics.heard.iter().find(|(content, _)| *content == Content::Odometry);
            let words = odometry.and_then(|(_, topic)| publishers::words(&topic.name, gids));
            let words = words.ok_or("the publisher GIDs are invalid")?;
            heard.two_publishers = Some(words.clone());
            return Err(words);
        }
        let row_of =
            |(row, payload): (&u8, _)| Some((self.topics.heard.get(usize::from(*row))?, payload));
        let Some(((content, topic), payload)) = piece.split_first().and_then(row_of) else {
            return Err("the message belongs to an unknown topic".to_owned());
        };
        let content = *content;
        let name = topic.name.clone();
        self.take_payload(content, payload, heard).map_err(|why| format!("{name}: {why}"))?;
        // Other nodes' commands do not show the robot's presence.
        heard.anything |= content != Content::Command;
        Ok(())
    }

    fn take_payload(
        &mut self,
        content: Content,
        payload: &[u8],
        heard: &mut Heard,
    ) -> Result<(), String> {
        match content {
            Content::Odometry => self.take_odometry(&Odometry::read(payload)?, heard)?,
            Content::Scan(row) => {
                let mut scan = Scan::read(payload)?;
                if self.table.get(row).is_some_and(|sensor| sensor.is_upside_down) {
                    scan.turn_over();
                }
                self.take_scan(row, &scan, heard)?;
            }
            Content::Range(row) => {
                let range = read_range(payload)?;
                let sensor = self.table.get(row);
                // Infinite means nothing in reach.
                let range = Some(range).filter(|range| *range != f64::INFINITY);
                heard.readings.extend(sensor.map(|sensor| range_reading(row, sensor, range)));
            }
            Content::Battery => {
                let volts = BatteryState::decode(payload)?.voltage;
                if volts.is_finite() && volts >= 0.0 {
                    heard.take_battery(volts.into());
                }
            }
            Content::Imu => self.gyro.take(Imu::read(payload)?)?,
            Content::Touch(row) => heard.touched.push((row, Bool::decode(payload)?.data)),
            Content::Hazards => {
                let frames = read_hazards(payload)?;
                let feels =
                    |row: &TouchRow| frames.iter().any(|frame| frame.replace('_', "-") == row.name);
                heard.touched.extend(self.touches.iter().map(feels).enumerate());
            }
            Content::Command => {
                let (&number, payload) =
                    payload.split_first_chunk().ok_or("the command lacks its writer")?;
                heard.commander =
                    Some(Commander { number, moves: read_moves(payload, self.stamped)? });
            }
        }
        Ok(())
    }

    fn take_odometry(&mut self, odometry: &Odometry, heard: &mut Heard) -> Result<(), String> {
        let stamp_ns = odometry.stamp_ns;
        let [newest_ns, tick_ns] = match self.stamps_ns {
            Some([newest_ns, _]) if is_repeated(newest_ns, stamp_ns) => {
                return Err(NO_GROWTH.to_owned());
            }
            Some(stamps_ns) if stamp_ns > stamps_ns[0] => stamps_ns,
            _ => [stamp_ns - self.period_ns; 2],
        };
        let gap_s = self.stamps_ns.map_or(UNSEEN_S, |_| (stamp_ns - newest_ns) as f64 / 1e9);
        if self.odometry.takes_jump(odometry.pose, gap_s, &self.body) {
            heard.jumped = true;
            self.heading = None;
            let [x, y, heading] = odometry.pose;
            heard.refused = Some(format!(
                "odometry jumps to ({x:.2}, {y:.2}) m and {:.0} degrees; the link ignores the jump",
                heading.to_degrees()
            ).into());
        }
        let turned = self.odometry.turned(odometry.pose, &self.body);
        let turned = turned.ok_or("the pose is out of range; publish metres")?;
        // If odometry is faster than ticks, the message nearest to a tick's time begins it.
        let slack_ns = (stamp_ns - newest_ns) / 2;
        let is_tick = stamp_ns - tick_ns >= self.period_ns - slack_ns;
        // A late stamp must not skip the next message.
        let due_ns = (tick_ns + self.period_ns).clamp(stamp_ns - self.period_ns / 2, stamp_ns);
        heard.stamp_ns = Some(stamp_ns);
        self.stamps_ns = Some([stamp_ns, if is_tick { due_ns } else { tick_ns }]);
        if is_tick {
            let [_, _, heading] = odometry.pose;
            let before = self.heading.replace(heading).unwrap_or(heading);
            if let Some(why) = self.gyro.odometry(stamp_ns, wrap_angle(heading - before)) {
                heard.refused = Some(format!("the IMU: {why}").into());
            }
            let [v, omega] = odometry.twist;
            let speeds = self.body.unlimited().wheels(Twist { v, omega });
            heard.motion = Some(Motion {
                stamp_ns: Some(stamp_ns),
                ..motion(&self.body, turned, speeds, [false; 2])
            });
        }
        Ok(())
    }

    fn take_scan(&mut self, row: usize, scan: &Scan, heard: &mut Heard) -> Result<(), String> {
        let Some(sensor) = self.table.get(row) else {
            return Ok(());
        };
        let beams = scan.ranges.len();
        let most_s = LONGEST_SWEEP_NS as f64 / 1e9;
        let beam_s = f64::from(scan.beam_s);
        if !(0.0..=most_s).contains(&(beam_s * beams as f64)) {
            return Err(format!("time_increment is {beam_s}; give seconds, or 0"));
        }
        let range = |range: &f32| match *range {
            range if range < scan.least_m => Some(f32::NAN),
            // Infinite means nothing in reach.
            f32::INFINITY => None,
            range if range > scan.most_m && range <= 2.0 * scan.most_m => None,
            range => Some(range),
        };
        let came = scan.ranges.iter().map(|came| beam(sensor, range(came)));
        let beams = if is_same_fan(scan, sensor) {
            came.collect()
        } else if is_circle(scan.ranges.len(), scan.fan.1) && is_whole(sensor, scan) {
            turned_to(sensor, scan.fan, came)
        } else {
            return Err(other_fan(scan, sensor));
        };
        let sweep = sweep_of(scan, sensor);
        let is_near = |tick_ns| STAMPS_NS.contains(&(scan.stamp_ns - tick_ns));
        let is_stated = scan.stamp_ns != 0 && self.stamps_ns.is_none_or(|[ns, _]| is_near(ns));
        if !is_stated && !std::mem::replace(&mut self.told_of_scan_stamp, true) {
            heard.refused = Some(format!(
                "a scan's stamp, {} s, is far from odometry's, so the arrival of odometry replaces it; stamp both by one clock",
                scan.stamp_ns as f64 / 1e9
            ).into());
        }
        let sweep = if is_stated { sweep } else { Sweep::default() };
        heard.scans.push(LaserScan {
            row,
            beams,
            sweep,
            stamp_ns: is_stated.then_some(scan.stamp_ns),
        });
        Ok(())
    }
}

/// Plausible scan stamps relative to odometry's.
const STAMPS_NS: std::ops::RangeInclusive<i64> = -LONGEST_SWEEP_NS..=AHEAD_NS;

fn sweep_of(scan: &Scan, sensor: &Sensor) -> Sweep {
    let (first, step) = scan.fan;
    let (its_first, its_step) = sensor.fan();
    let along = if scan.is_reversed { -1.0 } else { 1.0 };
    let beam_ns = (along * f64::from(scan.beam_s) * 1e9 * its_step / step).round();
    if beam_ns == 0.0 || !beam_ns.is_finite() {
        return Sweep::default();
    }
    let measured_first = if scan.is_reversed { scan.ranges.len().saturating_sub(1) } else { 0 };
    let first = first + measured_first as f64 * step;
    let first_beam = if is_same_fan(scan, sensor) {
        measured_first as u64
    } else {
        ((first - its_first) / its_step).round().rem_euclid(sensor.beams as f64) as u64
    };
    Sweep { first_beam_ns: 0, beam_ns: beam_ns as i64, first_beam }
}

fn is_same_fan(scan: &Scan, sensor: &Sensor) -> bool {
    let (first, step) = scan.fan;
    let (its_first, its_step) = sensor.fan();
    scan.ranges.len() == sensor.beams
        && (first - its_first).abs() <= SAME_BEARING * its_step
        && (step - its_step).abs() <= SAME_STEP * its_step
}

fn is_circle(beams: usize, step: f64) -> bool {
    (beams as f64 * step.abs() - TAU).abs() <= 1.5 * step.abs()
}

fn is_whole(sensor: &Sensor, scan: &Scan) -> bool {
    sensor.field_of_view_deg >= 360.0 && scan.ranges.len() * 2 >= sensor.beams
}

/// Maps a circle's beams to the nearest of the row. The shortest of several counts; others have no
/// reading.
fn turned_to(sensor: &Sensor, fan: (f64, f64), came: impl Iterator<Item = f32>) -> Vec<f32> {
    let (first, step) = fan;
    let (its_first, its_step) = sensor.fan();
    let mut beams = vec![f32::NAN; sensor.beams];
    for (number, range) in came.enumerate() {
        let from_first = (first + number as f64 * step - its_first) / its_step;
        let nearest = from_first.round().rem_euclid(sensor.beams as f64) as usize;
        if let Some(beam) = beams.get_mut(nearest) {
            *beam = beam.min(range);
        }
    }
    beams
}

fn other_fan(scan: &Scan, sensor: &Sensor) -> String {
    let fan = |(first, step): (f64, f64), beams| {
        let first = first.to_degrees();
        let step = step.to_degrees();
        format!("{beams} beams from {first:.1} degrees in steps of {step:.3}")
    };
    format!(
        "the scan has {}, and the mission's laser has {}; correct beams and field_of_view_deg of its row",
        fan(scan.fan, scan.ranges.len()),
        fan(sensor.fan(), sensor.beams)
    )
}

impl Driver for Ros2 {
    fn hear(&mut self, piece: &[u8]) -> Heard {
        let mut heard = Heard::default();
        let taken = self.take(piece, &mut heard);
        self.tally.count(piece, taken, &mut heard);
        heard
    }

    fn reset(&mut self) {
        // Messages arrive whole.
    }

    fn tally(&self) -> WireTally {
        self.tally
    }
}

impl Base for Ros2 {
    fn turn_for_tick(&mut self) -> Option<Turn> {
        self.gyro.for_tick()
    }

    /// Omits the limit, for which `Twist` has no field.
    fn velocity(&self, counts: [i16; 2], _limit: Duration) -> Vec<u8> {
        let Twist { v, omega } = twist(&self.body, counts);
        write_twist(v, omega, self.stamped)
    }

    fn odometry(&mut self) -> Option<&mut odometry::Odometry> {
        Some(&mut self.odometry)
    }
}

#[cfg(test)]
mod tests;
