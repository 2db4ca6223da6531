//! Readings, where they were taken.

use common::{infrared, kinematics::Pose2, samples::RangeSample};
use glam::DVec2;

use crate::infrared_model::{self, Seen};

/// A reading of the sonar, where it was taken.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reading {
    /// The sensor, metres.
    pub(crate) origin: DVec2,
    /// Which way it looked: a unit vector.
    pub(crate) axis: DVec2,
    /// The echo's range, metres; none where nothing answered.
    pub(crate) echo: Option<f64>,
}

/// A reading of an infrared ranger, where it was taken.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ray {
    /// The ranger, metres.
    pub(crate) origin: DVec2,
    /// Which way it looks: a unit vector.
    pub(crate) axis: DVec2,
    /// What it sees.
    pub(crate) seen: Seen,
}

impl Ray {
    /// Those of the rangers that are live, on a robot at `pose` with a body of `radius` metres.
    pub(crate) fn all(pose: Pose2, radius: f64, range: &RangeSample) -> Vec<Self> {
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
