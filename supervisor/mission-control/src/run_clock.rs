//! Mission time of a run, and its first tick that has not happened yet.

use common::{
    clock::{MissionClock, MissionTime, Pace, monotonic_ns},
    ground_truth::GroundTruthTick,
    mission::{Protocol, RobotConfig},
    samples::PoseSample,
};

use crate::{observer::Record, recovery::RecoveredRun};

pub(crate) struct RunClock {
    pub clock: MissionClock,
    /// First tick that no earlier supervisor has seen.
    first_tick: u64,
    start: MissionTime,
}

impl RunClock {
    pub(crate) fn recovered(run: &RecoveredRun) -> Self {
        Self { clock: run.clock(), first_tick: run.first_tick, start: run.time }
    }

    /// Starts the clock of a new run. The pace applies to `simulated` and to ROS 2 robots, which
    /// may be simulated elsewhere.
    pub(crate) fn begin(pace: Pace, robot: &RobotConfig, simulated: bool) -> Self {
        assert!(robot.rate_hz > 0.0 && robot.rate_hz < 1e9);
        let has_pace = simulated || robot.protocol() == Protocol::Ros2;
        let clock = match pace {
            Pace::Max if simulated => {
                MissionClock::Ticks { period_ns: (1e9 / robot.rate_hz) as u64 }
            }
            _ => MissionClock::Wall {
                epoch_ns: monotonic_ns(),
                rate: match pace {
                    Pace::Rate(rate) if has_pace => rate,
                    _ => 1.0,
                },
            },
        };
        Self { clock, first_tick: 0, start: MissionTime::default() }
    }

    pub(crate) const fn in_ticks(&self) -> bool {
        matches!(self.clock, MissionClock::Ticks { .. })
    }

    /// `None` in wall-clock time.
    pub(crate) fn tick_at(&self, at_ns: u64) -> Option<u64> {
        match self.clock {
            MissionClock::Ticks { period_ns } => at_ns.checked_div(period_ns),
            MissionClock::Wall { .. } => None,
        }
    }

    /// `newest` is the newest tick of any sample.
    pub(crate) fn first_tick(&self, newest: Option<u64>) -> u64 {
        // The link publishes tick 0 before its first tick.
        newest.map_or(0, |tick| tick + 1).max(self.first_tick)
    }

    pub(crate) fn pose_time(&self, pose: Option<&PoseSample>) -> MissionTime {
        pose.map_or(self.start, |pose| pose.stamp.time())
    }

    /// Returns the seconds from the first motion order to `last_tick`, or to the newest tick.
    ///
    /// In lockstep the ground `truth` decides; its time also passes without frames.
    pub(crate) fn duration_s(
        &self,
        last_tick: Option<u64>,
        record: &Record,
        truth: &[GroundTruthTick],
    ) -> f64 {
        if let (true, Some(last)) = (self.in_ticks(), truth.last()) {
            return last.time_s;
        }
        let pose_at = |tick| record.pose_at(tick).map(|pose| pose.stamp.time());
        // The first command follows from tick 0.
        let first = record
            .poses
            .first()
            .filter(|pose| pose.stamp.tick == 0)
            .map_or(MissionTime::default(), |pose| pose.stamp.time());
        last_tick
            .or(record.newest_tick())
            .and_then(pose_at)
            .map_or(0.0, |last| last.since(first).as_secs_f64())
    }

    /// `truth` is the newest ground truth.
    pub(crate) fn now(
        &self,
        pose: Option<&PoseSample>,
        truth: Option<&GroundTruthTick>,
    ) -> MissionTime {
        match self.clock {
            MissionClock::Ticks { .. } => truth.map_or_else(
                || self.pose_time(pose),
                |truth| MissionTime::from_seconds(truth.time_s),
            ),
            MissionClock::Wall { .. } => self.clock.at(0, monotonic_ns()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_robot_that_may_be_simulated_elsewhere_has_the_pace_that_is_given_and_others_that_of_the_wall()
     {
        let rate = |protocol, pace| {
            let robot = RobotConfig { protocol: Some(protocol), ..RobotConfig::default() };
            match RunClock::begin(pace, &robot, false).clock {
                MissionClock::Wall { rate, .. } => rate,
                MissionClock::Ticks { .. } => panic!("lockstep with a real robot"),
            }
        };
        assert_eq!(rate(Protocol::Ros2, Pace::Rate(0.5)), 0.5);
        assert_eq!(rate(Protocol::Ros2, Pace::Max), 1.0);
        assert_eq!(rate(Protocol::Json, Pace::Rate(0.5)), 1.0);
    }
}
