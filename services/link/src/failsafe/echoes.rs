//! Memory of the echoes that sonars heard, and which of them a silent sonar misses.
//!
//! Each echo lies somewhere on the arc of its range, and further readings narrow down where. If a
//! remembered echo lies well inside the cone and faces the sonar, a silent reading misses it. An
//! echo is forgotten when a sonar hears past it, as with a thing that moved away, and after
//! [`FORGOTTEN_S`].

use common::{kinematics::Pose2, mission::Sensor};
use glam::DVec2;

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
pub(super) struct Listener {
    from: Pose2,
    half_rad: f64,
    /// Cosines of the sure and the possible cone.
    inner: f64,
    outer: f64,
    reach_m: f64,
}

impl Listener {
    pub(super) fn at(sensor: &Sensor, robot: Pose2) -> Self {
        let half_rad = sensor.field_of_view_deg.to_radians() / 2.0;
        let [inner, outer] = [INNER, OUTER].map(|share| (share * half_rad).cos());
        Self { from: sensor.mount.on(robot), half_rad, inner, outer, reach_m: sensor.reach_m }
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

#[derive(Clone, Debug, Default)]
pub(super) struct Echoes(Vec<Echo>);

impl Echoes {
    pub(super) fn forget(&mut self, at_s: f64) {
        self.0.retain(|echo| (0.0..FORGOTTEN_S).contains(&(at_s - echo.at_s)));
    }

    pub(super) fn hear(&mut self, listener: Listener, range_m: f64, at_s: f64) {
        let is_before = |echo: &Echo| {
            let must = echo.are(|place| listener.must_hear(place, echo.from, range_m - SAME_M));
            echo.share(must) > LIKELY[1]
        };
        self.0.retain(|echo| !is_before(echo));
        let fitting = |echo: &Echo| echo.are(|place| listener.fits(place, range_m));
        let shares = self.0.iter_mut().map(|echo| (echo.share(fitting(echo)), echo));
        match shares.max_by(|(one, _), (other, _)| one.total_cmp(other)) {
            Some((share, echo)) if share > LIKELY[0] => {
                echo.weigh(UNFIT, fitting(echo).map(|fits| !fits));
                echo.from = listener.from.position;
                echo.at_s = at_s;
                echo.readings += 1;
            }
            _ => {
                if self.0.len() >= MOST {
                    self.0.remove(0);
                }
                self.0.push(listener.echo(range_m, at_s));
                assert!(self.0.len() <= MOST);
            }
        }
    }

    /// Returns the likelihood that the silent `listener` should have heard one of them.
    pub(super) fn miss(&mut self, listener: Listener) -> f64 {
        let mut likely = 0.0_f64;
        for echo in &mut self.0 {
            let nearer_m = SURE * listener.reach_m;
            let must = echo.are(|place| listener.must_hear(place, echo.from, nearer_m));
            if echo.readings >= KNOWN {
                likely = likely.max(echo.share(must));
            }
            echo.weigh(MISSED, must);
        }
        if likely > LIKELY[1] { likely } else { 0.0 }
    }
}
