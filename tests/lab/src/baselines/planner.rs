//! Planner for comparison, with the shared map and path guidance.

use std::fmt::Debug;

use common::{
    mission::{Method, Mission},
    samples::{GuidanceSample, GuidanceStatus, PoseSample, TargetSample},
};
use glam::DVec2;
use serde::{Serialize, de::DeserializeOwned};

use crate::baselines::belief::{Belief, Map};

/// Speed of a robot that leaves a hazard, m/s, as of the harmonic planner with the evidential
/// method.
const WAY_OUT_M_S: f64 = 0.08;

/// Planner for comparison, saved after each answer.
pub trait Planner: Default + Debug + Serialize + DeserializeOwned {
    fn way(&mut self, map: &Map<'_>, here: DVec2, target: DVec2) -> Way;
}

#[derive(Clone, Copy)]
pub enum Way {
    Unknown,
    To(DVec2),
    /// Slow, straight way to a point, metres, out of a hazard.
    Out(DVec2),
    None,
}

impl Way {
    pub fn out(map: &Map<'_>, point: DVec2) -> Self {
        map.nearest_free(point).map_or(Self::None, Self::Out)
    }
}

pub struct Baseline<P> {
    target: Option<TargetSample>,
    looks_around: bool,
    pub belief: Belief,
    pub planner: P,
}

impl<P: Planner> Baseline<P> {
    pub fn new(mission: &Mission) -> Self {
        Self {
            target: None,
            looks_around: mission.method == Method::Evidential,
            belief: Belief::default(),
            planner: P::default(),
        }
    }

    /// Restarts the planner if the target changed.
    pub fn send_to(&mut self, target: TargetSample) {
        if self.target.replace(target).is_some() {
            self.planner = P::default();
        }
    }

    pub fn guidance(&mut self, sample: &PoseSample) -> GuidanceSample {
        let here = sample.pose().position;
        let way = match (self.belief.map(), &self.target) {
            (Some(map), Some(sample)) => self.planner.way(&map, here, sample.target.position()),
            _ => Way::Unknown,
        };
        self.along(way, sample)
    }

    fn along(&self, way: Way, sample: &PoseSample) -> GuidanceSample {
        let belief = &self.belief.header;
        let pose = sample.pose();
        let toward = |point: DVec2| (point - pose.position).normalize_or(pose.axis());
        let (status, direction, limit) = match way {
            Way::Unknown => (GuidanceStatus::Waiting, DVec2::ZERO, 0.0),
            Way::To(point) => (GuidanceStatus::Along, toward(point), f64::INFINITY),
            Way::Out(point) => (GuidanceStatus::WayOut, toward(point), WAY_OUT_M_S),
            Way::None => {
                // An echo may be false: the robot looks around once before the map is reset.
                let turn = if self.looks_around { pose.axis().perp() } else { DVec2::ZERO };
                (GuidanceStatus::Unreachable, turn, 0.0)
            }
        };
        GuidanceSample {
            ex: direction.x,
            ey: direction.y,
            speed_limit_m_s: limit,
            status: status.into(),
            grid_version: belief.part.version,
            ..GuidanceSample::for_pose(sample, belief, &self.target.unwrap_or_default())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::baselines::{
        testing::{pose, sent},
        wavefront::Wavefront,
    };

    #[test]
    fn a_robot_without_a_way_is_told_so_and_looks_around() {
        let baseline = sent::<Wavefront>([1.0, 0.0]);
        let guidance = baseline.along(Way::None, &pose([0.0, 0.0]));
        assert_eq!(guidance.status, u8::from(GuidanceStatus::Unreachable));
        assert_eq!((guidance.ex, guidance.ey), (0.0, 1.0));
    }

    #[test]
    fn without_a_map_the_robot_waits() {
        let guidance = sent::<Wavefront>([0.3, 0.0]).guidance(&pose([0.0, 0.0]));
        assert_eq!(guidance.status, u8::from(GuidanceStatus::Waiting));
    }
}
