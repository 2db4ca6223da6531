//! Notices a robot that restarted its encoder counts: it was switched off and on, or its battery was
//! changed. What it counted before is gone, and the step in the counts is no motion.

use common::{
    clock::MissionTime,
    mission::Mission,
    wire::{counts_between, counts_restarted},
};

/// The counts of the frame before, and whether the robot was away since.
#[derive(Clone, Debug)]
pub struct RestartWatch {
    last: Option<([u16; 2], MissionTime)>,
    away: bool,
    restarts: u32,
    /// The most a wheel turns in a second.
    top_counts: f64,
    /// Frames come this much too late or too early, seconds.
    jitter_s: f64,
}

impl RestartWatch {
    /// For the robot of `mission`.
    #[must_use]
    pub fn new(mission: &Mission) -> Self {
        let body = mission.body();
        Self {
            last: None,
            away: false,
            restarts: 0,
            top_counts: body.top_speed_m_s / body.metres_per_count(),
            jitter_s: 1.0 / mission.robot.rate_hz,
        }
    }

    /// The robot does not answer.
    pub const fn lost(&mut self) {
        self.away = true;
    }

    /// Whether the counts of channels 0 and 1 began anew since the frame before. After an absence it is
    /// enough that both stand where a robot begins; otherwise they must also have come there faster than
    /// wheels turn.
    pub fn step(&mut self, counts: [u16; 2], now: MissionTime) -> bool {
        let away = std::mem::take(&mut self.away);
        let Some((before, then)) = self.last.replace((counts, now)) else {
            return false;
        };
        let reach = self.top_counts * (now.since(then).as_secs_f64() + self.jitter_s);
        let farthest = before
            .iter()
            .zip(counts)
            .map(|(&old, new)| counts_between(old, new).abs())
            .max()
            .unwrap_or_default();
        let restarted = counts_restarted(before, counts) && (away || f64::from(farthest) > reach);
        self.restarts += u32::from(restarted);
        restarted
    }

    /// How often that happened.
    #[must_use]
    pub const fn restarts(&self) -> u32 {
        self.restarts
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    fn watch() -> RestartWatch {
        // 1 m/s is 2247 counts a second, 321 a tick.
        RestartWatch::new(&Mission::parse("target = [3, 0]", Path::new("test.toml")).unwrap())
    }

    fn at(seconds: f64) -> MissionTime {
        MissionTime::from_seconds(seconds)
    }

    #[test]
    fn counts_that_begin_anew_after_an_absence_are_a_restart() {
        let mut watch = watch();
        assert!(!watch.step([32_168, 600], at(0.0)), "the first frame");
        watch.lost();
        assert!(watch.step([0, 1], at(3.0)));
        assert!(!watch.step([32_700, 68], at(3.1)), "it drives on");
        assert_eq!(watch.restarts(), 1);
    }

    #[test]
    fn a_robot_that_comes_back_with_its_counts_is_no_restart() {
        let mut watch = watch();
        watch.step([32_168, 600], at(0.0));
        watch.lost();
        assert!(!watch.step([32_000, 768], at(3.0)));
        watch.lost();
        // It stood at its start all the time.
        watch.step([3, 32_765], at(6.0));
        watch.lost();
        assert!(!watch.step([0, 0], at(9.0)));
    }

    #[test]
    fn a_robot_that_turns_back_through_its_start_is_no_restart() {
        let mut watch = watch();
        watch.step([300, 300], at(0.0));
        assert!(!watch.step([2, 1], at(0.143)));
        watch.step([800, 900], at(0.5));
        assert!(watch.step([0, 0], at(0.643)), "nothing turns so fast");
    }
}
