//! Whether the robot comes to rest when it is told to, by its encoders, and what else it is told when it does not.

use std::time::Duration;

use common::{clock::MissionTime, mission::Mission, wire::counts_between};

/// A robot that was told to stand is at rest after this: the delay and the lag of its speed loop, and a stop or two that
/// were lost.
const COMES_TO_REST: Duration = Duration::from_millis(600);
/// So much of motion after that is disobedience: longer than it takes from a stop sent again until it shows.
pub(crate) const DOES_NOT_STOP_AFTER: Duration = Duration::from_millis(500);
/// A wheel moves from this speed on, m/s at the rim.
const MOVES_M_S: f64 = 0.03;
/// A wheel is at rest below this speed, m/s, or this many counts between two frames: encoders tremble.
const RESTS_M_S: f64 = 0.01;
const RESTS_COUNTS: f64 = 4.0;
/// It is at rest when it has been for so long.
const AT_REST_AFTER: Duration = Duration::from_millis(200);
/// A robot that did not obey does again when it has been at rest for so long.
const OBEYS_AFTER: Duration = Duration::from_millis(500);

/// A way to make the robot stand. Each is tried in turn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum StopMethod {
    /// Velocity 0.
    #[default]
    Velocity,
    /// Both wheels' motors disabled.
    Disable,
    /// The pulse width at which a wheel stands.
    Pwm,
    /// All motors suspended.
    Suspend,
}

impl StopMethod {
    /// The one to try after it.
    #[must_use]
    pub const fn next(self) -> Self {
        match self {
            Self::Velocity => Self::Disable,
            Self::Disable => Self::Pwm,
            Self::Pwm => Self::Suspend,
            Self::Suspend => Self::Velocity,
        }
    }

    /// For logs.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Velocity => "velocity 0",
            Self::Disable => "disable",
            Self::Pwm => "pulse width 0",
            Self::Suspend => "suspend",
        }
    }
}

/// The stop_monitor of one robot.
#[derive(Clone, Debug)]
pub struct StopMonitor {
    counts_per_m: f64,
    longest_gap: Duration,
    told_to_stand: Option<MissionTime>,
    frame: Option<([u16; 2], MissionTime)>,
    moving: Duration,
    resting: Duration,
    does_not_stop: bool,
    method: StopMethod,
}

impl StopMonitor {
    /// Of the robot of `mission`, of which nothing is known.
    #[must_use]
    pub fn new(mission: &Mission) -> Self {
        Self {
            counts_per_m: 1.0 / mission.body().metres_per_count(),
            longest_gap: Duration::from_secs_f64(2.0 / mission.robot.rate_hz),
            told_to_stand: None,
            frame: None,
            moving: Duration::ZERO,
            resting: Duration::ZERO,
            does_not_stop: false,
            method: StopMethod::Velocity,
        }
    }

    /// The wheels were told these counts/s.
    pub fn commanded(&mut self, counts: [i16; 2], now: MissionTime) {
        if counts == [0, 0] {
            if self.told_to_stand.is_none() {
                // Rest before a command that was just sent shows in the wheels is none.
                self.resting = Duration::ZERO;
                self.told_to_stand = Some(now);
            }
        } else {
            self.told_to_stand = None;
            self.moving = Duration::ZERO;
            self.method = StopMethod::Velocity;
        }
    }

    /// The counts of a frame.
    pub fn heard(&mut self, counts: [u16; 2], now: MissionTime) {
        let Some((before, then)) = self.frame.replace((counts, now)) else {
            return;
        };
        let gap = now.since(then);
        if gap > self.longest_gap {
            self.not_heard();
            return;
        }
        let farthest = [0, 1]
            .map(|wheel| f64::from(counts_between(before[wheel], counts[wheel]).abs()))
            .into_iter()
            .fold(0.0, f64::max);
        let within = |speed: f64| speed * self.counts_per_m * gap.as_secs_f64();
        let rests = farthest <= RESTS_COUNTS.max(within(RESTS_M_S));
        let moves = !rests && farthest >= within(MOVES_M_S);
        self.resting = if rests {
            self.resting + gap
        } else {
            Duration::ZERO
        };
        let due = |told: MissionTime| now.since(told).saturating_sub(gap) >= COMES_TO_REST;
        if !moves {
            self.moving = Duration::ZERO;
        } else if self.told_to_stand.is_some_and(due) {
            self.moving += gap;
        }
        self.does_not_stop = if self.does_not_stop {
            self.resting < OBEYS_AFTER
        } else {
            self.moving >= DOES_NOT_STOP_AFTER
        };
    }

    /// It is unknown how the wheels turn.
    pub const fn not_heard(&mut self) {
        self.moving = Duration::ZERO;
        self.resting = Duration::ZERO;
    }

    /// The counts began anew.
    pub const fn reset_counts(&mut self) {
        self.frame = None;
        self.not_heard();
    }

    /// Whether it moves although it was told to stand.
    #[must_use]
    pub const fn does_not_stop(&self) -> bool {
        self.does_not_stop
    }

    /// Whether its encoders say that no wheel turns.
    #[must_use]
    pub fn is_at_rest(&self) -> bool {
        self.resting >= AT_REST_AFTER
    }

    /// How it is told to stand.
    #[must_use]
    pub const fn method(&self) -> StopMethod {
        self.method
    }

    /// That did not help.
    pub const fn try_next(&mut self) {
        self.method = self.method.next();
    }
}

#[cfg(test)]
mod tests;
