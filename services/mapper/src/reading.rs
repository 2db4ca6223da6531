//! Readings in the mission frame, by the mission's sensor rows.

use std::f64::consts::{PI, TAU};

use common::{
    kinematics::Pose2,
    mission::{Mission, SensorKind},
    samples::{ContactSample, RangeReading, RangeStatus},
    sonar::Mount,
};
use glam::DVec2;

use crate::{
    infrared_model::{self, Seen},
    sonar_model::SonarModel,
};

/// Mapped range of the reading "4 cm or nearer".
const CONTACT_M: f64 = 0.04;

#[derive(Clone, Debug)]
pub(crate) struct Rows {
    /// Rows; none for unused ones.
    rows: Vec<Option<Row>>,
    front: u8,
}

#[derive(Clone, Copy, Debug)]
struct Row {
    mount: Mount,
    reach_m: f64,
    kind: SensorKind,
    /// First beam's bearing relative to the laser's, and angle between beams.
    fan: (f64, f64),
    noise: (f64, f64),
    /// Distance from which beams pass objects; 0 except for depth cameras.
    clears_from_m: f64,
    /// Sonar model; none for other kinds.
    cone: Option<SonarModel>,
}

impl Rows {
    pub(crate) fn new(mission: &Mission) -> Self {
        let row = |sensor: common::mission::Sensor| {
            sensor.used.then(|| Row {
                mount: sensor.mount,
                reach_m: sensor.reach_m,
                kind: sensor.kind,
                fan: sensor.fan(),
                noise: sensor.model.beam_noise(),
                clears_from_m: sensor.model.clears_from_m(),
                cone: (sensor.kind == SensorKind::Cone).then(|| SonarModel::of(&sensor)),
            })
        };
        Self {
            rows: mission.sensor_table().into_iter().map(row).collect(),
            front: mission.front_row() as u8,
        }
    }

    pub(crate) fn cones(&self) -> usize {
        self.rows.iter().flatten().filter(|row| row.cone.is_some()).count()
    }

    pub(crate) fn lasers(&self) -> Vec<usize> {
        (0..self.rows.len()).filter(|row| self.laser(*row).is_some()).collect()
    }

    fn laser(&self, row: usize) -> Option<Row> {
        let row = *self.rows.get(row)?;
        row.filter(|row| row.kind == SensorKind::Scan)
    }

    pub(crate) fn are_beside_laser(&self) -> bool {
        let is_other = |row: &Row| row.kind != SensorKind::Scan;
        !self.lasers().is_empty() && self.rows.iter().flatten().any(is_other)
    }

    /// Returns the row, if used. Samples in shared memory may hold any value.
    fn of(&self, reading: &RangeReading) -> Option<Row> {
        *self.rows.get(usize::from(reading.sensor))?
    }

    pub(crate) fn uses_row(&self, row: u64) -> bool {
        usize::try_from(row).is_ok_and(|row| self.rows.get(row).is_some_and(Option::is_some))
    }

    pub(crate) fn scan<'a>(&self, row: usize, robot: Pose2, beams: &'a [f32]) -> Option<Fan<'a>> {
        let Row { mount, reach_m, fan: (first, step_rad), noise, clears_from_m, .. } =
            self.laser(row).filter(|_| !beams.is_empty())?;
        let mount = mount.on(robot);
        let first_rad = mount.heading + first;
        Some(Fan {
            origin: mount.position,
            first_rad,
            step_rad,
            reach_m,
            noise,
            clears_from_m,
            beams,
        })
    }

    pub(crate) fn uses(&self, reading: &RangeReading) -> bool {
        self.uses_row(reading.sensor.into())
    }

    /// Returns the distance S, metres, and the hit of (19) by the front sonar.
    pub(crate) fn front_hit(
        &self,
        robot: Pose2,
        readings: &[RangeReading],
    ) -> Option<(f64, DVec2)> {
        let reading = readings.iter().find(|reading| reading.sensor == self.front)?;
        let distance = safety_distance(reading)?;
        Some((distance, self.of(reading)?.mount.hit(robot, distance)))
    }

    pub(crate) fn beams(
        &self,
        robot: Pose2,
        readings: &[RangeReading],
    ) -> impl Iterator<Item = Reading> {
        readings.iter().filter_map(move |reading| {
            let row = self.of(reading)?;
            let sonar = row.cone?;
            let echo = match reading.status() {
                RangeStatus::Nothing => None,
                _ => Some(safety_distance(reading)?).filter(|range| *range <= row.reach_m),
            };
            let ranger = row.mount.on(robot);
            Some(Reading { origin: ranger.position, axis: ranger.axis(), echo, sonar })
        })
    }

    /// Returns infrared readings without dead rays.
    pub(crate) fn rays(
        &self,
        robot: Pose2,
        readings: &[RangeReading],
    ) -> impl Iterator<Item = Ray> {
        readings.iter().filter_map(move |reading| {
            let row = self.of(reading).filter(|row| row.kind == SensorKind::Ray)?;
            let seen = infrared_model::seen(reading, row.reach_m)?;
            let ranger = row.mount.on(robot);
            Some(Ray { origin: ranger.position, axis: ranger.axis(), seen })
        })
    }
}

/// Returns S of (19), if the reading has a distance.
fn safety_distance(reading: &RangeReading) -> Option<f64> {
    match reading.status() {
        RangeStatus::Measured if reading.range_m >= 0.0 => Some(reading.range_m),
        RangeStatus::AtContact => Some(CONTACT_M),
        _ => None,
    }
}

pub(crate) struct Reading {
    /// Sensor position, mission frame.
    pub(crate) origin: DVec2,
    /// Unit vector.
    pub(crate) axis: DVec2,
    /// Range in metres; none without an echo.
    pub(crate) echo: Option<f64>,
    pub(crate) sonar: SonarModel,
}

pub(crate) struct Ray {
    /// Sensor position, mission frame.
    pub(crate) origin: DVec2,
    /// Unit vector.
    pub(crate) axis: DVec2,
    pub(crate) seen: Seen,
}

#[derive(Clone, Copy)]
pub(crate) struct Fan<'a> {
    /// Laser position, mission frame.
    pub(crate) origin: DVec2,
    pub(crate) first_rad: f64,
    pub(crate) step_rad: f64,
    pub(crate) reach_m: f64,
    /// Range deviation: metres, and a share of the range.
    pub(crate) noise: (f64, f64),
    /// Distance below which a beam is no evidence about ground.
    pub(crate) clears_from_m: f64,
    /// Ranges in metres: infinite for nothing in reach, NaN for no reading.
    pub(crate) beams: &'a [f32],
}

impl Fan<'_> {
    /// Returns each beam's unit vector and range.
    pub(crate) fn iter(&self) -> impl Iterator<Item = (DVec2, f64)> + '_ {
        let step = DVec2::from_angle(self.step_rad);
        let first = DVec2::from_angle(self.first_rad);
        let along = std::iter::successors(Some(first), move |along| Some(step.rotate(*along)));
        along.zip(self.beams.iter().map(|range| f64::from(*range)))
    }

    /// Returns beam ends; none for beams without one.
    pub(crate) fn ends(&self) -> impl Iterator<Item = Option<DVec2>> + '_ {
        self.iter().map(|(along, range)| {
            (range >= 0.0 && range <= self.reach_m).then(|| self.origin + range * along)
        })
    }

    pub(crate) fn deviation_m(&self, end: DVec2) -> f64 {
        let (least_m, share) = self.noise;
        least_m + share * end.distance(self.origin)
    }

    /// Returns whether the first beam follows the last.
    pub(crate) fn is_circle(&self) -> bool {
        (self.beams.len() as f64 * self.step_rad - TAU).abs() < 0.5 * self.step_rad
    }
}

pub(crate) struct Touch {
    pub(crate) robot: DVec2,
    /// Middle of the touched arc, a unit vector.
    pub(crate) axis: DVec2,
    /// Half the arc, radians.
    pub(crate) half_width: f64,
    /// Whether a bumper or a cliff sensor touched, rather than held wheels.
    pub(crate) is_felt: bool,
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
