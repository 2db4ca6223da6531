//! Which stage gets which signal when: seeded, so that a schedule can be repeated.

use std::{ops::Range, time::Duration};

use rand_pcg::{Pcg64, rand_core::Rng};
use supervisor::stages::TABLE;

use crate::chaos::kind::Kind;

/// Between two signals on average: each stage gets one every two to three seconds, and was stable before.
const MEAN_PAUSE: Duration = Duration::from_millis(500);
/// A successor that is hit in its start-up is hit within this of its start: the time it joins the bus.
const STARTUP: Duration = Duration::from_millis(12);
/// Share of the signals scheduled for a successor in its start-up, where that is asked for. A fifth of all signals are
/// sent to one; the rest is not sent, because there was no successor, or it was ready too soon.
const STARTUP_SHARE: f64 = 0.3;

/// Share of the signals that hit the supervisor, where that is asked for: a hundred in two thousand.
const SUPERVISOR_SHARE: f64 = 0.05;

/// Share of the signals that hit a consumer, where there are any.
const CONSUMER_SHARE: f64 = 0.5;

/// Share of the hits that freeze everything, where that is asked for; the others fall as they do otherwise.
const FREEZE_ALL_SHARE: f64 = 0.5;
/// For how long everything, or a consumer, is frozen, seconds: less than a stage's deadline, up to three times as long.
const FREEZE_S: Range<f64> = 0.3..1.5;

/// A seeded sequence of decisions.
#[derive(Debug)]
pub(crate) struct Schedule(Pcg64);

impl Schedule {
    pub(crate) fn new(seed: u64) -> Self {
        Self(Pcg64::new(u128::from(seed), 7))
    }

    /// Uniform in [0, 1).
    fn uniform(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Until the next signal: exponential, so that it may come at any moment.
    pub(crate) fn pause(&mut self) -> Duration {
        MEAN_PAUSE.mul_f64(-(1.0 - self.uniform()).ln())
    }

    /// The stage to hit.
    pub(crate) fn stage(&mut self) -> &'static str {
        let index = (self.uniform() * TABLE.len() as f64) as usize;
        TABLE[index.min(TABLE.len() - 1)].name
    }

    /// Whether to hit the supervisor instead.
    pub(crate) fn supervisor(&mut self) -> bool {
        self.uniform() < SUPERVISOR_SHARE
    }

    /// How to hit the supervisor. Not by SIGTERM, which ends the run; one that is frozen only systemd notices.
    pub(crate) fn supervisor_kind(&mut self) -> Kind {
        match self.uniform() {
            ..0.8 => Kind::Kill,
            _ => Kind::Crash,
        }
    }

    /// Whether to freeze everything instead, and for how long.
    pub(crate) fn freeze_all(&mut self) -> Option<Duration> {
        let frozen = self.uniform() < FREEZE_ALL_SHARE;
        frozen.then(|| self.freeze())
    }

    /// For how long something is frozen that is not left to the supervisor.
    fn freeze(&mut self) -> Duration {
        let Range { start, end } = FREEZE_S;
        Duration::from_secs_f64(start + (end - start) * self.uniform())
    }

    /// Which of so many consumers to hit instead of a stage or the supervisor, `always` or now and then; how, and for how
    /// long where it is frozen.
    pub(crate) fn consumer(
        &mut self,
        count: usize,
        always: bool,
    ) -> Option<(usize, Kind, Duration)> {
        // Where there are none, the sequence of decisions is the same as ever.
        if count == 0 || self.uniform() >= CONSUMER_SHARE && !always {
            return None;
        }
        let index = (self.uniform() * count as f64) as usize;
        let kind = match self.uniform() {
            ..0.7 => Kind::Kill,
            _ => Kind::Freeze,
        };
        Some((index.min(count - 1), kind, self.freeze()))
    }

    /// How to hit it.
    pub(crate) fn kind(&mut self) -> Kind {
        match self.uniform() {
            ..0.6 => Kind::Kill,
            ..0.75 => Kind::Crash,
            ..0.9 => Kind::Terminate,
            _ => Kind::Freeze,
        }
    }

    /// Whether to hit the successor too, and how long after its start.
    pub(crate) fn startup_hit(&mut self) -> Option<Duration> {
        // Their share of all signals, as a share of those that can be followed by one.
        let hit = self.uniform() < STARTUP_SHARE / (1.0 - STARTUP_SHARE);
        hit.then(|| STARTUP.mul_f64(self.uniform()))
    }
}
