//! Progress of a run, as its user sees it.

use std::fmt;

use common::samples::{Action, Cause};

use crate::observer::Record;

pub struct Progress<'a> {
    pub record: &'a Record,
    pub running: (usize, usize),
    pub driving: bool,
    /// From the start to the target.
    pub straight_m: f64,
}

impl fmt::Display for Progress<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (running, all) = self.running;
        let record = self.record;
        let link = record.link.unwrap_or_default();
        if !self.driving && link.cause() == Cause::NotOrdered {
            let what = if running == all { "waiting" } else { "starting" };
            write!(f, "{what}: {running}/{all} stages alive")?;
        } else {
            let pose = record.pose.unwrap_or_default();
            let (time, speed) = (pose.stamp.seconds(), pose.v_m_s);
            let distance = record.command.map_or(self.straight_m, |command| command.distance_m);
            let events = record.guidance.back().map_or(0, |guidance| guidance.safety_events);
            write!(
                f,
                "{time:6.1} s  {distance:5.2} m to go  {speed:5.2} m/s  hazards mapped {events:3} times  {running}/{all} stages alive"
            )?;
            if link.action() != Action::Go {
                let (cause, effect) = (link.cause().name().to_uppercase(), link.action().effect());
                write!(f, ", {cause}: the robot {effect}")?;
            }
        }
        record.complaint().map_or(Ok(()), |complaint| write!(f, "; {complaint}"))
    }
}
