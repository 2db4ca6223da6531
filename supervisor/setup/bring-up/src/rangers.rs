//! Liveliness and noise of sensors, bearings of sonars, and body motion by rangers and gyro.

use std::f64::consts::TAU;

use calibration::response::spread;
use common::{
    geometry::wrap_angle,
    mission::{Mission, Sensor, SensorKind},
    samples::{RangeReading, RangeStatus},
};
use glam::DVec2;

use crate::{
    Finding, Placed, Trace,
    body::{Moves, SizesTold},
    trace::{Told, between},
    wheels::Motion,
};

/// Minimum share of ticks with a reading, for a sensor that measures in each.
const LIVES: f64 = 0.5;
/// Least range noise at rest that is reported, metres.
const NOISE_M: f64 = 0.1;
/// Number of bearing bins.
const BINS: usize = 72;
/// Cap of a range difference, metres.
const DIFFERENT_M: f64 = 0.5;
/// Maximum ratio of a reported bearing's difference to the stated one's, and the minimum of the
/// latter, metres.
const EXPLAINS: f64 = 0.55;
const LEAST_DIFFERENCE_M: f64 = 0.12;
const LEAST_SAMPLES: usize = 30;
/// Least reported deviation of a bearing, bins.
const BESIDE_BINS: usize = 3;
/// Minimum deviations by sonars, which are wider than beams.
const SIZES_TOLD: SizesTold = SizesTold { sizes: 0.15, ratio: f64::INFINITY };
/// Step of the tried turn scales, half to double.
const SCALE_RATIO: f64 = 1.02;
const SCALES: i32 = 35;
/// Multiple of the minimum disagreement within which scales are equally good.
const ALIKE: f64 = 1.5;
/// Plausible distance shares of wheels of another size. An echo with another share is not from
/// ahead.
const SHARES: std::ops::Range<f64> = 0.3..3.0;
const GYRO_TOLD: f64 = 0.05;
/// Minimum turn for a comparison with the gyro, radians.
const LEAST_TURN: f64 = 2.0;

fn range_m(reading: &RangeReading) -> Option<f64> {
    (reading.status() == RangeStatus::Measured).then_some(reading.range_m)
}

fn mean(values: impl Iterator<Item = f64>, least: usize) -> Option<f64> {
    let values: Vec<f64> = values.collect();
    (values.len() >= least).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

fn readings(trace: &Trace, row: usize) -> impl Iterator<Item = (f64, &RangeReading)> {
    let of = move |it: &&RangeReading| usize::from(it.sensor) == row;
    trace.ranges.iter().filter_map(move |(at, all)| Some((*at, all.iter().find(of)?)))
}

/// Returns a finding for each sensor about its reports and its noise at rest. `turned` says whether
/// the robot turned around.
pub(crate) fn liveliness(mission: &Mission, trace: &Trace, turned: bool) -> Vec<Finding> {
    let until = trace.rest_until_s();
    let ticks = trace.rolled.len().max(1) as f64;
    let table = mission.sensor_table();
    let sees = |row: usize| readings(trace, row).filter(|it| range_m(it.1).is_some()).count();
    let finding = |(row, sensor): (usize, &Sensor)| {
        let name = &sensor.name;
        if sensor.kind == SensorKind::Scan {
            return laser_lives(trace, row, sensor);
        }
        let valid =
            |it: &RangeReading| !matches!(it.status(), RangeStatus::Absent | RangeStatus::Invalid);
        let said = readings(trace, row).filter(|(_, it)| valid(it)).count() as f64;
        if said * (sensor.every_ticks as f64) < LIVES * ticks {
            return Finding::wrong(
                name,
                "it reports nothing in most ticks; check its plug, its name and its row",
            );
        }
        let seen_by_others = || {
            table.iter().enumerate().any(|(other, it)| {
                let alike = it.kind == SensorKind::Cone && it.reach_m <= sensor.reach_m;
                alike && 2 * sees(other) > readings(trace, other).count()
            })
        };
        if sees(row) == 0 && turned && sensor.kind == SensorKind::Cone && seen_by_others() {
            return Finding::wrong(
                name,
                "it sees nothing all around, although others do; check its plug, its pin and its transmitter",
            );
        }
        if sees(row) == 0 {
            return Finding::unknown(
                name,
                "it sees nothing all around; put something within its reach, or check its transmitter",
            );
        }
        let mut ranges: Vec<f64> = readings(trace, row)
            .filter(|(at, _)| *at < until)
            .filter_map(|it| range_m(it.1))
            .collect();
        ranges.sort_by(f64::total_cmp);
        // The quartiles lie 1.35 deviations of a normal distribution apart.
        let noise = match ranges.len() {
            0..4 => 0.0,
            many => (ranges[3 * many / 4] - ranges[many / 4]) / 1.35,
        };
        if noise > NOISE_M {
            Finding::wrong(
                name,
                format!(
                    "its ranges vary by {noise:.2} m although the robot stands; check its supply and its mounting"
                ),
            )
        } else {
            Finding::right(name, format!("it works; noise at rest {noise:.3} m"))
        }
    };
    table.iter().enumerate().map(finding).collect()
}

fn laser_lives(trace: &Trace, row: usize, sensor: &Sensor) -> Finding {
    let name = &sensor.name;
    let scans: Vec<_> = trace.scans.iter().filter(|it| it.1.sensor as usize == row).collect();
    let (Some(first), Some(last)) = (scans.first(), scans.last()) else {
        return Finding::wrong(
            name,
            "no scan arrived; check its cable, its topic and its number of beams",
        );
    };
    let hz = (scans.len() - 1) as f64 / (last.0 - first.0).max(1e-3);
    let beams: usize = scans.iter().map(|it| it.2.len()).sum();
    let ended: usize =
        scans.iter().map(|it| it.2.iter().filter(|range| range.is_finite()).count()).sum();
    let share = ended as f64 / beams.max(1) as f64;
    let text =
        format!("{hz:.1} scans per second, {:.0} % of the beams hit something", 100.0 * share);
    if share > 0.1 {
        Finding::right(name, text)
    } else {
        Finding::wrong(name, format!("{text}; put something around it, and clean its window"))
    }
}

/// Returns the gyro's turns over the wheels' turns; `None` without a gyro, or if the wheels hardly
/// turned the body.
pub(crate) fn gyro_scale(trace: &Trace, motion: &Motion) -> Option<f64> {
    let (mut squares, mut products, mut wheels) = (0.0, 0.0, 0.0);
    for (at, turn) in &trace.gyro {
        let tick = motion.partition_point(|it| it.0 < *at);
        let (Some(now), Some(before)) = (motion.get(tick), motion.get(tick.wrapping_sub(1))) else {
            continue;
        };
        let by_wheels = now.1[0] - before.1[0];
        squares += by_wheels * by_wheels;
        products += turn * by_wheels;
        wheels += by_wheels.abs();
    }
    (wheels > LEAST_TURN).then(|| products / squares)
}

/// Ranges by bearing from the robot's first place.
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

    /// Returns the mean difference of `seen` from the profile turned by so many bins, metres;
    /// `None` if too little is comparable.
    fn difference(&self, seen: &[(f64, f64)], turned: usize) -> Option<f64> {
        let each = seen.iter().filter_map(|(bearing, range)| {
            Some((self.range(Self::bin(*bearing) + turned)? - range).abs().min(DIFFERENT_M))
        });
        mean(each, LEAST_SAMPLES)
    }
}

/// Returns findings about rangers, and about the body if no laser saw its motion.
pub(crate) fn findings(
    mission: &Mission,
    trace: &Trace,
    motion: &Motion,
    placed: Option<&Placed>,
    moves: &Moves,
) -> Vec<Finding> {
    let mut found = Vec::new();
    let table = mission.sensor_table();
    if !table.iter().any(|it| it.kind == SensorKind::Cone) {
        return found;
    }
    if placed.is_none() {
        found.extend(match moves.way {
            Some(way) if (way - 1.0).abs() <= SIZES_TOLD.sizes => Some(Finding::right(
                "way",
                format!(
                    "the front sonar measures {:.0} % of the distance that the wheels count",
                    100.0 * way
                ),
            )),
            Some(_) => None,
            None => Some(Finding::unknown(
                "way",
                "its drive was not measured; place it 0.8 to 2 m in front of a wall, facing it",
            )),
        });
        if moves.turns_back.is_none() {
            let text = "the sonars cannot tell which way it turned; check that its first turn is to the left";
            found.push(Finding::unknown("turn", text));
        }
        let sizes = moves.sizes(mission, SIZES_TOLD);
        // Wrong wheel sizes spoil all bearings.
        if !sizes.is_empty() {
            found.extend(sizes);
            return found;
        }
    }
    let all = seen_by_cones(&table, trace, |at| {
        placed.map_or_else(|| turned(motion, at), |placed| placed.pose(at).heading)
    });
    for (place, (sensor, seen)) in all.iter().enumerate() {
        // Compares each with all others, or with the laser.
        let reference = match placed {
            Some(placed) => {
                Profile::of(placed.points.iter().map(|it| (it.to_angle(), it.length())))
            }
            None => others(&all, place),
        };
        // If two sonars disagree, either may be wrong.
        if placed.is_some() || all.len() > 2 {
            found.extend(bearing(&reference, sensor, seen));
        }
    }
    found
}

fn turned(motion: &Motion, at_s: f64) -> f64 {
    between(motion, at_s).map_or(0.0, |[angle, _]| angle)
}

/// Returns the echoes of each sonar during turns at the robot's first place: bearing from the first
/// heading, and distance from the robot's centre.
fn seen_by_cones<'a>(
    table: &'a [Sensor],
    trace: &Trace,
    heading: impl Fn(f64) -> f64,
) -> Vec<Seen<'a>> {
    let turning: Vec<_> = trace
        .legs()
        .into_iter()
        .take_while(|leg| leg.told != Told::Drive)
        .filter(|leg| leg.told != Told::Stand)
        .collect();
    let seen = |(row, sensor): (usize, &'a Sensor)| {
        let in_turn =
            readings(trace, row).filter(|it| turning.iter().any(|leg| leg.contains(it.0)));
        let echo = |(at, reading): (f64, &RangeReading)| {
            let range = range_m(reading)? + sensor.mount.forward_m;
            Some((heading(at) + sensor.mount.bearing_rad, range))
        };
        (sensor, in_turn.filter_map(echo).collect())
    };
    table.iter().enumerate().filter(|(_, it)| it.kind == SensorKind::Cone).map(seen).collect()
}

type Seen<'a> = (&'a Sensor, Vec<(f64, f64)>);

fn others(all: &[Seen<'_>], place: usize) -> Profile {
    let others = all.iter().enumerate().filter(|(other, _)| *other != place);
    Profile::of(others.flat_map(|(_, (_, seen))| seen.iter().copied()))
}

/// Returns the mean disagreement of sonars at the same bearings, metres; `None` with fewer than
/// three sonars or few echoes.
fn disagreement(all: &[Seen<'_>]) -> Option<f64> {
    let each =
        all.iter().enumerate().map(|(place, (_, seen))| others(all, place).difference(seen, 0));
    mean(each.flatten(), 2).filter(|_| all.len() > 2)
}

/// Ratio of true and wheel turns with the best agreement of the sonars.
#[derive(Clone, Copy, Debug)]
struct Turn {
    /// `None` if both directions agree equally.
    turns_back: Option<bool>,
    /// `None` if the sonars agree without a scale, or at no scale.
    scale: Option<f64>,
    agrees: bool,
}

impl Turn {
    /// Finds the best scale; `differs` returns the disagreement at a scale of the wheels' turns.
    fn best(differs: impl Fn(f64) -> Option<f64>) -> Option<Self> {
        let each: Vec<_> = (-SCALES..=SCALES)
            .map(|power| SCALE_RATIO.powi(power))
            .flat_map(|scale| [scale, -scale])
            .filter_map(|scale| Some((differs(scale)?, scale)))
            .collect();
        let (least, best) = each.iter().copied().min_by(|a, b| a.0.total_cmp(&b.0))?;
        let agrees = least < LEAST_DIFFERENCE_M;
        // By chance they may agree somewhat at another scale.
        let others = each.iter().filter(|it| it.1 * best < 0.0);
        let is_told = agrees && others.fold(f64::INFINITY, |m, it| m.min(it.0)) * EXPLAINS > least;
        let alike = each.iter().filter(|it| it.1 * best > 0.0 && it.0 <= ALIKE * least);
        let scale = mean(alike.map(|it| it.1.abs().ln()), 1)?.exp();
        let is_other = differs(best.signum())
            .is_some_and(|it| it > LEAST_DIFFERENCE_M / 2.0 && least < EXPLAINS * it);
        Some(Self {
            turns_back: is_told.then_some(best < 0.0),
            scale: (is_told && is_other).then_some(scale),
            agrees,
        })
    }
}

pub(crate) fn moves(mission: &Mission, trace: &Trace, motion: &Motion) -> Moves {
    let table = mission.sensor_table();
    let turn = Turn::best(|scale| {
        disagreement(&seen_by_cones(&table, trace, |at| scale * turned(motion, at)))
    });
    let rims_m = mission.body().track_m / 2.0;
    let turned_m = |[angle, _]: [f64; 2]| angle * rims_m;
    // A reversed wheel makes the body drive on a turn command. Sonars that agree on a turn saw one.
    let driven = [Told::TurnLeft, Told::TurnRight]
        .into_iter()
        .filter_map(|told| {
            let share = share_of_way(mission, trace, motion, told, turned_m)?;
            (0.5..2.0).contains(&share.abs()).then_some(share)
        })
        .find(|_| turn.is_none_or(|turn| !turn.agrees));
    let share = share_of_way(mission, trace, motion, Told::Drive, |[_, way]| way);
    // A front sonar that points elsewhere disagrees with the others.
    let is_ahead = driven.is_some() || turn.is_none_or(|turn| turn.agrees);
    let share = share.filter(|share| is_ahead && SHARES.contains(&share.abs()));
    Moves {
        turns_back: turn.and_then(|turn| turn.turns_back).filter(|_| driven.is_none()),
        drives_back: driven.or(share).map(|share| share < 0.0),
        exchanged: driven.is_some(),
        turn: turn.and_then(|turn| turn.scale),
        way: share.map(f64::abs),
        curl: 0.0,
    }
}

pub(crate) fn gyro_finding(
    mission: &Mission,
    gyro_scale: Option<f64>,
    placed: Option<&Placed>,
    moves: &Moves,
) -> Option<Finding> {
    let Some(gyro_scale) = gyro_scale else {
        let text = "none of its turns was used: it is silent, or contradicts odometry, for example because its z axis points down; see link.log";
        let has_gyro = mission.robot.gyro() || mission.robot.ros2.imu.is_some();
        return has_gyro.then(|| Finding::wrong("gyro", text));
    };
    let (truth, by) = match moves.turn.filter(|_| placed.is_some()) {
        Some(turn) => (turn, "laser sees; correct its scale"),
        None => (1.0, "wheels count; correct its scale or robot.track_m"),
    };
    let scale = gyro_scale.abs() / truth;
    let text = format!("it reports {:.1} % of the turn", 100.0 * scale);
    Some(match (gyro_scale > 0.0, moves.turns_back) {
        _ if moves.exchanged => return None,
        (false, None) => return None,
        (false, Some(false)) => Finding::wrong(
            "gyro",
            "it reports left turns as right turns: its z axis points down, or its sign is wrong",
        ),
        _ if (scale - 1.0).abs() <= GYRO_TOLD => Finding::right("gyro", text),
        _ => Finding::wrong("gyro", format!("{text} that the {by}")),
    })
}

fn bearing(reference: &Profile, sensor: &Sensor, seen: &[(f64, f64)]) -> Option<Finding> {
    let stated = reference.difference(seen, 0)?;
    let turned = |bins: usize| Some((reference.difference(seen, bins)?, bins));
    let (least, bins) = (0..BINS).filter_map(turned).min_by(|a, b| a.0.total_cmp(&b.0))?;
    let beside = bins.min(BINS - bins);
    // With wrong wheel sizes no bearing fits.
    let fits = least < LEAST_DIFFERENCE_M.min(EXPLAINS * stated);
    if stated < LEAST_DIFFERENCE_M || !fits || beside < BESIDE_BINS {
        return None;
    }
    let off = wrap_angle(TAU * bins as f64 / BINS as f64);
    let deg = wrap_angle(sensor.mount.bearing_rad + off).to_degrees();
    let text = format!(
        "its readings fit a bearing {:.0} degrees from the stated one: it points elsewhere, or two plugs are swapped",
        off.to_degrees()
    );
    Some(
        Finding::wrong(&sensor.name, text)
            .with_key(format!("robot.sensor.{}.bearing_deg", sensor.name), format!("{deg:.0}")),
    )
}

/// Returns the echo ends by the wheels' motion, metres from the first place.
pub(crate) fn echoes(mission: &Mission, trace: &Trace, motion: &Motion) -> Vec<DVec2> {
    let table = mission.sensor_table();
    let (mut at, mut before_m) = (DVec2::ZERO, 0.0);
    let mut points = Vec::new();
    for (at_s, readings) in &trace.ranges {
        let [heading, way_m] = between(motion, *at_s).unwrap_or_default();
        at += (way_m - before_m) * DVec2::from_angle(heading);
        before_m = way_m;
        points.extend(readings.iter().filter_map(|reading| {
            let mount = table.get(usize::from(reading.sensor))?.mount;
            let direction = DVec2::from_angle(heading + mount.bearing_rad);
            Some(at + (mount.forward_m + range_m(reading)?) * direction)
        }));
    }
    points
}

/// Returns the front sonar's motion over `way` by the wheels, in legs of this command; negative if
/// reversed.
///
/// Returns `None` if the echo shows no motion.
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
        let in_leg: Vec<_> = readings(trace, row).filter(|(at, _)| leg.contains(*at)).collect();
        let point =
            |(at, it): &(f64, &RangeReading)| Some([way(between(motion, *at)?), range_m(it)?]);
        let points: Vec<_> = in_leg.iter().filter_map(point).collect();
        let [xx, xy, yy] = spread(&points);
        // Another wall behind the first, or a slanted one, gives a bent line.
        let mostly = 2 * points.len() > in_leg.len();
        if points.len() >= 6 && mostly && xx > 1e-3 && xy * xy > 0.95 * xx * yy {
            shares.push(-xy / xx);
        }
    }
    mean(shares.into_iter(), 1)
}
