//! Kinds of hits on a process, and their repeatable, seeded schedule.

use std::time::Duration;

use processes::stages::TABLE;
use rustix::process::Signal;
use serde::{Deserialize, Serialize};

use simulation::Random;

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    #[default]
    Kill,
    KillAtStart,
    /// SIGABRT, as after a panic that cannot unwind. SIGSEGV is unsuitable: Rust's runtime takes
    /// the first one for a stack overflow, finds none, and continues.
    Crash,
    Terminate,
    Freeze,
    /// SIGSTOP to supervisor and stages together, then SIGCONT.
    FreezeAll,
}

impl Kind {
    pub const fn signal(self) -> Signal {
        match self {
            Self::Kill | Self::KillAtStart => Signal::KILL,
            Self::Crash => Signal::ABORT,
            Self::Terminate => Signal::TERM,
            Self::Freeze | Self::FreezeAll => Signal::STOP,
        }
    }
}

/// Mean time between signals. Each stage gets one every two to three seconds, and is stable before.
const MEAN_PAUSE: Duration = Duration::from_millis(500);
/// Maximum time of a start-up hit after the start, in which the stage joins the bus.
const STARTUP: Duration = Duration::from_millis(12);
/// Share of kills followed by one of the starting successor. A fifth of all signals are such; the
/// rest find no successor, or one that was ready too soon.
const STARTUP_SHARE: f64 = 3.0 / 7.0;
const SUPERVISOR_SHARE: f64 = 0.05;
/// Share of signals to a consumer, and of freezes of everything.
const OTHER_SHARE: f64 = 0.5;
/// Range of freeze times of everything or a consumer: from below a stage's deadline to three times
/// as long.
const FREEZE_S: [f64; 2] = [0.3, 1.5];

pub struct Schedule(Random);

impl Schedule {
    pub fn new(seed: u64) -> Self {
        Self(Random::new(seed, 7))
    }

    pub fn pause(&mut self) -> Duration {
        self.0.exponential(MEAN_PAUSE)
    }

    pub fn stage(&mut self) -> &'static str {
        TABLE[self.0.below(TABLE.len())].name
    }

    /// Draws the supervisor's hit, if it gets one. SIGTERM would end the run, and only systemd
    /// notices a frozen supervisor.
    pub fn supervisor(&mut self) -> Option<Kind> {
        let is_hit = self.0.chance(SUPERVISOR_SHARE);
        is_hit.then(|| if self.0.chance(0.8) { Kind::Kill } else { Kind::Crash })
    }

    pub fn freeze_all(&mut self) -> Option<Duration> {
        self.0.chance(OTHER_SHARE).then(|| self.freeze())
    }

    fn freeze(&mut self) -> Duration {
        Duration::from_secs_f64(self.0.in_range(FREEZE_S))
    }

    /// Draws consumer, kind and freeze time, if a consumer is hit.
    pub fn consumer(&mut self, count: usize) -> Option<(usize, Kind, Duration)> {
        // Without consumers, this leaves the sequence of decisions unchanged.
        (count > 0 && self.0.chance(OTHER_SHARE)).then(|| {
            let index = self.0.below(count);
            let kind = if self.0.chance(0.7) { Kind::Kill } else { Kind::Freeze };
            (index, kind, self.freeze())
        })
    }

    pub fn kind(&mut self) -> Kind {
        match self.0.share() {
            ..0.6 => Kind::Kill,
            ..0.75 => Kind::Crash,
            ..0.9 => Kind::Terminate,
            _ => Kind::Freeze,
        }
    }

    pub fn startup_hit(&mut self) -> Option<Duration> {
        self.0.chance(STARTUP_SHARE).then(|| STARTUP.mul_f64(self.0.share()))
    }
}
