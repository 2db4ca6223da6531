//! Check that the front sonar hears a surface that the infrared rangers beside it see.
//!
//! A sonar stuck at "nothing in range" looks like open ground. It must hear a near surface seen on
//! both sides whose line of hits is square to its axis. Even a smooth wall answers within 20
//! degrees of its normal.

use common::{
    kinematics::Pose2,
    mission::{Mission, Sensor, SensorKind},
    samples::{RangeReading, RangeStatus},
    sonar::Mount,
};
use glam::DVec2;

/// Largest range of the surface, metres.
const NEARER_M: f64 = 0.45;
/// Largest angle between normal and axis.
const SQUARE_DEG: f64 = 12.0;
/// Angle from the axis of rangers that look into the cone, degrees.
const BESIDE_DEG: f64 = 15.0;
/// Silent readings that may be chance: healthy sonars give runs of four.
pub(super) const SILENCES: u32 = 4;

#[derive(Clone, Debug)]
pub(super) struct UndetectedSurface {
    front: u8,
    axis: DVec2,
    beside: [Ranger; 2],
    silences: u32,
}

#[derive(Clone, Debug)]
struct Ranger {
    row: u8,
    name: String,
    mount: Mount,
    range_m: Option<f64>,
}

impl UndetectedSurface {
    /// Returns None without rangers on both sides of the front sonar.
    pub(super) fn of(mission: &Mission) -> Option<Self> {
        let (table, front) = (mission.sensor_table(), mission.front_row());
        let ahead = table.get(front)?.mount.bearing_rad;
        let ranger = |side: f64| {
            let beside = |sensor: &Sensor| (sensor.mount.bearing_rad - ahead) * side;
            let looks = |(_, sensor): &(u8, &Sensor)| {
                let is_ray = sensor.used && sensor.kind == SensorKind::Ray;
                is_ray && (0.0..BESIDE_DEG.to_radians()).contains(&beside(sensor))
            };
            let nearest = (0..).zip(&table).filter(looks);
            let nearest = nearest.min_by(|(_, a), (_, b)| beside(a).total_cmp(&beside(b)));
            nearest.map(|(row, sensor)| Ranger {
                row,
                name: sensor.name.clone(),
                mount: sensor.mount,
                range_m: None,
            })
        };
        let beside = [ranger(1.0)?, ranger(-1.0)?];
        let is_one = beside[0].row == beside[1].row;
        let axis = DVec2::from_angle(ahead);
        (!is_one).then_some(Self { front: front as u8, axis, beside, silences: 0 })
    }

    pub(super) fn take(&mut self, readings: &[RangeReading]) {
        for ranger in &mut self.beside {
            if let Some(reading) = readings.iter().find(|reading| reading.sensor == ranger.row) {
                let is_range = reading.status() == RangeStatus::Measured;
                ranger.range_m = is_range.then_some(reading.range_m);
            }
        }
        if self.surface_m().is_none() {
            self.silences = 0;
        } else if let Some(front) = readings.iter().find(|reading| reading.sensor == self.front) {
            let is_silent = front.status() == RangeStatus::Nothing;
            self.silences = if is_silent { self.silences.saturating_add(1) } else { 0 };
        }
    }

    pub(super) fn reset(&mut self) {
        self.silences = 0;
        for ranger in &mut self.beside {
            ranger.range_m = None;
        }
    }

    pub(super) const fn is_implausible(&self) -> bool {
        self.silences > SILENCES
    }

    fn surface_m(&self) -> Option<f64> {
        let near = |ranger: &Ranger| ranger.range_m.filter(|range| *range < NEARER_M);
        let seen = |ranger: &Ranger| Some(ranger.mount.hit(Pose2::default(), near(ranger)?));
        let [left, right] = &self.beside;
        let along = seen(left)? - seen(right)?;
        let slant = along.dot(self.axis).atan2(along.perp_dot(self.axis).abs()).abs();
        let mean = f64::midpoint(near(left)?, near(right)?);
        (slant <= SQUARE_DEG.to_radians()).then_some(mean)
    }

    pub(super) fn explain(&self, front: &str) -> String {
        let [left, right] = &self.beside;
        format!(
            "{front} has heard nothing {} times, but {} and {} see a surface square ahead at {:.2} m; check the sensor",
            self.silences,
            left.name,
            right.name,
            self.surface_m().unwrap_or_default()
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::mission;

    fn watch(extra: &str) -> Option<UndetectedSurface> {
        UndetectedSurface::of(&mission(extra))
    }

    /// Returns readings, centimetres, of the front sonar and of the rangers at 11.25 and -11.25 degrees.
    fn readings(front: Option<u8>, left: Option<u8>, right: Option<u8>) -> [RangeReading; 3] {
        [(0, front), (4, left), (5, right)].map(|(sensor, range)| {
            let status = range.map_or(RangeStatus::Nothing, |_| RangeStatus::Measured);
            let range_m = f64::from(range.unwrap_or_default()) / 100.0;
            RangeReading { range_m, sensor, status: status.into(), ..RangeReading::default() }
        })
    }

    #[test]
    fn a_sonar_that_hears_nothing_of_a_near_surface_square_ahead_is_implausible_after_4_readings() {
        // The rangers' points are 0.19 m apart, so 12 degrees are 4 cm in depth. A surface that is
        // far, aslant or not before both proves nothing.
        for (left, right, is_implausible) in [
            (30, Some(30), true),
            (44, Some(44), true),
            (30, Some(33), true),
            (46, Some(44), false),
            (30, Some(36), false),
            (30, None, false),
        ] {
            let mut watch = watch("").unwrap();
            let first = (1..50).find(|_| {
                watch.take(&readings(None, Some(left), right));
                watch.is_implausible()
            });
            assert_eq!(first, is_implausible.then_some(5), "{left} {right:?}");
        }
    }

    #[test]
    fn it_is_over_with_an_echo_or_without_the_surface() {
        for over in [readings(Some(30), Some(30), Some(30)), readings(None, None, Some(30))] {
            let mut watch = watch("").unwrap();
            for _ in 0..6 {
                watch.take(&readings(None, Some(30), Some(30)));
            }
            assert!(watch.is_implausible());
            watch.take(&over);
            assert!(!watch.is_implausible());
        }
    }

    #[test]
    fn a_robot_that_does_not_use_its_infrared_rangers_is_not_judged() {
        assert!(watch("sensors = 'three-front'").is_none());
        assert!(watch("method = 'paper'").is_none());
    }
}
