//! Readings of the rangers in the mission's frame.

use std::f64::consts::PI;

use common::{
    infrared,
    kinematics::Pose2,
    mission::Sensors,
    samples::{ContactSample, RangeSample},
};
use glam::DVec2;

use crate::infrared_model::{self, Seen};

/// A reading of the sonar in the mission's frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reading {
    /// Position of the sensor, metres.
    pub(crate) origin: DVec2,
    /// Direction of the beam, a unit vector.
    pub(crate) axis: DVec2,
    /// Range of the echo, metres; none where nothing answered.
    pub(crate) echo: Option<f64>,
}

/// A reading of an infrared ranger in the mission's frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ray {
    /// Position of the ranger, metres.
    pub(crate) origin: DVec2,
    /// Direction of the ray, a unit vector.
    pub(crate) axis: DVec2,
    pub(crate) seen: Seen,
}

impl Ray {
    /// The readings of all live rangers among `sensors`, on a robot at `pose` with a body of `radius` metres.
    pub(crate) fn all(
        pose: Pose2,
        radius: f64,
        sensors: Sensors,
        range: &RangeSample,
    ) -> Vec<Self> {
        if sensors != Sensors::FrontInfrared {
            return Vec::new();
        }
        let rangers = infrared::rangers(pose, radius).into_iter();
        let ray = |(ranger, ad): (Pose2, u16)| {
            infrared_model::seen(ad).map(|seen| Self {
                origin: ranger.position,
                axis: ranger.axis(),
                seen,
            })
        };
        rangers.zip(range.infrared_ad).filter_map(ray).collect()
    }
}

/// Something that touches the body, in the mission's frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Touch {
    /// Position of the body's centre, metres.
    pub(crate) robot: DVec2,
    /// Direction of the middle of the arc in which the body is touched, a unit vector.
    pub(crate) axis: DVec2,
    /// Half the angle of the arc, radians.
    pub(crate) half_width: f64,
}

impl Touch {
    /// The contact of a robot at `pose`; none if it is not known where the body is touched. The sample comes from shared memory and
    /// may hold anything.
    pub(crate) fn of(pose: Pose2, contact: &ContactSample) -> Option<Self> {
        let &ContactSample { bearing_rad, half_width_rad, .. } = contact;
        let usable = bearing_rad.is_finite() && half_width_rad > 0.0 && half_width_rad <= PI;
        usable.then(|| Self {
            robot: pose.position,
            axis: DVec2::from_angle(pose.heading + bearing_rad),
            half_width: half_width_rad,
        })
    }
}
