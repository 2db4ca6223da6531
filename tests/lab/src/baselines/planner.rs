//! Planner for comparison, with the shared map and path guidance.

use common::{
    grid::{Applied, Replica},
    mission::{Method, Mission},
    samples::{GridHeader, GuidanceSample, GuidanceStatus, PoseSample, TargetSample},
};
use glam::DVec2;

use crate::baselines::{map::Map, wavefront};

/// Speed of a robot that leaves a hazard, m/s, as of the harmonic planner with the evidential
/// method.
const WAY_OUT_M_S: f64 = 0.08;

pub enum Way {
    Unknown,
    To(DVec2),
    /// Slow, straight way to a point, metres, out of a hazard.
    Out(DVec2),
    None,
}

pub struct Baseline {
    pub target: Option<TargetSample>,
    looks_around: bool,
    pub grid: Replica<u8>,
    header: GridHeader,
}

impl Baseline {
    pub fn new(mission: &Mission) -> Self {
        Self {
            target: None,
            looks_around: mission.method == Method::Evidential,
            grid: Replica::default(),
            header: GridHeader::default(),
        }
    }

    /// Applies one `grid` sample. Returns false if a version is missing, until a keyframe.
    pub fn follow(&mut self, header: &GridHeader, cells: &[u8]) -> bool {
        let followed = self.grid.apply(&header.part, cells) != Applied::Missed;
        if followed {
            self.header = *header;
        }
        followed
    }

    pub fn guidance(&self, sample: &PoseSample) -> GuidanceSample {
        let pose = sample.pose();
        let way = match (Map::of(&self.grid), &self.target) {
            (Some(map), Some(sample)) => {
                wavefront::way(&map, pose.position, sample.target.position())
            }
            _ => Way::Unknown,
        };
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
            maneuver: status.maneuver().into(),
            grid_version: self.header.part.version,
            ..GuidanceSample::for_pose(sample, &self.header, &self.target.unwrap_or_default())
        }
    }
}
