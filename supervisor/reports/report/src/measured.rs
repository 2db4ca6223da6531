//! Metrics of all recorded samples, including those that are not drawn.

use common::{
    mission::Mission,
    samples::{PoseSample, RangeReading, RangeStatus},
};

#[derive(Default)]
pub(crate) struct Measured {
    pub ticks: u64,
    /// Mission time of the newest pose, seconds.
    pub time_s: f64,
    pub last_pose: Option<PoseSample>,
    last_speed: Option<f64>,
    speed_change: f64,
    changes: u64,
    ranges: u64,
    unavailable: u64,
    near: u64,
    /// Hits on the map.
    pub safety_events: u64,
}

impl Measured {
    /// Takes a pose. Two ticks received together by a late machine make its speed invalid.
    pub(crate) fn pose(&mut self, pose: &PoseSample, mission: &Mission) {
        self.ticks += 1;
        self.time_s = self.time_s.max(pose.stamp.seconds());
        let Some(last) = self.last_pose.replace(*pose) else {
            self.last_speed = Some(pose.v_m_s);
            return;
        };
        let time = pose.stamp.seconds() - last.stamp.seconds();
        if time * mission.robot.rate_hz > 0.5 {
            if let Some(before) = self.last_speed.filter(|before| before.is_finite()) {
                self.speed_change += (pose.v_m_s - before).abs() / time;
                self.changes += 1;
            }
            self.last_speed = Some(pose.v_m_s);
        }
    }

    pub(crate) fn range(&mut self, range: &RangeReading, mission: &Mission) {
        self.ranges += 1;
        match range.status() {
            RangeStatus::Measured | RangeStatus::AtContact => {
                self.near += u64::from(range.range_m < mission.map_within_m());
            }
            RangeStatus::Nothing | RangeStatus::Invalid | RangeStatus::Absent => {
                self.unavailable += 1;
            }
        }
    }

    /// Returns the mean of |dv/dt|, m/s^2.
    pub(crate) fn speed_change(&self) -> Option<f64> {
        share(self.speed_change, self.changes)
    }

    /// Returns the share of ticks without a sonar distance.
    pub(crate) fn unavailable(&self) -> Option<f64> {
        assert!(self.unavailable <= self.ranges);
        share(self.unavailable as f64, self.ranges)
    }

    /// Returns the share of ticks with a reading below the mapping range.
    pub(crate) fn near(&self) -> Option<f64> {
        assert!(self.near <= self.ranges);
        share(self.near as f64, self.ranges)
    }
}

fn share(sum: f64, count: u64) -> Option<f64> {
    (count > 0).then(|| sum / count as f64)
}
