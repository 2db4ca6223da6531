//! Readings in the mission frame, by the mission's sensor rows.

use std::f64::consts::{PI, TAU};

use common::{
    geometry::wrap_angle,
    kinematics::Pose2,
    mission::{Mission, Sensor, SensorKind},
    samples::{ContactSample, RangeReading, RangeStatus},
};
use glam::DVec2;

use crate::{
    infrared_model::{self, Seen},
    sonar_model::SonarModel,
};

/// Mapped range of the reading "4 cm or nearer".
const CONTACT_M: f64 = 0.04;
/// Maximum distance of neighbouring ends on a surface: metres, and beam spacings.
pub(crate) const GAP_M: f64 = 0.3;
const GAP: f64 = 3.0;

#[derive(Clone, Debug)]
pub(crate) struct Rows {
    table: Vec<Sensor>,
    front: u8,
}

impl Rows {
    pub(crate) fn new(mission: &Mission) -> Self {
        Self { table: mission.sensor_table(), front: mission.front_row() as u8 }
    }

    /// Samples in shared memory may hold any row.
    fn used(&self, row: usize) -> Option<&Sensor> {
        self.table.get(row).filter(|sensor| sensor.used)
    }

    fn of(&self, reading: &RangeReading, kind: SensorKind) -> Option<&Sensor> {
        self.used(reading.sensor.into()).filter(|sensor| sensor.kind == kind)
    }

    pub(crate) fn uses(&self, row: u64) -> bool {
        usize::try_from(row).is_ok_and(|row| self.used(row).is_some())
    }

    pub(crate) fn scan<'a>(&self, row: usize, robot: Pose2, beams: &'a [f32]) -> Option<Fan<'a>> {
        let is_scan = |laser: &&Sensor| laser.kind == SensorKind::Scan && !beams.is_empty();
        let laser = self.used(row).filter(is_scan)?;
        let mount = laser.mount.on(robot);
        let (first, step_rad) = laser.fan();
        assert!(step_rad > 0.0 && laser.reach_m > 0.0);
        Some(Fan {
            origin: mount.position,
            first_rad: mount.heading + first,
            step_rad,
            reach_m: laser.reach_m,
            noise: laser.model.product().noise,
            clears_from_m: laser.model.clears_from_m(),
            beams,
        })
    }

    /// Returns the distance S, metres, and the hit of (19) by the front sonar.
    pub(crate) fn front_hit(
        &self,
        robot: Pose2,
        readings: &[RangeReading],
    ) -> Option<(f64, DVec2)> {
        let reading = readings.iter().find(|reading| reading.sensor == self.front)?;
        let distance = safety_distance(reading)?;
        Some((distance, self.used(reading.sensor.into())?.mount.hit(robot, distance)))
    }

    pub(crate) fn beams(
        &self,
        robot: Pose2,
        readings: &[RangeReading],
    ) -> impl Iterator<Item = Reading> {
        readings.iter().filter_map(move |reading| {
            let cone = self.of(reading, SensorKind::Cone)?;
            let echo = match reading.status() {
                RangeStatus::Nothing => None,
                _ => Some(safety_distance(reading)?).filter(|range| *range <= cone.reach_m),
            };
            let ranger = cone.mount.on(robot);
            Some(Reading {
                origin: ranger.position,
                axis: ranger.axis(),
                echo,
                sonar: SonarModel::of(cone),
            })
        })
    }

    /// Without dead rays.
    pub(crate) fn rays(
        &self,
        robot: Pose2,
        readings: &[RangeReading],
    ) -> impl Iterator<Item = Ray> {
        readings.iter().filter_map(move |reading| {
            let ray = self.of(reading, SensorKind::Ray)?;
            let seen = infrared_model::seen(reading, ray.reach_m)?;
            let ranger = ray.mount.on(robot);
            Some(Ray { origin: ranger.position, axis: ranger.axis(), seen })
        })
    }
}

/// Returns S of (19).
fn safety_distance(reading: &RangeReading) -> Option<f64> {
    match reading.status() {
        RangeStatus::Measured if reading.range_m >= 0.0 => Some(reading.range_m),
        RangeStatus::AtContact => Some(CONTACT_M),
        _ => None,
    }
}

pub(crate) struct Reading {
    /// In the mission frame.
    pub origin: DVec2,
    /// Unit vector.
    pub axis: DVec2,
    /// Range in metres; none without an echo.
    pub echo: Option<f64>,
    pub sonar: SonarModel,
}

pub(crate) struct Ray {
    /// In the mission frame.
    pub origin: DVec2,
    /// Unit vector.
    pub axis: DVec2,
    pub seen: Seen,
}

#[derive(Clone, Copy)]
pub(crate) struct Fan<'a> {
    /// In the mission frame.
    pub origin: DVec2,
    pub first_rad: f64,
    pub step_rad: f64,
    pub reach_m: f64,
    /// Range deviation: metres, and a share of the range.
    pub noise: (f64, f64),
    /// Distance below which a beam is no evidence about ground.
    pub clears_from_m: f64,
    /// Ranges in metres: infinite for nothing in reach, NaN for no reading.
    pub beams: &'a [f32],
}

impl Fan<'_> {
    pub(crate) fn iter(&self) -> impl Iterator<Item = (DVec2, f64)> + '_ {
        let step = DVec2::from_angle(self.step_rad);
        let first = DVec2::from_angle(self.first_rad);
        let along = std::iter::successors(Some(first), move |along| Some(step.rotate(*along)));
        along.zip(self.beams.iter().map(|range| f64::from(*range)))
    }

    pub(crate) fn ends(&self) -> impl Iterator<Item = Option<DVec2>> + '_ {
        self.iter().map(|(along, range)| {
            (range >= 0.0 && range <= self.reach_m).then(|| self.origin + range * along)
        })
    }

    /// Returns the beam along `way`; there may be none of its number.
    pub(crate) fn beam_along(&self, way: DVec2) -> usize {
        let bearing = wrap_angle(way.to_angle() - self.first_rad);
        (bearing.rem_euclid(TAU) / self.step_rad).round() as usize
    }

    /// Returns the range of a beam, metres; NaN outside the fan.
    pub(crate) fn range(&self, beam: usize) -> f64 {
        self.beams.get(beam).map_or(f64::NAN, |range| f64::from(*range))
    }

    pub(crate) fn deviation_m(&self, end: DVec2) -> f64 {
        let (least_m, share) = self.noise;
        least_m + share * end.distance(self.origin)
    }

    /// Returns whether two neighbouring ends lie on one surface.
    pub(crate) fn joins(&self, one: DVec2, next: DVec2) -> bool {
        let nearer_m = one.distance(self.origin).min(next.distance(self.origin));
        one.distance(next) <= GAP_M.max(GAP * self.step_rad * nearer_m)
    }

    /// Returns whether the first beam follows the last.
    pub(crate) fn is_circle(&self) -> bool {
        (self.beams.len() as f64 * self.step_rad - TAU).abs() < 0.5 * self.step_rad
    }
}

pub(crate) struct Touch {
    pub robot: DVec2,
    /// Middle of the touched arc, a unit vector.
    pub axis: DVec2,
    /// Radians.
    pub half_width: f64,
    /// Whether a bumper or a cliff sensor touched, rather than held wheels.
    pub is_felt: bool,
}

impl Touch {
    /// Returns `None` if the place is unknown. Samples in shared memory may hold any value.
    pub(crate) fn of(pose: Pose2, contact: &ContactSample) -> Option<Self> {
        let &ContactSample { bearing_rad, half_width_rad, left, right, .. } = contact;
        let usable = bearing_rad.is_finite() && half_width_rad > 0.0 && half_width_rad <= PI;
        usable.then(|| Self {
            robot: pose.position,
            axis: DVec2::from_angle(pose.heading + bearing_rad),
            half_width: half_width_rad,
            is_felt: left == 0 && right == 0,
        })
    }
}
