//! Monitor for other commanders: nodes that publish commands, and hosts whose commands the robot
//! acknowledges.
//!
//! The robot obeys the newest command, so two commanders drive it where neither wants.
//!
//! A robot acknowledges each command. Over a serial server every host receives that, and a JSON
//! robot counts all hosts' orders. Duplicated datagrams may add a few acknowledgements.
//!
//! An X80 acknowledges datagrams to their sender, and sends frames to the last sender. Missing
//! frames with prompt acknowledgements thus show another host. A bad radio loses both, and a busy
//! machine delays both.

use std::{collections::VecDeque, iter::repeat_n, time::Duration};

use common::{
    clock::Pace,
    driver::Commander,
    mission::{Mission, Protocol},
    samples::Cause,
};
use ros2_driver::publishers::gid_text;

use super::monitor::{Condition, Moment, Monitor, Observation};
use crate::backoff::has_passed;

pub(crate) const GONE_AFTER: Duration = Duration::from_secs(1);
/// Time after which a sender of stops alone is a commander. An earlier link's stop guard leaves
/// sooner.
pub(crate) const STAYS: Duration = Duration::from_secs(2);
/// Counting window. Later acknowledgements are lost.
pub(crate) const WINDOW: Duration = Duration::from_secs(2);
/// Unowed acknowledgements per window that show another commander.
pub(crate) const UNOWED: usize = 6;
/// Acknowledgements that a found robot may owe for earlier commands.
const OWED_WHEN_FOUND: usize = 64;
/// Share of missing frames in [`WINDOWS`] successive windows that shows another host, with at most
/// half as many late acknowledgements.
const AWAY_SHARE: f64 = 0.2;
const WINDOWS: usize = 2;

#[derive(Clone, Copy, Debug, Default)]
struct Window {
    began_ns: u64,
    frames: usize,
    unowed: usize,
    late: usize,
}

impl Window {
    fn shows(&self) -> Option<&'static str> {
        (self.unowed >= UNOWED).then_some("acknowledges commands that the link did not send")
    }
}

#[derive(Clone, Copy, Debug)]
struct Told {
    newest: Commander,
    moves: bool,
    began_ns: u64,
    newest_ns: u64,
}

#[derive(Clone, Debug, Default)]
pub struct OtherCommander {
    topic: String,
    told: Option<Told>,
    in_ticks: bool,
    /// When each acknowledgement became owed, nanoseconds.
    owed: VecDeque<u64>,
    window: Window,
    /// Most frames of a window, and successive windows with another host.
    most: usize,
    shared: usize,
    /// Expected frames per window of a robot that answers its last sender; 0 for others.
    stated: f64,
    half_period: Duration,
    shows: Option<&'static str>,
    /// Whether an unowed acknowledgement came.
    pub(crate) is_told: bool,
}

impl OtherCommander {
    fn shows(&self) -> Option<&'static str> {
        self.window.shows().or(self.shows)
    }

    fn acknowledged(&mut self, now_ns: u64) {
        // Pops the newest, so that a lost acknowledgement makes no later one late.
        match self.owed.pop_back() {
            Some(then_ns) => {
                self.window.late += usize::from(has_passed(then_ns, now_ns, self.half_period));
            }
            None => {
                self.window.unowed += 1;
                self.is_told = true;
            }
        }
    }

    fn pass(&mut self, now_ns: u64) {
        while self.owed.pop_front_if(|then_ns| has_passed(*then_ns, now_ns, WINDOW)).is_some() {
            self.window.late += 1;
        }
        let Window { began_ns, frames, late, .. } = self.window;
        if has_passed(began_ns, now_ns, WINDOW) {
            let stated = self.stated.min(self.most as f64);
            let away = stated - frames as f64;
            assert!(stated >= 0.0);
            let is_shared = away > AWAY_SHARE * stated && (2 * late) as f64 <= away;
            if !is_shared {
                self.shared = 0;
            } else if frames > 0 {
                // Streams may have stopped, but a host that commands often takes all frames of some
                // windows.
                self.shared += 1;
            }
            self.most = self.most.max(frames);
            let shares = (self.shared >= WINDOWS)
                .then_some("acknowledges all commands and sends part of its frames elsewhere");
            self.shows = self.window.shows().or(shares);
            self.window = Window { began_ns: now_ns, ..Window::default() };
        }
    }
}

impl Monitor for OtherCommander {
    fn new(mission: &Mission) -> Self {
        Self {
            topic: mission.robot.ros2.cmd_vel.clone(),
            stated: match mission.robot.protocol() {
                Protocol::X80 => WINDOW.as_secs_f64() * mission.robot.rate_hz,
                _ => 0.0,
            },
            half_period: Duration::from_secs_f64(0.5 / mission.robot.rate_hz),
            ..Self::default()
        }
    }

    fn observe(&mut self, what: &Observation<'_>, now: Moment) {
        let now_ns = now.machine_ns;
        let newest = match *what {
            Observation::Commander(newest) => newest,
            Observation::Pace(pace) => return self.in_ticks = pace == Pace::Max,
            Observation::Time => return self.pass(now_ns),
            Observation::Motor(..) => return self.window.frames += 1,
            Observation::Acknowledged => return self.acknowledged(now_ns),
            Observation::Sent(owed) => return self.owed.extend(repeat_n(now_ns, owed)),
            Observation::Found { .. } => {
                self.shared = 0;
                return self.owed.extend(repeat_n(now_ns, OWED_WHEN_FOUND));
            }
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
        // A robot in lockstep answers whenever its process is scheduled.
        let shows = !self.in_ticks && self.shows().is_some();
        (shows || self.told.is_some_and(commands)).into()
    }

    fn explain(&self, _: Cause, _: Moment) -> Option<String> {
        let topic = &self.topic;
        if let Some(shows) = self.shows() {
            return Some(format!(
                "the robot {shows}, so another program commands it, on this machine or another host; end that program"
            ));
        }
        let number = gid_text(self.told?.newest.number);
        Some(format!(
            "another node publishes {topic} (GID {number}); find it with `ros2 topic info --verbose {topic}` and end it"
        ))
    }

    fn judges_frames(&self) -> bool {
        false
    }
}
