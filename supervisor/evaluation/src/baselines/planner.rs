//! Input and output of a planner's step, and the guidance that all planners share.

use common::{
    mission::{Method, Mission},
    samples::{GridHeader, GuidanceSample, GuidanceStatus, PoseSample},
};
use glam::DVec2;

use crate::baselines::belief::Map;

/// Speed of a robot that leaves a hazard, m/s: that of the harmonic planner with the evidential method.
const WAY_OUT_M_S: f64 = 0.08;

/// An input of a planner.
#[derive(Clone, Copy, Debug)]
pub enum Input<'a> {
    /// A sample of `grid`.
    Grid {
        header: &'a GridHeader,
        /// The cells of its window.
        cells: &'a [u8],
    },
    /// The pose of the tick, which is answered with guidance.
    Pose(&'a PoseSample),
}

/// The result of an input.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outcome {
    /// The map is up to date.
    Followed,
    /// A version of the map is missing.
    Missed,
    /// The guidance for a pose.
    Guidance(GuidanceSample),
}

/// The direction at a pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Way {
    /// There is no map yet.
    Unknown,
    /// Go straight to this point, metres.
    To(DVec2),
    /// The robot stands in a hazard: go slowly and straight to this point, metres.
    Out(DVec2),
    /// There is no path.
    None,
}

impl Way {
    /// The way out of the hazard for a robot at `point` (metres).
    pub fn out(map: &Map<'_>, point: DVec2) -> Self {
        map.nearest_free(point).map_or(Self::None, Self::Out)
    }
}

/// Makes guidance from a [`Way`].
#[derive(Clone, Copy, Debug)]
pub struct Guide {
    /// X_T, metres.
    pub target: DVec2,
    looks_around: bool,
}

impl Guide {
    /// For the robot of `mission`.
    pub fn new(mission: &Mission) -> Self {
        Self { target: mission.target, looks_around: mission.method == Method::Evidential }
    }

    /// The guidance that sends the robot of `sample` along `way` on the map of `belief`.
    pub fn sample(&self, sample: &PoseSample, way: Way, belief: &GridHeader) -> GuidanceSample {
        let pose = sample.pose();
        let to_target = self.target - pose.position;
        // A robot that stands on the point keeps its heading.
        let toward = |point: DVec2| (point - pose.position).normalize_or(pose.axis());
        let (status, direction, limit) = match way {
            Way::Unknown => (GuidanceStatus::Waiting, DVec2::ZERO, 0.0),
            Way::To(point) => (GuidanceStatus::Along, toward(point), f64::INFINITY),
            Way::Out(point) => (GuidanceStatus::WayOut, toward(point), WAY_OUT_M_S),
            // An echo may have been false: the robot looks around once before the map is reset, as with the harmonic planner.
            Way::None if self.looks_around => {
                (GuidanceStatus::Unreachable, pose.axis().perp(), 0.0)
            }
            Way::None => (GuidanceStatus::Unreachable, DVec2::ZERO, 0.0),
        };
        GuidanceSample {
            ex: direction.x,
            ey: direction.y,
            distance_m: to_target.length(),
            speed_limit_m_s: limit,
            status: status.into(),
            grid_version: belief.part.version,
            ..GuidanceSample::for_pose(sample, belief)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::baselines::testing::{mission, pose};

    #[test]
    fn a_robot_without_a_way_is_told_so_and_looks_around() {
        let guide = Guide::new(&mission([1.0, 0.0]));
        let guidance = guide.sample(&pose([0.0, 0.0]), Way::None, &GridHeader::default());
        assert_eq!(guidance.status, u8::from(GuidanceStatus::Unreachable));
        assert_eq!((guidance.ex, guidance.ey), (0.0, 1.0));
    }
}
