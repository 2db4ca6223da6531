//! Detection of sonars that stop hearing a known surface.
//!
//! A deaf sonar reports "nothing in range", as in the open, but the surface it heard is still
//! there. Each echo lies somewhere on the arc of its range, and further readings narrow down where.
//! If a remembered echo lies well inside the cone and faces the sonar, a silent reading counts as a
//! miss. An echo is forgotten when a sonar hears past it, as with a thing that moved away, and
//! after [`FORGOTTEN_S`].
//!
//! Likelihoods of misses add up until the next reading that hears anything. In 450 missions with
//! one, three and six sonars, the sum reached 7.9 for one sonar. It reached 3.2 while all of
//! several were silent. In 6 missions in which three sonars fell deaf before drums, it reached 20
//! to 45.

use std::collections::BTreeMap;

use common::{
    kinematics::Pose2,
    mission::{Mission, Sensor, SensorKind},
    samples::{RangeReading, RangeStatus},
};
use glam::DVec2;

use super::deafness::Missing;

const PLACES: usize = 9;
/// Share of the reach within which an echo surely returns.
const SURE: f64 = 0.7;
/// Shares of the cone in which an answer is sure, and possible.
const INNER: f64 = 0.67;
const OUTER: f64 = 1.2;
/// Largest difference of readings of one surface, metres.
const SAME_M: f64 = 0.12;
/// Weights of places that a reading contradicts, and that a silent reading missed.
const UNFIT: f64 = 0.2;
const MISSED: f64 = 0.7;
/// Angle from the last echo's direction within which a smooth surface answers, radians.
const TURNED_RAD: f64 = 0.21;
/// Readings that make an echo known, and likelihoods above which a reading belongs to it, and
/// misses it.
const KNOWN: u32 = 5;
const LIKELY: [f64; 2] = [0.2, 0.5];
const FORGOTTEN_S: f64 = 20.0;
const MOST: usize = 64;
/// Sums of misses of one sonar, and of all: doubted, and surely deaf.
const ONE: [f64; 2] = [10.0, 16.0];
const ALL: [f64; 2] = [4.5, 8.0];

#[derive(Clone, Debug)]
struct Echo {
    /// Candidate places with their likelihoods.
    places: [(DVec2, f64); PLACES],
    /// Sonar position and time of the last echo.
    from: DVec2,
    at_s: f64,
    readings: u32,
}

impl Echo {
    fn are(&self, is_so: impl Fn(DVec2) -> bool) -> [bool; PLACES] {
        self.places.map(|(place, _)| is_so(place))
    }

    fn share(&self, of: [bool; PLACES]) -> f64 {
        let places = self.places.iter().zip(of).filter(|(_, of)| *of);
        let share = places.map(|((_, share), _)| share).sum();
        assert!((0.0..1.0 + 1e-9).contains(&share));
        share
    }

    fn weigh(&mut self, factor: f64, of: [bool; PLACES]) {
        for ((_, share), of) in self.places.iter_mut().zip(of) {
            *share *= if of { factor } else { 1.0 };
        }
        let sum = self.share([true; PLACES]);
        assert!(sum > 0.0);
        self.places.iter_mut().for_each(|(_, share)| *share /= sum);
        debug_assert!((self.share([true; PLACES]) - 1.0).abs() < 1e-9);
    }
}

#[derive(Clone, Copy)]
struct Listener {
    from: Pose2,
    half_rad: f64,
    /// Cosines of the sure and the possible cone.
    inner: f64,
    outer: f64,
    reach_m: f64,
}

impl Listener {
    fn at(sensor: &Sensor, robot: Pose2) -> Self {
        let half_rad = sensor.field_of_view_deg.to_radians() / 2.0;
        let [inner, outer] = [INNER, OUTER].map(|share| (share * half_rad).cos());
        let (from, reach_m) = (sensor.mount.on(robot), sensor.reach_m);
        Self { from, half_rad, inner, outer, reach_m }
    }

    fn echo(&self, range_m: f64, at_s: f64) -> Echo {
        let from = self.from.position;
        let place = |it: usize| {
            let side = 2.0 * it as f64 / (PLACES - 1) as f64 - 1.0;
            let way = DVec2::from_angle(self.from.heading + side * self.half_rad);
            (from + range_m * way, 1.0 / PLACES as f64)
        };
        Echo { places: std::array::from_fn(place), from, at_s, readings: 1 }
    }

    fn sees(&self, place: DVec2, cosine: f64) -> bool {
        let way = place - self.from.position;
        way.dot(self.from.axis()) > cosine * way.length()
    }

    fn fits(&self, place: DVec2, range_m: f64) -> bool {
        let off_m = place.distance(self.from.position) - range_m;
        off_m.abs() < SAME_M && self.sees(place, self.outer)
    }

    fn must_hear(&self, place: DVec2, heard_from: DVec2, nearer_m: f64) -> bool {
        let turned = (place - heard_from).angle_to(place - self.from.position);
        place.distance(self.from.position) < nearer_m
            && self.sees(place, self.inner)
            && turned.abs() < TURNED_RAD
    }
}

#[derive(Clone, Debug)]
pub(super) struct LostEcho {
    sonars: BTreeMap<u8, (Sensor, Missing)>,
    all: Missing,
    echoes: Vec<Echo>,
}

impl LostEcho {
    pub(super) fn of(mission: &Mission) -> Self {
        let table = (0..).zip(mission.sensor_table());
        let used = table.filter(|(_, it)| it.used && it.kind == SensorKind::Cone);
        let sonars = used.map(|(row, sensor)| (row, (sensor, Missing::default()))).collect();
        Self { sonars, all: Missing::default(), echoes: Vec::new() }
    }

    pub(super) fn reset(&mut self) {
        self.echoes.clear();
        self.all = Missing::default();
        self.sonars.values_mut().for_each(|(_, missing)| *missing = Missing::default());
    }

    /// Takes seconds, and the pose by the wheels.
    pub(super) fn take(&mut self, readings: &[RangeReading], robot: Pose2, at_s: f64) {
        self.echoes.retain(|echo| (0.0..FORGOTTEN_S).contains(&(at_s - echo.at_s)));
        let is_silent = readings.iter().all(|it| it.status() != RangeStatus::Measured);
        for reading in readings {
            let Some((sensor, missing)) = self.sonars.get_mut(&reading.sensor) else { continue };
            let listener = Listener::at(sensor, robot);
            match reading.status() {
                RangeStatus::Measured => {
                    missing.end();
                    self.all.end();
                    hears(&mut self.echoes, listener, reading.range_m, at_s);
                }
                RangeStatus::Nothing => {
                    let likely = misses(&mut self.echoes, listener);
                    missing.add(likely, ONE[1]);
                    if is_silent {
                        self.all.add(likely, ALL[1]);
                    }
                }
                _ => {}
            }
        }
    }

    pub(super) fn judged(&self, sure: bool) -> Option<String> {
        let it = usize::from(sure);
        let deaf = self.sonars.values().find(|(_, missing)| missing.is(ONE[it]));
        let who = match deaf {
            _ if self.sonars.len() > 1 && self.all.is(ALL[it]) => "no sonar hears".to_owned(),
            Some((sensor, _)) => format!("the sonar {} does not hear", sensor.name),
            None => return None,
        };
        Some(format!(
            "{who} an obstacle heard before: the obstacle is gone, or the sonar is deaf; check its supply and cable, then run `firsthand stop` and `resume`"
        ))
    }
}

fn hears(echoes: &mut Vec<Echo>, listener: Listener, range_m: f64, at_s: f64) {
    let is_before = |echo: &Echo| {
        let nearer_m = range_m - SAME_M;
        let must = echo.are(|place| listener.must_hear(place, echo.from, nearer_m));
        echo.share(must) > LIKELY[1]
    };
    echoes.retain(|echo| !is_before(echo));
    let fitting = |echo: &Echo| echo.are(|place| listener.fits(place, range_m));
    let shares = echoes.iter_mut().map(|echo| (echo.share(fitting(echo)), echo));
    match shares.max_by(|(one, _), (other, _)| one.total_cmp(other)) {
        Some((share, echo)) if share > LIKELY[0] => {
            echo.weigh(UNFIT, fitting(echo).map(|fits| !fits));
            (echo.from, echo.at_s) = (listener.from.position, at_s);
            echo.readings += 1;
        }
        _ => {
            if echoes.len() >= MOST {
                echoes.remove(0);
            }
            echoes.push(listener.echo(range_m, at_s));
            assert!(echoes.len() <= MOST);
        }
    }
}

fn misses(echoes: &mut [Echo], listener: Listener) -> f64 {
    let mut likely = 0.0_f64;
    for echo in echoes {
        let nearer_m = SURE * listener.reach_m;
        let must = echo.are(|place| listener.must_hear(place, echo.from, nearer_m));
        if echo.readings >= KNOWN {
            likely = likely.max(echo.share(must));
        }
        echo.weigh(MISSED, must);
    }
    if likely > LIKELY[1] { likely } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::mission;

    /// Judges two sonars that approach a post of 0.1 m radius at (1.2, 0.1). The robot drives 2 cm
    /// per tick, and turns to and fro by 0.3 rad. `is_heard` selects the ticks and sonars that hear
    /// the post.
    fn judged(ticks: u32, is_heard: impl Fn(u32, u8) -> bool) -> [bool; 2] {
        let rows = "[[robot.sensor]]\nname = 'a'\nkind = 'cone'\nforward_m = 0.2\nbearing_deg = 10\n\
            [[robot.sensor]]\nname = 'b'\nkind = 'cone'\nforward_m = 0.2\nbearing_deg = -10\n";
        let mission = mission(&format!("robot.model = 'kobuki'\nrobot.protocol = 'json'\n{rows}"));
        let mut lost = LostEcho::of(&mission);
        for tick in 0..ticks {
            let position = DVec2::new(0.02 * f64::from(tick.min(30)), 0.0);
            let heading = 0.3 * (0.4 * f64::from(tick)).sin();
            let robot = Pose2 { position, heading };
            let readings: Vec<_> = (0..2)
                .map(|sensor| {
                    let listener = Listener::at(&lost.sonars[&sensor].0, robot);
                    let post = DVec2::new(1.2, 0.1);
                    let hears =
                        listener.sees(post, listener.half_rad.cos()) && is_heard(tick, sensor);
                    let status = if hears { RangeStatus::Measured } else { RangeStatus::Nothing };
                    let range_m = post.distance(listener.from.position) - 0.1;
                    RangeReading { range_m, sensor, raw: 0, status: status.into() }
                })
                .collect();
            lost.take(&readings, robot, 0.1 * f64::from(tick));
        }
        [false, true].map(|sure| lost.judged(sure).is_some())
    }

    #[test]
    fn sonars_are_judged_deaf_that_do_not_hear_a_post_in_their_cones_as_before() {
        type IsHeard = fn(u32, u8) -> bool;
        let all_deaf: IsHeard = |tick, _| tick < 40;
        let one_deaf: IsHeard = |tick, sensor| sensor == 0 || tick < 40;
        let now_and_then: IsHeard = |tick, _| tick < 40 || tick % 40 > 30;
        for (ticks, is_heard, are_deaf) in [
            (150, (|_, _| true) as IsHeard, false),
            (41, all_deaf, false),
            (90, all_deaf, true),
            (45, one_deaf, false),
            (140, one_deaf, true),
            (231, now_and_then, true),
        ] {
            assert_eq!(judged(ticks, is_heard), [are_deaf; 2], "{ticks}");
        }
    }
}
