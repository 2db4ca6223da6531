//! A sonar log through the mapper's and the planner's own steps: what they would have believed.
//!
//! Mapper and planner are those of a mission whose target is where the log ends. The mapper knows one sonar; a sample of
//! eight is given to it as eight ticks at the same place, the robot's axis turned to where each sonar looks. A body whose
//! wheels stand close together rolls little in these turns, so that hardly any scanned ground grows stale by them.

use std::path::Path;

use common::{
    bus::Stamp,
    clock::MissionTime,
    grid::{GridFrame, MAX_CELLS, Part},
    kinematics::Pose2,
    mission::{Mission, MissionError},
    samples::{FieldCell, PoseSample, RangeSample, RangeStatus},
    step::Step as _,
};
use glam::DVec2;
use mapper::step::Mapper;
use picture::{Facts, Scene};
use planner::step::Planner;
use thiserror::Error;

use crate::sonar_log::{BEARINGS_DEG, LogSample, SONARS};

/// Side of a cell, metres.
const CELL_M: f64 = 0.1;
/// Free ground between the way and the perimeter, metres: what the sonar hears farther off is not mapped.
const RIM_M: f64 = 3.0;
/// The X80's sonar says "nothing" beyond this, metres; so does the log's, here.
const REACH_M: f64 = 2.54;

/// Why a log cannot be replayed.
#[derive(Debug, Error)]
pub enum ReplayError {
    /// No mission can be made of it.
    #[error("the log gives no mission: {0}")]
    Mission(#[from] MissionError),
    /// The planner.
    #[error("no field over the map of the log: {0}; give a log that ends in free ground")]
    Field(String),
}

/// What was believed at the end of a log.
#[derive(Debug)]
pub struct Replay {
    mission: Mission,
    path: Vec<Pose2>,
    cells: Vec<u8>,
    field: Option<(GridFrame, Vec<FieldCell>)>,
    /// From the first sample to the last, seconds.
    pub time_s: f64,
    /// Along the odometry, metres.
    pub path_m: f64,
    /// Readings that put a hazard on the map.
    pub safety_events: u64,
}

/// Give `log`, one or more samples, to mapper and planner.
///
/// # Errors
/// When the robot drove too far for a map, or there is no field.
pub fn replay(log: &[LogSample]) -> Result<Replay, ReplayError> {
    let path = from_start(log);
    let mission = mission(&path)?;
    let mut mapper = Mapper::new(&mission);
    for (number, (sample, pose)) in (0..).zip(log.iter().zip(&path)) {
        for turn in 0..SONARS {
            // There and back, so that no turn leads past the rear.
            let sonar = if number % 2 == 0 {
                turn
            } else {
                SONARS - 1 - turn
            };
            let tick = number * SONARS as u64 + turn as u64 + 1;
            let input = mapper::step::Input::Tick {
                pose: pose_sample(tick, pose, BEARINGS_DEG[sonar].to_radians()),
                range: Some(range_sample(tick, sample.ranges_m[sonar])),
            };
            mapper.step(input, MissionTime::default());
        }
    }
    let cells = mapper.state().cells().to_vec();
    let header = mapper.header(Part::whole(mapper.frame(), mapper.state().version()));
    let mut planner = Planner::new(&mission);
    let grid = planner::step::Input::Grid {
        header: &header,
        cells: &cells,
    };
    let solved = planner.step(grid, MissionTime::default());
    solved.map_err(|error| ReplayError::Field(error.to_string()))?;
    let time_s = match log {
        [first, .., last] => last.time_s - first.time_s,
        _ => 0.0,
    };
    Ok(Replay {
        field: planner
            .snapshot()
            .map(|snapshot| (snapshot.frame, snapshot.cells())),
        path_m: path
            .windows(2)
            .map(|pair| pair[0].position.distance(pair[1].position))
            .sum(),
        safety_events: mapper.state().safety_events(),
        mission,
        path,
        cells,
        time_s,
    })
}

impl Replay {
    /// SVG of the belief, its field and the path.
    #[must_use]
    pub fn svg(&self, name: &str) -> String {
        let mut mission = self.mission.clone();
        mission.name = name.to_owned();
        let field = self.field.as_ref();
        picture::svg(&Scene {
            mission: &mission,
            grid: Some((mission.grid_frame(), &self.cells)),
            field: field.map(|(frame, cells)| (*frame, &cells[..])),
            believed: &self.path,
            covariance: None,
            truth: &[],
            facts: Facts {
                outcome: "replayed",
                reached: true,
                mission_time_s: self.time_s,
                path_length_m: self.path_m,
                straight_m: mission.target.length(),
                safety_events: self.safety_events,
                seed: None,
            },
            captions: &[],
        })
    }
}

/// The poses of the log in the frame of its first one.
fn from_start(log: &[LogSample]) -> Vec<Pose2> {
    let Some(start) = log.first().map(|sample| sample.pose) else {
        return Vec::new();
    };
    let back = DVec2::from_angle(-start.heading);
    let moved = |sample: &LogSample| Pose2 {
        position: back.rotate(sample.pose.position - start.position),
        heading: sample.pose.heading - start.heading,
    };
    log.iter().map(moved).collect()
}

/// A mission from the start of `path` to its end.
fn mission(path: &[Pose2]) -> Result<Mission, MissionError> {
    let places = || path.iter().map(|pose| pose.position);
    let (low, high) = places().fold((DVec2::ZERO, DVec2::ZERO), |(low, high), place| {
        (low.min(place), high.max(place))
    });
    let centre = (low + high) / 2.0;
    let cells = ((high - low).max_element() + 2.0 * RIM_M) / CELL_M;
    let cells = cells.ceil().min(f64::from(MAX_CELLS));
    let target = places().next_back().unwrap_or_default();
    let text = format!(
        "target = [{:?}, {:?}]\nperimeter = {{ width_m = {:?}, cells = {cells}, centre = [{:?}, {:?}] }}\n\
         mapper.map_within_m = {REACH_M}\nrobot.track_m = 0.01",
        target.x,
        target.y,
        cells * CELL_M,
        centre.x,
        centre.y
    );
    Mission::parse(&text, Path::new("sonar-log"))
}

fn pose_sample(tick: u64, pose: &Pose2, bearing: f64) -> PoseSample {
    PoseSample {
        stamp: Stamp {
            tick,
            ..Stamp::default()
        },
        x_m: pose.position.x,
        y_m: pose.position.y,
        heading_rad: pose.heading + bearing,
        ..PoseSample::default()
    }
}

fn range_sample(tick: u64, range_m: Option<f64>) -> RangeSample {
    let near = range_m.filter(|range| *range <= REACH_M);
    let status = match near {
        Some(_) => RangeStatus::Measured,
        None => RangeStatus::Nothing,
    };
    RangeSample {
        stamp: Stamp {
            tick,
            ..Stamp::default()
        },
        range_m: near.unwrap_or_default(),
        status: status.into(),
        ..RangeSample::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use common::grid::CellState;

    #[test]
    fn what_a_sonar_hears_on_the_left_is_mapped_on_the_left() {
        let mut ranges_m = [None; SONARS];
        ranges_m[SONARS - 1] = Some(1.0);
        let log: Vec<LogSample> = (0..20)
            .map(|number| LogSample {
                time_s: f64::from(number),
                pose: Pose2 {
                    position: DVec2::new(0.1 * f64::from(number), 0.0),
                    heading: 0.0,
                },
                ranges_m,
            })
            .collect();
        let replay = replay(&log).unwrap();
        let frame = replay.mission.grid_frame();
        let hazard = |y: f64| {
            let cell = frame.cell_at(DVec2::new(1.0, y)).unwrap();
            CellState::from_byte(replay.cells[frame.index(cell)]).is_hazard()
        };
        assert!(
            hazard(1.2) && !hazard(-1.2),
            "1.0 m and the sensor's own place"
        );
        assert!(replay.svg("log").starts_with("<svg"));
    }
}
