//! Check that a frame's counts can follow the earlier ones.
//!
//! A power cycle restarts the counts, and that step is not motion. Other impossible steps are
//! implausible. Later counts are compared with the last plausible ones, so one outdated frame has
//! no effect.
//!
//! A driven wheel turns no farther than its recent commands, its last speed or its reported speed
//! allow.
//! Otherwise counts that restart within half a metre of the start would pass as motion.

use std::collections::VecDeque;

use common::{clock::MissionTime, driver::counts::WheelCounts, mission::Mission};

use super::monitor::Counts;

/// Largest plausible multiple of the travel at top speed.
const IMPLAUSIBLE: f64 = 1.5;
/// The same for counts that other, suspected ones explain too.
const SURELY_FOLLOWS: f64 = 1.0;
/// Slack beyond known speeds, metres: acceleration adds hardly more in a tick.
const SLACK_M: f64 = 0.06;
/// Periods in which a command bounds the motion.
const PERIODS: f64 = 6.0;
/// Consistent frames that make implausible counts accepted.
const FOLLOW_EACH_OTHER: u32 = 3;

/// Bound on kept commands.
const MOST_KEPT: usize = 64;

type Frame = (WheelCounts, MissionTime);

#[derive(Clone, Debug, Default)]
pub struct RestartWatch {
    last: Option<Frame>,
    /// Reported and counted speeds at the last plausible counts, counts/s.
    turned: [[f64; 2]; 2],
    /// Newest commands. The wheels may still follow the recent ones.
    commanded: VecDeque<(MissionTime, [f64; 2])>,
    /// Newest implausible counts, their time, and the number of consistent frames.
    suspected: Option<(Frame, u32)>,
    /// Whether the robot was lost since the last frame.
    pub(crate) away: bool,
    /// Whether its odometry jumped since the last frame, which the next counts omit.
    pub(crate) jumped: bool,
    pub(crate) restarts: u32,
    top_counts: f64,
    jitter_s: f64,
    slack: f64,
}

impl RestartWatch {
    pub fn new(mission: &Mission) -> Self {
        let body = mission.body();
        Self {
            top_counts: body.top_speed_m_s / body.metres_per_count(),
            jitter_s: 1.0 / mission.robot.rate_hz,
            slack: SLACK_M / body.metres_per_count(),
            ..Self::default()
        }
    }

    /// Takes counts/s.
    pub fn commanded(&mut self, counts: [i16; 2], now: MissionTime) {
        if self.commanded.len() > MOST_KEPT {
            self.commanded.pop_front();
        }
        self.commanded.push_back((now, counts.map(f64::from)));
    }

    /// Classifies counts with reported `speeds`, counts/s.
    ///
    /// Counts near the start value mean a restart if the robot was lost, or if the step is
    /// impossible. `was_away`: silent until this frame.
    pub fn step(
        &mut self,
        counts: impl Into<WheelCounts>,
        speeds: [i32; 2],
        was_away: bool,
        now: MissionTime,
    ) -> Counts {
        let frame = (counts.into(), now);
        let speeds = speeds.map(f64::from);
        let away = std::mem::take(&mut self.away);
        if std::mem::take(&mut self.jumped) {
            self.begin_at(frame);
            return Counts::Elsewhere;
        }
        let Some(before) = self.last else {
            self.last = Some(frame);
            return Counts::Follow;
        };
        let share =
            self.share_of_reach(before, frame).max(self.share_of_driven(before, frame, speeds));
        assert!(share >= 0.0);
        if frame.0.restarted_since(before.0) && (away || share > 1.0) {
            self.begin_at(frame);
            return Counts::Restarted { was_away };
        }
        let follows = |(then, following)| {
            (self.share_of_reach(then, frame) <= IMPLAUSIBLE).then_some(following)
        };
        let following = self.suspected.and_then(follows);
        // The longer ago the last counts, the more would follow them.
        let most = if following.is_some() { SURELY_FOLLOWS } else { IMPLAUSIBLE };
        if share <= most {
            self.last = Some(frame);
            self.suspected = None;
            let (turned, gap_s) = since(before, frame);
            let gap_s = gap_s.max(self.jitter_s);
            self.turned = [speeds, turned.map(|turned| turned / gap_s)];
            return Counts::Follow;
        }
        let following = following.map_or(1, |following| following + 1);
        if following >= FOLLOW_EACH_OTHER {
            self.begin_at(frame);
            return Counts::Elsewhere;
        }
        self.suspected = Some((frame, following));
        Counts::Implausible
    }

    fn is_recent(&self, at: MissionTime, now: MissionTime) -> bool {
        now.since(at).as_secs_f64() <= PERIODS * self.jitter_s
    }

    fn begin_at(&mut self, frame: Frame) {
        self.last = Some(frame);
        self.suspected = None;
        self.restarts += 1;
    }

    /// Returns the step relative to the most that wheels can turn.
    fn share_of_reach(&self, before: Frame, now: Frame) -> f64 {
        let (turned, gap_s) = since(before, now);
        let reach = self.top_counts * (gap_s + self.jitter_s);
        assert!(reach > 0.0);
        let [left, right] = turned.map(f64::abs);
        left.max(right) / reach
    }

    /// Returns the step relative to the most by known speeds times [`IMPLAUSIBLE`]; 0 if not
    /// driven.
    fn share_of_driven(&self, before: Frame, now: Frame, speeds: [f64; 2]) -> f64 {
        let told = || {
            let recent = self.commanded.iter().filter(|(at, _)| self.is_recent(*at, now.1));
            recent.map(|(_, told)| *told)
        };
        if !self.is_recent(before.1, now.1) || told().all(|told| told == [0.0; 2]) {
            return 0.0;
        }
        let (turned, gap_s) = since(before, now);
        let time = gap_s + self.jitter_s;
        let share = |wheel: usize| {
            let counts = turned[wheel];
            let known = told().chain(self.turned).chain([speeds]);
            let along = known.map(|speeds| speeds[wheel] * counts.signum());
            let reach = along.fold(0.0, f64::max) * time + self.slack / IMPLAUSIBLE;
            counts.abs() / reach
        };
        share(0).max(share(1))
    }
}

/// Returns the counts turned between two frames, and the seconds.
fn since((before, then): Frame, (counts, now): Frame) -> ([f64; 2], f64) {
    (counts.since(before), now.since(then).as_secs_f64())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::mission;
    use Counts::{Elsewhere, Follow, Implausible};

    impl RestartWatch {
        fn at(&mut self, ms: u64, counts: [u16; 2]) -> Counts {
            self.step(counts, [0; 2], false, at(ms))
        }
    }

    fn at(ms: u64) -> MissionTime {
        MissionTime(ms * 1_000_000)
    }

    fn watch() -> RestartWatch {
        // 1 m/s is 2247 counts/s, 321 per tick.
        RestartWatch::new(&mission(""))
    }

    #[test]
    fn a_robot_that_turns_back_through_its_start_is_no_restart() {
        let mut watch = watch();
        watch.at(0, [300, 300]);
        assert_eq!(watch.at(143, [2, 1]), Follow);
        watch.at(500, [800, 900]);
        // Nothing turns so fast.
        assert_eq!(watch.at(643, [0, 0]), Counts::Restarted { was_away: false });
    }

    #[test]
    fn an_old_frame_between_good_ones_is_implausible_and_the_next_are_not_compared_with_it() {
        let mut watch = watch();
        for tick in 0..7_u16 {
            watch.at(143 * u64::from(tick), [1000 + 112 * tick, 5000]);
        }
        assert_eq!(watch.at(950, [31_000, 2000]), Implausible);
        assert_eq!(watch.at(1000, [1784, 5000]), Follow);
        assert_eq!(watch.restarts, 0);
    }

    #[test]
    fn counts_that_go_on_elsewhere_are_plausible_from_the_third_on_and_those_that_jump_about_never()
    {
        let mut elsewhere = watch();
        elsewhere.at(0, [1000, 1000]);
        for (tick, want) in (1_u16..).zip([Implausible, Implausible, Elsewhere, Follow]) {
            let counts = [9000, 17_000].map(|counts| counts + 100 * tick);
            assert_eq!(elsewhere.at(143 * u64::from(tick), counts), want, "{tick}");
        }
        assert_eq!(elsewhere.restarts, 1, "the step between them is no motion");
        let mut about = watch();
        about.at(0, [0, 0]);
        for tick in 1..5_u16 {
            let jump = tick.wrapping_mul(9973) % 32_768;
            let are = about.at(143 * u64::from(tick), [jump, 32_767 - jump]);
            assert_eq!(are, Implausible, "{tick}");
        }
    }

    #[test]
    fn counts_that_begin_anew_while_the_robot_drives_are_no_motion_however_near_the_start() {
        // 0.3 m/s are 674 counts/s, 96 per tick. A look around turns the wheels oppositely.
        for (driven, start) in [([674, 674], [300, 300]), ([-580, 580], [32_568, 200])] {
            let mut watch = watch();
            let wants =
                [Follow; 5].into_iter().chain([Implausible, Implausible, Elsewhere, Follow]);
            for (number, want) in (0..).zip(wants) {
                let (first, ticks) =
                    if number < 5 { (start, number) } else { ([20; 2], number - 5) };
                let now = at(143 * number as u64);
                watch.commanded(driven, now);
                let speeds = driven.map(i32::from);
                let counts = [0, 1].map(|wheel| {
                    let turned: i32 = speeds[wheel] * ticks / 7;
                    (first[wheel] + turned).rem_euclid(32_768) as u16
                });
                let are = watch.step(counts, speeds, false, now);
                assert_eq!(are, want, "{driven:?} {number}");
            }
        }
    }

    #[test]
    fn a_step_of_half_again_the_known_speed_and_0_06_m_follows_and_a_longer_one_is_implausible() {
        // 674 counts/s for two ticks, and 135 counts.
        for (step, want) in [(400, Follow), (450, Implausible)] {
            let mut watch = watch();
            for tick in 0..5 {
                watch.commanded([674; 2], at(143 * tick));
                watch.at(143 * tick, [96 * tick as u16; 2]);
            }
            assert_eq!(watch.at(715, [384 + step; 2]), want, "{step}");
        }
    }

    #[test]
    fn wheels_that_still_follow_the_command_before_a_stop_are_plausible() {
        let mut watch = watch();
        watch.at(0, [0, 0]);
        for (ms, told) in [(0, 674), (50, 0), (100, 0)] {
            watch.commanded([told; 2], at(ms));
        }
        assert_eq!(watch.at(143, [200, 200]), Follow);
    }

    #[test]
    fn wheels_that_follow_their_commands_are_plausible_also_backwards_and_bunched() {
        let (mut watch, mut count) = (watch(), 20_000);
        // Wheels count the wrong way, start and stop, and every third frame comes with the next.
        for number in 0..60 {
            let speed = if number / 10 % 2 == 1 { 1100 } else { 0 };
            watch.commanded([speed; 2], at(143 * number));
            let late = if number % 3 == 0 { 142 } else { 0 };
            count -= if number % 10 == 0 { 79 } else { i32::from(speed) / 7 };
            let are = watch.at(143 * number + late, [count.rem_euclid(32_768) as u16; 2]);
            assert_eq!(are, Follow, "{number}");
        }
    }
}
