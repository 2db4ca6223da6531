//! Measurement times from the robot's stamps.
//!
//! Messages queue on a busy machine, so ticks are not spaced like their motions. Wheel travel is
//! spread evenly between ticks, so stamps between theirs are interpolated.

use std::collections::VecDeque;

use common::clock::MissionTime;

const MOST_TICKS: usize = 32;

#[derive(Clone, Debug, Default)]
pub(super) struct RobotTime {
    /// Stamps and times of the newest ticks, rising.
    ticks: VecDeque<(i64, MissionTime)>,
}

impl RobotTime {
    pub(super) fn tick(&mut self, stamp_ns: i64, now: MissionTime) {
        if self.ticks.back().is_some_and(|(stamp, time)| *stamp >= stamp_ns || *time >= now) {
            // The robot's clock was set.
            self.ticks.clear();
        }
        if self.ticks.len() == MOST_TICKS {
            self.ticks.pop_front();
        }
        self.ticks.push_back((stamp_ns, now));
    }

    /// Returns nanoseconds from the newest tick to a stamp; outside the kept ticks by stamps alone.
    pub(super) fn since_tick_ns(&self, stamp_ns: i64) -> Option<i64> {
        let (newest_ns, newest) = *self.ticks.back()?;
        let before_ns = |time: MissionTime| -(newest.since(time).as_nanos() as i64);
        let after = self.ticks.partition_point(|(stamp, _)| *stamp <= stamp_ns);
        let next = self.ticks.get(after);
        let last = after.checked_sub(1).and_then(|last| self.ticks.get(last));
        Some(match (last, next) {
            (Some((from_ns, from)), Some((to_ns, to))) => {
                let share = (stamp_ns - from_ns) as f64 / (to_ns - from_ns) as f64;
                before_ns(*from) + (share * to.since(*from).as_nanos() as f64) as i64
            }
            (None, Some((oldest_ns, oldest))) => {
                before_ns(*oldest).saturating_sub(oldest_ns.saturating_sub(stamp_ns))
            }
            _ => stamp_ns.saturating_sub(newest_ns),
        })
    }
}
