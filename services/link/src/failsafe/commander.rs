//! The monitor of other commanders: nodes that publish commands for the robot beside the link, and hosts whose commands the robot
//! acknowledges.
//!
//! The robot obeys the newest command, so two commanders drive it where neither wants. A node that could publish and is silent is no
//! commander.
//!
//! A robot acknowledges each command, and over a serial server every host hears that; one that speaks JSON counts the orders of all. A
//! few acknowledgements too many may be of datagrams that came twice.

use std::{collections::VecDeque, time::Duration};

use common::{clock::Pace, driver::Commander, mission::Mission, samples::Cause};
use ros2_driver::publishers::gid_text;

use super::monitor::{Condition, Moment, Monitor, Observation};
use crate::backoff::has_passed;

pub(crate) const GONE_AFTER: Duration = Duration::from_secs(1);
/// A sender of stops alone is a commander after this time. An earlier link's stop guard leaves sooner.
pub(crate) const STAYS: Duration = Duration::from_secs(2);
/// So many acknowledgements within [`UNOWED_WITHIN`] that the robot did not owe show another commander.
pub(crate) const UNOWED: usize = 6;
/// An acknowledgement that did not come within this was lost.
pub(crate) const UNOWED_WITHIN: Duration = Duration::from_secs(2);
/// A robot that was found may acknowledge so much that it was sent before.
const OWED_WHEN_FOUND: usize = 64;

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
    in_ticks: bool,
    /// When the owed acknowledgements became so, and when those came that were not owed, nanoseconds.
    owed: VecDeque<u64>,
    unowed: VecDeque<u64>,
    is_told: bool,
}

/// Forget times that are longer than [`UNOWED_WITHIN`] ago.
fn forget(times: &mut VecDeque<u64>, now_ns: u64) {
    while times.front().is_some_and(|then| has_passed(*then, now_ns, UNOWED_WITHIN)) {
        times.pop_front();
    }
}

impl OtherCommander {
    /// Whether an acknowledgement since the last call was of another's command.
    pub(crate) fn take_told(&mut self) -> bool {
        std::mem::take(&mut self.is_told)
    }

    fn acknowledged(&mut self, now_ns: u64) {
        forget(&mut self.owed, now_ns);
        forget(&mut self.unowed, now_ns);
        // A robot in lockstep acknowledges whenever its process comes to it.
        if self.owed.pop_front().is_none() && !self.in_ticks {
            self.is_told = true;
            self.unowed.push_back(now_ns);
            if self.unowed.len() > UNOWED {
                self.unowed.pop_front();
            }
        }
    }

    fn owes(&mut self, count: usize, now_ns: u64) {
        forget(&mut self.owed, now_ns);
        self.owed.extend(std::iter::repeat_n(now_ns, count));
    }
}

impl Monitor for OtherCommander {
    fn new(mission: &Mission) -> Self {
        Self {
            topic: mission.robot.ros2.cmd_vel.clone(),
            told: None,
            in_ticks: false,
            owed: VecDeque::new(),
            unowed: VecDeque::new(),
            is_told: false,
        }
    }

    fn observe(&mut self, what: &Observation<'_>, now: Moment) {
        let now_ns = now.machine_ns;
        let newest = match *what {
            Observation::Commander(newest) => newest,
            Observation::Pace(pace) => return self.in_ticks = pace == Pace::Max,
            Observation::Owed(count) => return self.owes(count, now_ns),
            Observation::Found { .. } => return self.owes(OWED_WHEN_FOUND, now_ns),
            Observation::Acknowledged => return self.acknowledged(now_ns),
            _ => return,
        };
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
        let is_recent = |then: &u64| !has_passed(*then, now.machine_ns, UNOWED_WITHIN);
        let is_unowed = self.unowed.len() >= UNOWED && self.unowed.iter().all(is_recent);
        (is_unowed || self.told.is_some_and(commands)).into()
    }

    fn explain(&self, _: Cause, _: Moment) -> Option<String> {
        let topic = &self.topic;
        let Some(told) = self.told else {
            return Some(
                "the robot acknowledges commands that it was not sent: another host commands it over its network or serial server; end that host's program"
                    .to_owned(),
            );
        };
        let number = gid_text(told.newest.number);
        Some(format!(
            "another node publishes {topic}, its GID is {number}: `ros2 topic info --verbose {topic}` names it; end it"
        ))
    }

    fn judges_frames(&self) -> bool {
        false
    }
}
