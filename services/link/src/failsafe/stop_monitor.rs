//! Stop monitor: checks that a stopped robot comes to rest, and picks the next stop method
//! otherwise.

use std::time::Duration;

use common::{
    clock::MissionTime,
    driver::counts::WheelCounts,
    mission::{Mission, Response},
    samples::{Cause, Rest},
};

use super::monitor::{Condition, Counts, Moment, Monitor, Observation};

/// Time for a lost stop or two, besides dead time and braking.
const STOPS_ARE_LOST_S: f64 = 0.45;
/// Motion past the due rest that shows a robot which does not stop. A repeated stop acts sooner.
pub(crate) const DOES_NOT_STOP_AFTER: Duration = Duration::from_millis(500);
const MOVES_M_S: f64 = 0.03;
/// Rest: this rim speed, or [`RESTS_COUNTS`] between frames, because resting encoders vary.
const RESTS_M_S: f64 = 0.01;
const RESTS_COUNTS: f64 = 4.0;
const AT_REST_AFTER: Duration = Duration::from_millis(200);
/// Longest judged gap. Another host may take most frames.
const LONGEST_GAP: Duration = Duration::from_secs(1);
const NEXT_METHOD_AFTER: Duration = Duration::from_millis(300);

/// Returns the time until a robot that ignores a stop at full speed gets the next method, seconds.
/// Motion counts in whole frame intervals.
pub(crate) fn known_within_s(mission: &Mission) -> f64 {
    let comes_to_rest = comes_to_rest_s(mission.trusted_response(), mission.speed_m_s());
    comes_to_rest + DOES_NOT_STOP_AFTER.as_secs_f64() + 2.0 / mission.robot.rate_hz
}

fn comes_to_rest_s(response: Response, speed_m_s: f64) -> f64 {
    STOPS_ARE_LOST_S + response.dead_time_s() + speed_m_s / response.acceleration_m_s2
}

#[derive(Clone, Debug)]
pub struct StopMonitor {
    counts_per_m: f64,
    longest_gap: Duration,
    response: Response,
    /// Response found while stopping. It applies after rest, because an ignored stop looks like
    /// slow braking.
    found: Option<Response>,
    /// Faster wheel's newest motion command, counts/s.
    driven: f64,
    told_to_stand: Option<MissionTime>,
    frame: Option<(WheelCounts, MissionTime)>,
    moves: bool,
    moving: Duration,
    resting: Duration,
    /// Number of the stop method. It grows past the last one; the first then follows.
    pub(crate) method: usize,
    tried: Option<MissionTime>,
}

impl StopMonitor {
    fn commanded(&mut self, counts: [i16; 2], now: MissionTime) {
        if counts == [0, 0] {
            if self.told_to_stand.is_none() {
                self.resting = Duration::ZERO;
                self.told_to_stand = Some(now);
            }
        } else {
            let [left, right] = counts.map(i16::unsigned_abs);
            self.driven = left.max(right).into();
            self.told_to_stand = None;
            self.moving = Duration::ZERO;
            self.method = 0;
        }
    }

    fn heard(&mut self, counts: impl Into<WheelCounts>, now: MissionTime) {
        let counts = counts.into();
        let Some((before, then)) = self.frame.replace((counts, now)) else {
            return;
        };
        let gap = now.since(then);
        if gap > LONGEST_GAP {
            self.not_heard();
            return;
        }
        let farthest = counts.since(before).map(f64::abs).into_iter().fold(0.0, f64::max);
        let within = |speed: f64| speed * self.counts_per_m * gap.as_secs_f64();
        let rests = farthest <= RESTS_COUNTS.max(within(RESTS_M_S));
        let moves = !rests && farthest >= within(MOVES_M_S);
        // Wheels that rest earlier may still start by the previous command.
        let shows_after = Duration::from_secs_f64(self.response.dead_time_s());
        let shows_stop = self.told_to_stand.is_none_or(|told| then.since(told) >= shows_after);
        // In a long gap resting wheels may have moved there and back; moving ones disobeyed in any
        // case.
        self.resting = if rests && shows_stop && gap <= self.longest_gap {
            self.resting + gap
        } else {
            Duration::ZERO
        };
        if self.resting >= AT_REST_AFTER {
            assert!(!moves);
            self.response = self.found.take().unwrap_or(self.response);
        }
        self.moves = moves;
        assert!(!moves || self.resting.is_zero());
        let rests_s = comes_to_rest_s(self.response, self.driven / self.counts_per_m);
        let comes_to_rest = Duration::from_secs_f64(rests_s);
        let due = |told: MissionTime| now.since(told).saturating_sub(gap) >= comes_to_rest;
        if !moves {
            self.moving = Duration::ZERO;
        } else if self.told_to_stand.is_some_and(due) {
            self.moving += gap;
        }
    }

    const fn not_heard(&mut self) {
        self.moves = false;
        self.moving = Duration::ZERO;
        self.resting = Duration::ZERO;
    }

    /// Returns the rest, which is unknown without two recent frames.
    pub fn rest(&self, now: MissionTime) -> Rest {
        match self.frame {
            Some((_, then)) if now.since(then) > self.longest_gap => Rest::Unknown,
            _ if self.resting >= AT_REST_AFTER => Rest::AtRest,
            _ if self.moves => Rest::Moving,
            _ => Rest::Unknown,
        }
    }

    pub fn is_told_to_move(&self) -> bool {
        self.told_to_stand.is_none() && self.driven > 0.0
    }

    /// Advances if the next method is due; returns whether it was. `does_not_stop`: the cause
    /// applies.
    pub fn takes_next_method(&mut self, does_not_stop: bool, now: MissionTime) -> bool {
        if !does_not_stop {
            self.tried = None;
            return false;
        }
        if self.tried.is_some_and(|tried| now.since(tried) < NEXT_METHOD_AFTER) {
            return false;
        }
        self.tried = Some(now);
        self.method += 1;
        true
    }
}

impl Monitor for StopMonitor {
    fn new(mission: &Mission) -> Self {
        Self {
            counts_per_m: 1.0 / mission.body().metres_per_count(),
            longest_gap: Duration::from_secs_f64(2.0 / mission.robot.rate_hz),
            response: mission.trusted_response(),
            found: None,
            driven: 0.0,
            told_to_stand: None,
            frame: None,
            moves: false,
            moving: Duration::ZERO,
            resting: Duration::ZERO,
            method: 0,
            tried: None,
        }
    }

    fn observe(&mut self, what: &Observation<'_>, now: Moment) {
        match *what {
            Observation::Commanded(counts) => self.commanded(counts, now.time),
            Observation::Responds(response) if self.told_to_stand.is_some() => {
                self.found = Some(response);
            }
            Observation::Responds(response) => self.response = response,
            Observation::Motor(counts, Counts::Follow) => self.heard(counts, now.time),
            Observation::Motor(_, Counts::Restarted { .. } | Counts::Elsewhere) => {
                self.frame = None;
                self.not_heard();
            }
            Observation::Motor(_, Counts::Implausible) | Observation::Lost => self.not_heard(),
            _ => {}
        }
    }

    fn condition(&self, _: Cause, _: Moment) -> Condition {
        assert!(self.moving.is_zero() || self.resting.is_zero());
        if self.moving >= DOES_NOT_STOP_AFTER {
            Condition::Holds
        } else {
            Condition::OverFor(self.resting)
        }
    }

    fn explain(&self, _: Cause, _: Moment) -> Option<String> {
        Some("the robot was told to stand and its encoders report motion; the link tries every stop method in turn; check whether another host commands the robot".to_owned())
    }
}

#[cfg(test)]
mod tests;
