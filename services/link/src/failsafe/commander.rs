//! The monitor of other commanders: nodes that publish commands for the robot beside the link.
//!
//! The robot obeys the newest command, so two commanders drive it where neither wants. A node that could publish and is silent is no
//! commander.

use std::time::Duration;

use common::{driver::Commander, mission::Mission, samples::Cause};
use ros2_driver::publishers::gid_text;

use super::monitor::{Condition, Moment, Monitor, Observation};
use crate::backoff::has_passed;

pub(crate) const GONE_AFTER: Duration = Duration::from_secs(1);
/// A sender of stops alone is a commander after this time. An earlier link's stop guard leaves sooner.
pub(crate) const STAYS: Duration = Duration::from_secs(2);

/// Others' commands, without a pause.
#[derive(Clone, Copy, Debug)]
struct Told {
    newest: Commander,
    moves: bool,
    began_ns: u64,
    newest_ns: u64,
}

#[derive(Clone, Debug)]
pub struct OtherCommander {
    topic: String,
    told: Option<Told>,
}

impl Monitor for OtherCommander {
    fn new(mission: &Mission) -> Self {
        Self { topic: mission.robot.ros2.cmd_vel.clone(), told: None }
    }

    fn observe(&mut self, what: &Observation<'_>, now: Moment) {
        let Observation::Commander(newest) = *what else {
            return;
        };
        let now_ns = now.machine_ns;
        let goes_on = |told: &Told| !has_passed(told.newest_ns, now_ns, GONE_AFTER);
        let before = self.told.filter(goes_on);
        self.told = Some(Told {
            newest,
            moves: newest.moves || before.is_some_and(|told| told.moves),
            began_ns: before.map_or(now_ns, |told| told.began_ns),
            newest_ns: now_ns,
        });
    }

    fn condition(&self, _: Cause, now: Moment) -> Condition {
        let commands = |told: Told| {
            (told.moves || has_passed(told.began_ns, told.newest_ns, STAYS))
                && !has_passed(told.newest_ns, now.machine_ns, GONE_AFTER)
        };
        self.told.is_some_and(commands).into()
    }

    fn explain(&self, _: Cause, _: Moment) -> Option<String> {
        let topic = &self.topic;
        let number = gid_text(self.told?.newest.number);
        Some(format!(
            "another node publishes {topic}, its GID is {number}: `ros2 topic info --verbose {topic}` names it; end it"
        ))
    }

    fn judges_frames(&self) -> bool {
        false
    }
}
