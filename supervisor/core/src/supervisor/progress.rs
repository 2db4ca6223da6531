//! How far a run has come, for whoever watches.

use std::fmt;

use common::samples::{Action, Cause};
use x80_link::failsafe;

use crate::observer::Record;

/// How far a run has come, for whoever watches.
pub struct Progress<'a> {
    /// What was heard so far.
    pub record: &'a Record,
    /// Stages alive, of how many.
    pub alive: (usize, usize),
    /// Whether the robot is ordered to drive.
    pub driving: bool,
    /// From the start to the target.
    pub(super) straight_m: f64,
}

/// One line.
impl fmt::Display for Progress<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (alive, all) = self.alive;
        let record = self.record;
        let link = record.link.unwrap_or_default();
        if !self.driving && link.cause() == Cause::NotOrdered {
            return write!(f, "starting: {alive}/{all} stages alive");
        }
        let time = record.pose.map_or(0.0, |pose| pose.stamp.time().seconds());
        let speed = record.pose.map_or(0.0, |pose| pose.v_m_s);
        let distance = record
            .command
            .map_or(self.straight_m, |command| command.distance_m);
        let events = record
            .newest_guidance()
            .map_or(0, |guidance| guidance.safety_events);
        write!(
            f,
            "{time:6.1} s  {distance:5.2} m to go  {speed:5.2} m/s  {events:3} safety events  {alive}/{all} stages alive"
        )?;
        match link.action() {
            Action::Go => Ok(()),
            action => {
                let cause = failsafe::name(link.cause()).to_uppercase();
                write!(f, ", {cause}: the robot {}", failsafe::effect(action))
            }
        }
    }
}
