//! Liveliness and noise of sensors, bearings of sonars, and what rangers and gyro say of way and turn.

use std::f64::consts::TAU;

use common::{
    geometry::wrap_angle,
    mission::{Mission, Protocol, Sensor, SensorKind},
    samples::{RangeReading, RangeStatus},
};

use crate::{
    Finding, Placed, Trace,
    trace::{Leg, Told, between},
    wheels::Motion,
};

/// The least share of ticks with a reading of a sensor that measures in each.
const LIVES: f64 = 0.5;
/// The noise of ranges at rest that is told, metres.
const NOISE_M: f64 = 0.1;
/// Width of the bins of a profile of ranges over bearings.
const BINS: usize = 72;
/// Ranges that differ by more count as different, metres.
const DIFFERENT_M: f64 = 0.5;
/// A bearing is told if it explains this share of the stated one's differences, and the least difference of the stated one, metres.
const EXPLAINS: f64 = 0.55;
const LEAST_DIFFERENCE_M: f64 = 0.12;
/// Samples that a bearing needs.
const LEAST_SAMPLES: usize = 30;
/// A bearing less beside the stated one is not told, bins.
const BESIDE_BINS: usize = 3;
/// A sonar is wider than a beam; so much is the share of way that the front one tells.
const WAY_TOLD: f64 = 0.15;
const GYRO_TOLD: f64 = 0.05;
/// A turn that tells something of a gyro, radians.
const LEAST_TURN: f64 = 2.0;

fn range_m(reading: &RangeReading) -> Option<f64> {
    (reading.status() == RangeStatus::Measured).then_some(reading.range_m)
}

/// The readings of a row with their times.
fn readings(trace: &Trace, row: usize) -> impl Iterator<Item = (f64, &RangeReading)> {
    let of = move |it: &&RangeReading| usize::from(it.sensor) == row;
    trace.ranges.iter().filter_map(move |(at, all)| Some((*at, all.iter().find(of)?)))
}

/// Whether each sensor of the table says something, and how noisy it is at rest.
pub(crate) fn liveliness(mission: &Mission, trace: &Trace) -> Vec<Finding> {
    let until = trace.rest_until_s();
    let ticks = trace.rolled.len().max(1) as f64;
    let mut found = Vec::new();
    for (row, sensor) in mission.sensor_table().iter().enumerate() {
        let name = &sensor.name;
        if sensor.kind == SensorKind::Scan {
            found.push(laser_lives(trace, row, sensor));
            continue;
        }
        let valid =
            |it: &RangeReading| !matches!(it.status(), RangeStatus::Absent | RangeStatus::Invalid);
        let said = readings(trace, row).filter(|(_, it)| valid(it)).count() as f64;
        let echoes = readings(trace, row).filter(|(_, it)| range_m(it).is_some()).count();
        if said * (sensor.every_ticks as f64) < LIVES * ticks {
            let text = "it says nothing in most ticks: check its plug, its name and its row";
            found.push(Finding::wrong(name, text));
            continue;
        }
        if echoes == 0 {
            let text = "it sees nothing all around: is something within its reach? A ranger whose transmitter is dead does so too";
            found.push(Finding::unknown(name, text));
            continue;
        }
        let mut ranges: Vec<f64> = readings(trace, row)
            .filter(|(at, _)| *at < until)
            .filter_map(|it| range_m(it.1))
            .collect();
        ranges.sort_by(f64::total_cmp);
        // Half of the readings lie between the quartiles: 1.35 deviations of a normal distribution.
        let noise = match ranges.len() {
            0..4 => 0.0,
            many => (ranges[3 * many / 4] - ranges[many / 4]) / 1.35,
        };
        found.push(match noise > NOISE_M {
            true => Finding::wrong(name, format!("its ranges vary by {noise:.2} m although the robot stands: check its supply and its mounting")),
            false => Finding::right(name, format!("it lives; noise at rest {noise:.3} m")),
        });
    }
    found
}

fn laser_lives(trace: &Trace, row: usize, sensor: &Sensor) -> Finding {
    let name = &sensor.name;
    let scans: Vec<_> = trace.scans.iter().filter(|it| it.1.sensor as usize == row).collect();
    let (Some(first), Some(last)) = (scans.first(), scans.last()) else {
        return Finding::wrong(
            name,
            "no scan came: check its cable, its topic, and the number of its beams",
        );
    };
    let hz = (scans.len() - 1) as f64 / (last.0 - first.0).max(1e-3);
    let beams: usize = scans.iter().map(|it| it.2.len()).sum();
    let ended: usize =
        scans.iter().map(|it| it.2.iter().filter(|range| range.is_finite()).count()).sum();
    let share = ended as f64 / beams.max(1) as f64;
    let text =
        format!("{hz:.1} scans a second, {:.0} % of the beams end at something", 100.0 * share);
    match share > 0.1 {
        true => Finding::right(name, text),
        false => Finding::wrong(
            name,
            format!("{text}: does anything stand around it, and is its window clean?"),
        ),
    }
}

/// The gyro against the wheels' turns.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Gyro {
    /// Its turns over those by the wheels.
    scale: f64,
}

impl Gyro {
    /// None without a gyro, or if the wheels hardly turned the body.
    pub(crate) fn of(trace: &Trace, motion: &Motion) -> Option<Self> {
        let gyro: Vec<_> = trace.gyro.iter().map(|(at, angle)| (*at, [*angle])).collect();
        let (mut squares, mut products, mut wheels) = (0.0, 0.0, 0.0);
        for leg in trace.legs() {
            if matches!(leg.told, Told::Stand | Told::Drive) {
                continue;
            }
            let turned = |at| Some((between(&gyro, at)?[0], between(motion, at)?[0]));
            let (from, until) = (turned(leg.from_s)?, turned(leg.until_s)?);
            let (own, by_wheels) = (until.0 - from.0, until.1 - from.1);
            squares += by_wheels * by_wheels;
            products += own * by_wheels;
            wheels += by_wheels.abs();
        }
        (wheels > LEAST_TURN).then(|| Self { scale: products / squares })
    }

    /// Whether it turns the way the wheels say.
    pub(crate) const fn agrees(&self) -> bool {
        self.scale > 0.0
    }
}

/// Ranges over the bearings from the robot as it stood first.
struct Profile(Vec<Vec<f64>>);

impl Profile {
    fn bin(bearing: f64) -> usize {
        (bearing.rem_euclid(TAU) / TAU * BINS as f64) as usize % BINS
    }

    fn of(seen: impl Iterator<Item = (f64, f64)>) -> Self {
        let mut bins = vec![Vec::new(); BINS];
        for (bearing, range) in seen {
            bins[Self::bin(bearing)].push(range);
        }
        for bin in &mut bins {
            bin.sort_by(f64::total_cmp);
        }
        Self(bins)
    }

    fn range(&self, bin: usize) -> Option<f64> {
        let ranges = self.0.get(bin % BINS)?;
        ranges.get(ranges.len() / 2).copied()
    }

    /// Mean difference of `seen` from the profile when it is turned by so many bins, metres; none if too little is comparable.
    fn difference(&self, seen: &[(f64, f64)], turned: usize) -> Option<f64> {
        let each = seen.iter().filter_map(|(bearing, range)| {
            Some((self.range(Self::bin(*bearing) + turned)? - range).abs().min(DIFFERENT_M))
        });
        let each: Vec<f64> = each.collect();
        (each.len() >= LEAST_SAMPLES).then(|| each.iter().sum::<f64>() / each.len() as f64)
    }
}

/// What sonars and infrared rangers saw while the robot turned: bearing from the first heading, and distance from the robot's centre.
fn seen_turning(
    trace: &Trace,
    row: usize,
    sensor: &Sensor,
    heading: &dyn Fn(f64) -> f64,
) -> Vec<(f64, f64)> {
    let turning = turning_legs(trace);
    readings(trace, row)
        .filter(|(at, _)| turning.iter().any(|leg| leg.contains(*at)))
        .filter_map(|(at, reading)| {
            let range = range_m(reading)? + sensor.mount.forward_m;
            Some((heading(at) + sensor.mount.bearing_rad, range))
        })
        .collect()
}

/// The turns before the robot drives away from its first place.
fn turning_legs(trace: &Trace) -> Vec<Leg> {
    let legs = trace.legs().into_iter().take_while(|leg| leg.told != Told::Drive);
    legs.filter(|leg| leg.told != Told::Stand).collect()
}

/// What rangers and gyro say beside the laser.
pub(crate) fn findings(
    mission: &Mission,
    trace: &Trace,
    motion: &Motion,
    placed: Option<&Placed>,
    gyro: Option<&Gyro>,
) -> Vec<Finding> {
    let placed = placed.filter(|placed| placed.is_sure());
    let mut found = Vec::new();
    if let Some(gyro) = gyro {
        found.extend(scale_of_gyro(gyro, placed));
    }
    let table = mission.sensor_table();
    let by_wheels = |at: f64| between(motion, at).map_or(0.0, |[angle, _]| angle);
    let heading: Box<dyn Fn(f64) -> f64> = match placed {
        Some(placed) => Box::new(|at| placed.pose(at).heading),
        None => Box::new(by_wheels),
    };
    let cones = || table.iter().enumerate().filter(|(_, it)| it.kind == SensorKind::Cone);
    let seen = |heading: &dyn Fn(f64) -> f64| -> Vec<_> {
        cones().map(|(row, it)| (it, seen_turning(trace, row, it, heading))).collect()
    };
    let all = seen(&heading);
    if placed.is_none() {
        let mirrored = seen(&|at| -by_wheels(at));
        let motors = motors(mission, trace, motion, disagreement(&all), disagreement(&mirrored));
        if let Some(motors) = motors {
            let is_wrong = motors.verdict == crate::Verdict::Wrong;
            found.push(motors);
            if is_wrong {
                return found;
            }
        }
    }
    for (place, (sensor, seen)) in all.iter().enumerate() {
        // Each is compared with what all others saw, or with the laser.
        let reference = match placed {
            Some(placed) => {
                Profile::of(placed.points.iter().map(|it| (it.to_angle(), it.length())))
            }
            None => others(&all, place),
        };
        // Of two sonars that disagree nobody knows which is wrong.
        if placed.is_some() || all.len() > 2 {
            found.extend(bearing(&reference, sensor, seen));
        }
    }
    found
}

type Seen<'a> = (&'a Sensor, Vec<(f64, f64)>);

/// What all sonars saw but the one at `place`.
fn others(all: &[Seen<'_>], place: usize) -> Profile {
    let others = all.iter().enumerate().filter(|(other, _)| *other != place);
    Profile::of(others.flat_map(|(_, (_, seen))| seen.iter().copied()))
}

/// Mean difference of what the sonars saw at the same bearings, metres; none for fewer than three, or where they saw little.
fn disagreement(all: &[Seen<'_>]) -> Option<f64> {
    let each =
        all.iter().enumerate().map(|(place, (_, seen))| others(all, place).difference(seen, 0));
    let each: Vec<f64> = each.flatten().collect();
    (all.len() > 2 && each.len() > 1).then(|| each.iter().sum::<f64>() / each.len() as f64)
}

/// The motors by the sonars alone: whether they agree better when the robot turns the other way, and where the front one sees it drive.
fn motors(
    mission: &Mission,
    trace: &Trace,
    motion: &Motion,
    plain: Option<f64>,
    mirrored: Option<f64>,
) -> Option<Finding> {
    let track_m = mission.body().track_m;
    let turns_back = plain.zip(mirrored).is_some_and(|(plain, mirrored)| {
        plain > LEAST_DIFFERENCE_M && mirrored < LEAST_DIFFERENCE_M.min(EXPLAINS * plain)
    });
    let is_x80 = mission.robot.protocol() == Protocol::X80;
    let (left, right) = (mission.robot.left, mission.robot.right);
    let reversed = |finding: Finding, sides: &[(&str, bool)]| {
        sides.iter().filter(|_| is_x80).fold(finding, |finding, (side, now)| {
            finding.with_key(format!("robot.{side}.reversed"), (!now).to_string())
        })
    };
    let swapped = |finding: Finding| match is_x80 {
        true => finding
            .with_key("robot.left.channel", right.channel.to_string())
            .with_key("robot.right.channel", left.channel.to_string()),
        false => finding,
    };
    // A wheel that turns backwards drives the body where it is told to turn.
    for (told, sign) in [(Told::TurnLeft, 1.0), (Told::TurnRight, -1.0)] {
        let rims = |[angle, _]: [f64; 2]| angle * track_m / 2.0;
        if let Some(share) = share_of_way(mission, trace, motion, told, rims)
            && (0.5..2.0).contains(&share.abs())
        {
            let (side, now) = if share * sign > 0.0 {
                ("left", left.reversed)
            } else {
                ("right", right.reversed)
            };
            let text = format!("told to turn, the body drives: the {side} wheel turns backwards");
            return Some(reversed(Finding::wrong("motors", text), &[(side, now)]));
        }
    }
    let share = share_of_way(mission, trace, motion, Told::Drive, |[_, way]| way);
    let both = [("left", left.reversed), ("right", right.reversed)];
    match (turns_back, share.map(|share| share < 0.0)) {
        (_, Some(false)) if share.is_some_and(|share| (share - 1.0).abs() > WAY_TOLD) => {}
        (true, Some(true)) => {
            let text = "it turns and drives the other way: both motors turn backwards";
            return Some(reversed(Finding::wrong("motors", text), &both));
        }
        (false, Some(true)) => {
            let text = "it drives backwards when it is told to drive ahead: the motors are swapped and turn backwards, or front and rear sonar are swapped";
            let finding = Finding::wrong("motors", text);
            return Some(swapped(reversed(
                finding,
                &[("left", right.reversed), ("right", left.reversed)],
            )));
        }
        (true, _) => {
            let text = "it turns the other way: the motors are swapped, left and right";
            let finding = swapped(Finding::wrong("motors", text));
            // A channel's direction goes with it.
            let flags = [("left", !right.reversed), ("right", !left.reversed)];
            return Some(reversed(finding, &flags));
        }
        _ => {}
    }
    let Some(share) = share else {
        let text = "its way was not seen: let it stand 0.8 to 2 m before a wall, facing it";
        return Some(Finding::unknown("way", text));
    };
    let text =
        format!("the front sonar sees {:.0} % of the way that the wheels count", 100.0 * share);
    Some(match (share - 1.0).abs() > WAY_TOLD {
        true => Finding::wrong("wheel size", text).with_key(
            "robot.counts_per_turn",
            format!("{:.0}", mission.body().counts_per_turn / share),
        ),
        false => Finding::right("way", text),
    })
}

fn scale_of_gyro(gyro: &Gyro, placed: Option<&Placed>) -> Option<Finding> {
    let truth = placed.map_or(1.0, |it| it.turn_scale().abs());
    let scale = gyro.scale.abs() / truth;
    if (scale - 1.0).abs() <= GYRO_TOLD {
        let is_told = gyro.agrees() && placed.is_none_or(Placed::is_plain);
        return is_told.then(|| {
            Finding::right("gyro", format!("it says {:.1} % of the turn", 100.0 * scale))
        });
    }
    Some(match placed {
        Some(_) => Finding::wrong("gyro", format!("it says {:.0} % of the turn that the laser sees: mend its scale", 100.0 * scale)),
        None if gyro.agrees() => Finding::wrong("gyro", format!("it says {:.0} % of the turn that the wheels say: its scale or robot.track_m is wrong", 100.0 * scale)),
        None => return None,
    })
    .filter(|_| scale.is_finite())
}

fn bearing(reference: &Profile, sensor: &Sensor, seen: &[(f64, f64)]) -> Option<Finding> {
    let stated = reference.difference(seen, 0)?;
    let turned = |bins: usize| Some((reference.difference(seen, bins)?, bins));
    let (least, bins) = (0..BINS).filter_map(turned).min_by(|a, b| a.0.total_cmp(&b.0))?;
    let beside = bins.min(BINS - bins);
    // Where the wheels' sizes are wrong no bearing fits.
    let fits = least < LEAST_DIFFERENCE_M.min(EXPLAINS * stated);
    if stated < LEAST_DIFFERENCE_M || !fits || beside < BESIDE_BINS {
        return None;
    }
    let off = wrap_angle(TAU * bins as f64 / BINS as f64);
    let deg = wrap_angle(sensor.mount.bearing_rad + off).to_degrees();
    let text = format!(
        "it sees what lies {:.0} degrees beside its stated bearing: it looks elsewhere, or two plugs are swapped",
        off.to_degrees()
    );
    Some(
        Finding::wrong(&sensor.name, text)
            .with_key(format!("robot.sensor.{}.bearing_deg", sensor.name), format!("{deg:.0}")),
    )
}

/// The way by the front sonar's echo over `way` by the wheels, in the legs in which the robot is told so; less than 0 for a way back. None
/// if the echo shows none.
fn share_of_way(
    mission: &Mission,
    trace: &Trace,
    motion: &Motion,
    told: Told,
    way: impl Fn([f64; 2]) -> f64,
) -> Option<f64> {
    let row = mission.front_row();
    let mut shares = Vec::new();
    for leg in trace.legs().iter().filter(|leg| leg.told == told && leg.seconds() > 1.0) {
        let in_leg = readings(trace, row).filter(|(at, _)| leg.contains(*at));
        let points: Vec<(f64, f64)> =
            in_leg.filter_map(|(at, it)| Some((way(between(motion, at)?), range_m(it)?))).collect();
        let count = points.len() as f64;
        let mean = |of: fn(&(f64, f64)) -> f64| points.iter().map(of).sum::<f64>() / count;
        let (x, y) = (mean(|it| it.0), mean(|it| it.1));
        let sum = |of: &dyn Fn(f64, f64) -> f64| {
            points.iter().map(|it| of(it.0 - x, it.1 - y)).sum::<f64>()
        };
        let (xx, xy, yy) = (sum(&|x, _| x * x), sum(&|x, y| x * y), sum(&|_, y| y * y));
        // Another wall behind the first, or a slanted one, gives no straight line.
        let mostly =
            2 * points.len() > readings(trace, row).filter(|(at, _)| leg.contains(*at)).count();
        if points.len() >= 6 && mostly && xx > 1e-3 && xy * xy > 0.95 * xx * yy {
            shares.push(-xy / xx);
        }
    }
    (!shares.is_empty()).then(|| shares.iter().sum::<f64>() / shares.len() as f64)
}
