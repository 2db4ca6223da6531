//! Whether what the robot sends is old: buffers on the way may hold seconds of it, and its frames carry no time.
//!
//! A robot acknowledges every command. After it was lost, and while it is late, the link sends nothing for a window; an
//! acknowledgement that comes when nothing was sent for as long as a command lasts has taken longer than that. One that
//! came in time cannot be told from a late one of an earlier command, so only late ones count. A robot that acknowledges
//! nothing is taken for timely.

use std::time::Duration;

use common::{clock::Pace, mission::Mission};

/// However fast mission time runs, processes are late by so much now and then.
const LEAST_LIMIT: Duration = Duration::from_millis(100);
/// How long the window is beyond the limit, mission time: commands are sent every 0.2 s to a robot that stands.
const WINDOW: Duration = Duration::from_millis(400);
/// A late robot is asked again after this, mission time.
const AGAIN: Duration = Duration::from_secs(2);

/// What is known of the robot's age.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum State {
    /// Nothing speaks for lateness.
    #[default]
    Timely,
    /// Nothing is sent since that time of the machine's clock, to find out.
    Asked(u64),
    /// It is late, known since then.
    Late(u64),
}

/// How late one robot is. Times of the machine's clock, nanoseconds.
#[derive(Clone, Debug)]
pub struct LatencyMonitor {
    command_limit: Duration,
    limit_ns: u64,
    window_ns: u64,
    again_ns: u64,
    sent_ns: u64,
    came_late: bool,
    state: State,
}

impl LatencyMonitor {
    /// Of the robot of `mission`, which was not heard yet.
    #[must_use]
    pub fn new(mission: &Mission) -> Self {
        let command_limit = Duration::from_secs_f64(mission.robot.command_limit_s);
        let mut new = Self {
            command_limit,
            limit_ns: 0,
            window_ns: 0,
            again_ns: 0,
            sent_ns: 0,
            came_late: false,
            state: State::Timely,
        };
        new.set_pace(Pace::Rate(1.0));
        new
    }

    /// Mission time passes at that pace.
    pub fn set_pace(&mut self, pace: Pace) {
        let rate = match pace {
            Pace::Rate(rate) if rate > 0.0 => rate,
            _ => 1.0,
        };
        let machine = |mission: Duration| mission.div_f64(rate);
        let limit = machine(self.command_limit).max(LEAST_LIMIT);
        self.limit_ns = limit.as_nanos() as u64;
        self.window_ns = (limit + machine(WINDOW)).as_nanos() as u64;
        self.again_ns = machine(AGAIN).as_nanos() as u64;
    }

    /// The robot answers again.
    pub const fn found(&mut self, now_ns: u64) {
        self.ask(now_ns);
    }

    /// The robot does not answer: what it was is over.
    pub const fn lost(&mut self) {
        self.state = State::Timely;
    }

    /// Something was sent to it.
    pub const fn sent(&mut self, now_ns: u64) {
        self.sent_ns = now_ns;
    }

    /// It acknowledged something.
    pub const fn acknowledged(&mut self, now_ns: u64) {
        if now_ns.saturating_sub(self.sent_ns) > self.limit_ns {
            self.came_late = true;
        }
    }

    /// Time passes.
    pub const fn pass(&mut self, now_ns: u64) {
        match self.state {
            State::Asked(since) if now_ns.saturating_sub(since) >= self.window_ns => {
                self.state = if self.came_late {
                    State::Late(now_ns)
                } else {
                    State::Timely
                };
            }
            State::Late(since) if now_ns.saturating_sub(since) >= self.again_ns => self.ask(now_ns),
            _ => {}
        }
    }

    /// Whether nothing is to be sent, to find out.
    #[must_use]
    pub const fn asks(&self) -> bool {
        matches!(self.state, State::Asked(_))
    }

    /// Whether the robot must stand: it is late, or may be.
    #[must_use]
    pub const fn suspected(&self) -> bool {
        !matches!(self.state, State::Timely)
    }

    const fn ask(&mut self, now_ns: u64) {
        self.came_late = false;
        self.state = State::Asked(now_ns);
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    const MS: u64 = 1_000_000;

    /// A robot that acknowledges what it gets every 70 ms after `delay_ms`, found at 0 and then left alone for `quiet_ms`.
    fn found(delay_ms: u64, quiet_ms: u64) -> LatencyMonitor {
        let text = "target = [3, 0]";
        let mission = Mission::parse(text, Path::new("test.toml")).unwrap();
        let mut latency_monitor = LatencyMonitor::new(&mission);
        latency_monitor.sent(10_000 * MS);
        latency_monitor.found(10_000 * MS);
        let last_acknowledged = delay_ms.min(quiet_ms);
        for now in (0..=quiet_ms).step_by(70) {
            if now <= last_acknowledged {
                latency_monitor.acknowledged((10_000 + now) * MS);
            }
            latency_monitor.pass((10_000 + now) * MS);
        }
        latency_monitor
    }

    #[test]
    fn a_robot_whose_acknowledgements_come_in_time_may_go_after_the_window() {
        assert!(found(20, 300).suspected(), "not known yet");
        assert!(!found(20, 700).suspected());
        assert!(!found(200, 700).suspected());
    }

    #[test]
    fn a_robot_that_acknowledges_what_was_sent_long_ago_is_late() {
        assert!(found(2000, 700).suspected());
    }

    #[test]
    fn a_late_robot_is_asked_again_and_believed_when_nothing_late_comes() {
        let mut latency_monitor = found(2000, 700);
        assert!(!latency_monitor.asks());
        latency_monitor.pass(13_000 * MS);
        assert!(latency_monitor.asks());
        latency_monitor.acknowledged(13_400 * MS);
        latency_monitor.pass(13_700 * MS);
        assert!(latency_monitor.suspected());
        latency_monitor.pass(16_000 * MS);
        latency_monitor.pass(16_700 * MS);
        assert!(!latency_monitor.suspected());
    }
}
