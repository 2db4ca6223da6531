//! What goes into a planner's step, what comes out, and what every planner's guidance says besides the way.

use common::{
    mission::{Method, Mission},
    samples::{GridHeader, GuidanceSample, GuidanceStatus, PoseSample},
};
use glam::DVec2;

use crate::baselines::belief::Map;

/// How fast a robot leaves a hazard it stands in, m/s: something is near. The harmonic planner's, under the evidential
/// method.
const WAY_OUT_M_S: f64 = 0.08;

/// What a planner takes.
#[derive(Clone, Copy, Debug)]
pub enum Input<'a> {
    /// A sample of `grid`.
    Grid {
        /// Its header.
        header: &'a GridHeader,
        /// The cells of its window.
        cells: &'a [u8],
    },
    /// The pose of the tick: it is answered with guidance.
    Pose(&'a PoseSample),
}

/// What follows from an input.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outcome {
    /// The map is up to date.
    Followed,
    /// A version of the map is missing.
    Missed,
    /// The answer to a pose.
    Guidance(GuidanceSample),
}

/// What a planner says of a pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Way {
    /// No map yet.
    Unknown,
    /// Straight to this point, metres.
    To(DVec2),
    /// The robot stands in a hazard: straight to this point, metres, slowly.
    Out(DVec2),
    /// There is none.
    None,
}

impl Way {
    /// Out of the hazard that a robot at `point` (metres) stands in.
    #[must_use]
    pub fn out(map: &Map<'_>, point: DVec2) -> Self {
        map.nearest_free(point).map_or(Self::None, Self::Out)
    }
}

/// What guidance is made from, besides the way.
#[derive(Clone, Copy, Debug)]
pub struct Guide {
    /// X_T, metres.
    pub target: DVec2,
    looks_around: bool,
}

impl Guide {
    /// For the robot of `mission`.
    #[must_use]
    pub fn new(mission: &Mission) -> Self {
        Self {
            target: mission.target,
            looks_around: mission.method == Method::Evidential,
        }
    }

    /// The guidance that sends the robot of `sample` along `way` on the map of `belief`.
    #[must_use]
    pub fn sample(&self, sample: &PoseSample, way: Way, belief: &GridHeader) -> GuidanceSample {
        let pose = sample.pose();
        let to_target = self.target - pose.position;
        // A robot that stands on the point goes on as it faces.
        let toward = |point: DVec2| (point - pose.position).normalize_or(pose.axis());
        let (status, direction, limit) = match way {
            Way::Unknown => (GuidanceStatus::Waiting, DVec2::ZERO, 0.0),
            Way::To(point) => (GuidanceStatus::Along, toward(point), f64::INFINITY),
            Way::Out(point) => (GuidanceStatus::WayOut, toward(point), WAY_OUT_M_S),
            // It may be an echo that was none: one look around before the map is blamed, as the harmonic planner has it.
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
