//! Latency monitor: detects frames delayed by buffers. Frames carry no time.
//!
//! A robot acknowledges every command. The link stops sending for a window when a lost robot
//! answers again, and at intervals while it is late. An acknowledgement is late if the last send is
//! longer ago than a command's limit; a sooner one proves nothing. A robot without acknowledgements
//! counts as timely.

use std::time::Duration;

use common::{clock::Pace, mission::Mission, samples::Cause};

use super::{
    monitor::{Condition, Moment, Monitor, Observation},
    presence::LEAST_SILENCE,
};
use crate::backoff::has_passed;

/// Window beyond the limit, mission time. A standing robot gets commands every 0.2 s.
const WINDOW: Duration = Duration::from_millis(400);
/// Retest interval of a late robot, mission time.
const AGAIN: Duration = Duration::from_secs(2);

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum State {
    #[default]
    Timely,
    /// Sending is paused since this time, to expose late acknowledgements.
    Testing(u64),
    Late(u64),
}

#[derive(Clone, Debug, Default)]
pub struct LatencyMonitor {
    command_limit: Duration,
    limit: Duration,
    window: Duration,
    again: Duration,
    sent_ns: u64,
    came_late: bool,
    state: State,
}

impl LatencyMonitor {
    fn set_pace(&mut self, pace: Pace) {
        let rate = match pace {
            Pace::Rate(rate) if rate > 0.0 => rate,
            _ => 1.0,
        };
        let machine = |mission: Duration| mission.div_f64(rate);
        self.limit = machine(self.command_limit).max(LEAST_SILENCE);
        self.window = self.limit + machine(WINDOW);
        assert!(self.window >= self.limit && self.limit >= LEAST_SILENCE);
        self.again = machine(AGAIN);
    }

    fn pass(&mut self, now_ns: u64) {
        match self.state {
            State::Testing(since) if has_passed(since, now_ns, self.window) => {
                self.state = if self.came_late { State::Late(now_ns) } else { State::Timely };
            }
            State::Late(since) if has_passed(since, now_ns, self.again) => self.test(now_ns),
            _ => {}
        }
    }

    pub const fn is_testing(&self) -> bool {
        matches!(self.state, State::Testing(_))
    }

    const fn test(&mut self, now_ns: u64) {
        self.came_late = false;
        self.state = State::Testing(now_ns);
    }
}

impl Monitor for LatencyMonitor {
    fn new(mission: &Mission) -> Self {
        let command_limit = Duration::from_secs_f64(mission.robot.command_limit_s);
        let mut new = Self { command_limit, ..Self::default() };
        new.set_pace(Pace::Rate(1.0));
        new
    }

    fn observe(&mut self, what: &Observation<'_>, now: Moment) {
        match *what {
            Observation::Pace(pace) => self.set_pace(pace),
            Observation::Time => self.pass(now.machine_ns),
            Observation::Sent(_) => self.sent_ns = now.machine_ns,
            Observation::Acknowledged => {
                let age_ns = now.machine_ns.saturating_sub(self.sent_ns);
                self.came_late |= Duration::from_nanos(age_ns) > self.limit;
            }
            Observation::Found { again: true } => self.test(now.machine_ns),
            Observation::Lost => self.state = State::Timely,
            _ => {}
        }
    }

    /// Holds during a test too, because the robot may be late.
    fn condition(&self, _: Cause, _: Moment) -> Condition {
        (self.state != State::Timely).into()
    }

    fn explain(&self, _: Cause, _: Moment) -> Option<String> {
        let text = "the robot's messages may be old; check the network and the radio for delays";
        Some(text.to_owned())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::*;

    #[test]
    fn a_robot_may_go_after_the_window_if_its_acknowledgements_come_in_time() {
        // Found at 10 s after commands every 70 ms, acknowledged after `delay_ms`. Then nothing is
        // sent for `quiet_ms`.
        for (delay_ms, quiet_ms, is_late) in
            [(20, 300, true), (20, 700, false), (200, 700, false), (2000, 700, true)]
        {
            let mut monitor = LatencyMonitor::new(&mission(""));
            // At half the pace of the clock.
            let mut take = |what: Observation<'_>, ms: u64| {
                let machine_ns = 2 * (10_000 + ms) * MS;
                monitor.observe(&what, Moment { machine_ns, ..Moment::default() });
            };
            take(Observation::Pace(Pace::Rate(0.5)), 0);
            take(Observation::Sent(0), 0);
            take(Observation::Found { again: true }, 0);
            for now in (0..=quiet_ms).step_by(70) {
                if now <= delay_ms {
                    take(Observation::Acknowledged, now);
                }
                take(Observation::Time, now);
            }
            let is = monitor.condition(Cause::RobotLate, Moment::default());
            assert_eq!(is == Condition::Holds, is_late, "{delay_ms} {quiet_ms}");
        }
    }
}
