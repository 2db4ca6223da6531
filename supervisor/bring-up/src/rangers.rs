//! Liveliness and noise of sensors, bearings of sonars, and what rangers and gyro say of way and turn.

use std::f64::consts::TAU;

use common::{
    geometry::wrap_angle,
    mission::{Mission, Sensor, SensorKind},
    samples::{RangeReading, RangeStatus},
};

use crate::{
    Finding, Placed, Trace,
    body::{Moves, SizesTold},
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
/// A sonar is wider than a beam; so much are the shares of way and turn that sonars tell.
const SIZES_TOLD: SizesTold = SizesTold { sizes: 0.15, ratio: f64::INFINITY };
/// The scales of the turn that are tried: half to double, by equal factors.
const SCALE_RATIO: f64 = 1.02;
const SCALES: i32 = 35;
/// Shares of way that wheels of another size may have; an echo that changes by another is not of what is ahead.
const SHARES: std::ops::Range<f64> = 0.3..3.0;
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

/// What rangers and gyro say, and without a laser that saw the way, what the body did.
pub(crate) fn findings(
    mission: &Mission,
    trace: &Trace,
    motion: &Motion,
    placed: Option<&Placed>,
    gyro: Option<&Gyro>,
) -> Vec<Finding> {
    let mut found = Vec::new();
    if let Some(gyro) = gyro {
        found.extend(scale_of_gyro(gyro, placed));
    }
    let table = mission.sensor_table();
    let cones = || table.iter().enumerate().filter(|(_, it)| it.kind == SensorKind::Cone);
    let by_wheels = |at: f64| between(motion, at).map_or(0.0, |[angle, _]| angle);
    let seen = |heading: &dyn Fn(f64) -> f64| -> Vec<_> {
        cones().map(|(row, it)| (it, seen_turning(trace, row, it, heading))).collect()
    };
    let heading: Box<dyn Fn(f64) -> f64> = match placed {
        Some(placed) => Box::new(|at| placed.pose(at).heading),
        None if cones().count() == 0 => return found,
        None => {
            let turn = Turn::best(|scale| disagreement(&seen(&|at| scale * by_wheels(at))));
            let moves = moves(mission, trace, motion, turn);
            if let Some(motors) = moves.motors(mission) {
                found.push(motors);
                return found;
            }
            found.extend(match moves.way {
                Some(way) if (way - 1.0).abs() <= SIZES_TOLD.sizes => {
                    let text = "the front sonar sees";
                    let text =
                        format!("{text} {:.0} % of the way that the wheels count", 100.0 * way);
                    Some(Finding::right("way", text))
                }
                Some(_) => None,
                None => {
                    let text =
                        "its way was not seen: let it stand 0.8 to 2 m before a wall, facing it";
                    Some(Finding::unknown("way", text))
                }
            });
            let sizes = moves.sizes(mission, SIZES_TOLD);
            // By wheels of another size no bearing is known well.
            if !sizes.is_empty() {
                found.extend(sizes);
                return found;
            }
            Box::new(by_wheels)
        }
    };
    let all = seen(&heading);
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

/// The turns over those by the wheels at which the sonars agree best.
#[derive(Clone, Copy, Debug)]
struct Turn {
    turns_back: bool,
    /// None if the sonars agree at the turns that the wheels say, or at none.
    scale: Option<f64>,
    agrees: bool,
}

impl Turn {
    /// `differs` gives the disagreement of the sonars at a scale of the wheels' turns.
    fn best(differs: impl Fn(f64) -> Option<f64>) -> Option<Self> {
        let scales =
            |sign: f64| (-SCALES..=SCALES).map(move |power| sign * SCALE_RATIO.powi(power));
        let least = |sign| {
            let each = scales(sign).filter_map(|scale| Some((differs(scale)?, scale)));
            each.min_by(|a, b| a.0.total_cmp(&b.0))
        };
        let (ahead, back) = (least(1.0)?, least(-1.0)?);
        let is_better = |new: f64, old: f64| {
            old > LEAST_DIFFERENCE_M && new < LEAST_DIFFERENCE_M.min(EXPLAINS * old)
        };
        let turns_back = is_better(back.0, ahead.0);
        let (best, stated) = if turns_back { (back, -1.0) } else { (ahead, 1.0) };
        let scale = is_better(best.0, differs(stated)?).then_some(best.1.abs());
        Some(Self { turns_back, scale, agrees: best.0 < LEAST_DIFFERENCE_M })
    }
}

/// What the sonars say of the body's motion.
fn moves(mission: &Mission, trace: &Trace, motion: &Motion, turn: Option<Turn>) -> Moves {
    let rims_m = mission.body().track_m / 2.0;
    let turned_m = |[angle, _]: [f64; 2]| angle * rims_m;
    // A wheel that turns backwards drives the body where it is told to turn. Sonars that agree on a turn saw one.
    let turning = [(Told::TurnLeft, 1.0), (Told::TurnRight, -1.0)].into_iter();
    let mut driven = turning.filter_map(|(told, sign)| {
        let share = sign * share_of_way(mission, trace, motion, told, turned_m)?;
        (0.5..2.0).contains(&share.abs()).then_some(share)
    });
    let driven = driven.find(|_| turn.is_none_or(|turn| !turn.agrees));
    let share = share_of_way(mission, trace, motion, Told::Drive, |[_, way]| way);
    let share = share.filter(|share| SHARES.contains(&share.abs()));
    Moves {
        turns_back: driven.map_or(turn.is_some_and(|turn| turn.turns_back), |share| share < 0.0),
        drives_back: share.is_some_and(|share| share < 0.0),
        exchanged: driven.is_some(),
        turn: turn.and_then(|turn| turn.scale),
        way: share.map(f64::abs),
        curl: 0.0,
    }
}

fn scale_of_gyro(gyro: &Gyro, placed: Option<&Placed>) -> Option<Finding> {
    let moves = placed.map(Placed::moves);
    let truth = moves.and_then(|it| it.turn).unwrap_or(1.0);
    let scale = gyro.scale.abs() / truth;
    if (scale - 1.0).abs() <= GYRO_TOLD {
        let is_told = gyro.agrees() && moves.is_none_or(|it| !it.turns_back && !it.exchanged);
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
