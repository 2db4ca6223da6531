//! The paper's rule: a robot that should move and does not has a planner to blame. Pure.
//!
//! Rungs, in order: plan anew from the same belief; forget what was sensed and plan anew; give up.

use std::{f64::consts::TAU, time::Duration};

use common::{
    clock::MissionTime,
    mission::{Method, Mission},
    samples::{GuidanceSample, GuidanceStatus, PoseSample},
};

/// Mission time without motion that is a stall: longer than the slowest turn on the spot takes to begin.
const STALLED_AFTER: Duration = Duration::from_secs(3);
/// Mission time without a way to the target that is no passing false echo.
const CUT_OFF_AFTER: Duration = Duration::from_secs(1);
/// A careful robot that is cut off turns so often on the spot first, at half the speed it is told to.
const LOOKS_AROUND: f64 = 1.2;
/// Less than this is standing still, metres; less still for a robot that is to drive slower than that.
const MOVED_M: f64 = 0.02;
/// Less than this is not turning either, radians; likewise.
const TURNED_RAD: f64 = 0.1;
/// The share of what full speed would give that counts as motion: near its target a robot crawls.
const SHARE: f64 = 0.05;
/// Fresh planners tried before the belief is blamed.
const MOST_REPLANS: u32 = 2;
/// Beliefs forgotten before the target is called unreachable.
const MOST_RESETS: u64 = 3;

/// What to do about a stall.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Rung {
    /// Restart the planner: a full solve of the same belief.
    Replan,
    /// Forget what was sensed: this is the epoch to begin.
    Forget {
        /// The new epoch.
        epoch: u64,
    },
    /// End the mission.
    GiveUp {
        /// What to say.
        reason: &'static str,
    },
}

/// Watches one mission.
#[derive(Debug)]
pub(crate) struct StallWatch {
    moved_m: f64,
    turned_rad: f64,
    cut_off_after: Duration,
    anchor: Option<Anchor>,
    cut_off_since: Option<MissionTime>,
    replans: u32,
    epoch: u64,
}

/// Where the robot last was seen to move.
#[derive(Clone, Copy, Debug)]
struct Anchor {
    time: MissionTime,
    travelled: f64,
    heading: f64,
}

impl StallWatch {
    /// For the robot of a mission.
    pub(crate) fn new(mission: &Mission) -> Self {
        let seconds = STALLED_AFTER.as_secs_f64();
        Self {
            moved_m: MOVED_M.min(mission.controller.speed_m_s * seconds * SHARE),
            turned_rad: TURNED_RAD.min(mission.controller.turn_rad_s * seconds * SHARE),
            cut_off_after: match mission.method {
                Method::Careful => {
                    let turn = LOOKS_AROUND * TAU / mission.controller.look_rad_s;
                    CUT_OFF_AFTER + Duration::from_secs_f64(2.0 * turn)
                }
                Method::Paper => CUT_OFF_AFTER,
            },
            anchor: None,
            cut_off_since: None,
            replans: 0,
            epoch: 0,
        }
    }

    /// The belief's current epoch.
    pub(crate) const fn epoch(&self) -> u64 {
        self.epoch
    }

    /// Look at a tick of a robot that is ordered to drive. `held` says that something else holds it: the
    /// link's failsafe, a stage that is down.
    pub(crate) fn step(
        &mut self,
        pose: &PoseSample,
        guidance: &GuidanceSample,
        held: bool,
    ) -> Option<Rung> {
        let now = pose.stamp.time();
        // The belief outlives its supervisor.
        self.epoch = self.epoch.max(guidance.epoch);
        if held {
            self.anchor = None;
            return None;
        }
        let cut_off = GuidanceStatus::from_byte(guidance.status) == GuidanceStatus::Unreachable;
        if !(cut_off && guidance.epoch == self.epoch) {
            self.cut_off_since = None;
        } else if now.since(*self.cut_off_since.get_or_insert(now)) >= self.cut_off_after {
            return Some(self.forget(
                now,
                "the belief isolates the robot from the target, again and again",
            ));
        }
        let here = Anchor {
            time: now,
            travelled: pose.travelled_m,
            heading: pose.heading_rad,
        };
        let anchor = *self.anchor.get_or_insert(here);
        let moved = (here.travelled - anchor.travelled).abs() >= self.moved_m;
        if moved || (here.heading - anchor.heading).abs() >= self.turned_rad {
            self.anchor = Some(here);
            if moved {
                self.replans = 0;
            }
            return None;
        }
        if cut_off || now.since(anchor.time) < STALLED_AFTER {
            return None;
        }
        self.anchor = Some(here);
        if self.replans < MOST_REPLANS {
            self.replans += 1;
            return Some(Rung::Replan);
        }
        self.replans = 0;
        Some(self.forget(now, "the robot stalls whatever is planned"))
    }

    fn forget(&mut self, now: MissionTime, reason: &'static str) -> Rung {
        if self.epoch >= MOST_RESETS {
            return Rung::GiveUp { reason };
        }
        self.epoch += 1;
        self.cut_off_since = None;
        if let Some(anchor) = &mut self.anchor {
            anchor.time = now;
        }
        Rung::Forget { epoch: self.epoch }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use common::samples::Stamp;

    fn watch() -> StallWatch {
        let path = std::path::Path::new("test.toml");
        StallWatch::new(&Mission::parse("target = [3, 0]\nmethod = 'paper'", path).unwrap())
    }

    fn pose(seconds: f64, travelled_m: f64) -> PoseSample {
        PoseSample {
            stamp: Stamp {
                stamp_ns: MissionTime::from_seconds(seconds).0,
                ..Stamp::default()
            },
            travelled_m,
            ..PoseSample::default()
        }
    }

    fn guidance(status: GuidanceStatus, epoch: u64) -> GuidanceSample {
        GuidanceSample {
            status: status.into(),
            epoch,
            ..GuidanceSample::default()
        }
    }

    #[test]
    fn a_robot_that_moves_is_left_alone() {
        let mut watch = watch();
        for tick in 0..100 {
            let pose = pose(f64::from(tick), f64::from(tick) * 0.03);
            assert_eq!(
                watch.step(&pose, &guidance(GuidanceStatus::Along, 0), false),
                None
            );
        }
    }

    #[test]
    fn a_stalled_robot_gets_a_fresh_planner_twice_then_a_fresh_belief() {
        let mut watch = watch();
        let along = guidance(GuidanceStatus::Along, 0);
        let rungs: Vec<_> = (0..=10)
            .filter_map(|second| watch.step(&pose(f64::from(second), 0.0), &along, false))
            .collect();
        assert_eq!(
            rungs,
            [Rung::Replan, Rung::Replan, Rung::Forget { epoch: 1 }]
        );
    }

    #[test]
    fn a_robot_held_by_something_else_is_not_stalled() {
        let mut watch = watch();
        let along = guidance(GuidanceStatus::Along, 0);
        for second in 0..20 {
            assert_eq!(
                watch.step(&pose(f64::from(second), 0.0), &along, true),
                None
            );
        }
    }

    #[test]
    fn a_robot_cut_off_forgets_three_times_and_gives_up() {
        let mut watch = watch();
        let mut rungs = Vec::new();
        for tick in 0..100 {
            let cut_off = guidance(GuidanceStatus::Unreachable, watch.epoch());
            rungs.extend(watch.step(
                &pose(f64::from(tick) * 0.5, f64::from(tick)),
                &cut_off,
                false,
            ));
            if matches!(rungs.last(), Some(Rung::GiveUp { .. })) {
                break;
            }
        }
        let [first, second, third, last] = rungs[..] else {
            panic!("{rungs:?}");
        };
        let epochs = [1, 2, 3].map(|epoch| Rung::Forget { epoch });
        assert_eq!([first, second, third], epochs);
        assert!(matches!(last, Rung::GiveUp { .. }));
    }

    #[test]
    fn a_careful_robot_cut_off_looks_around_before_its_belief_is_blamed() {
        let path = std::path::Path::new("test.toml");
        let mission = Mission::parse("target = [3, 0]", path).unwrap();
        let mut watch = StallWatch::new(&mission);
        let cut_off = guidance(GuidanceStatus::Unreachable, 0);
        let turning = |second: f64| PoseSample {
            heading_rad: second,
            ..pose(second, 0.0)
        };
        let turn = TAU / mission.controller.look_rad_s;
        let first = (0..100)
            .map(f64::from)
            .find(|&second| watch.step(&turning(second), &cut_off, false).is_some());
        assert!(first > Some(turn) && first < Some(5.0 * turn), "{first:?}");
    }

    #[test]
    fn a_scan_is_no_stall() {
        let mut watch = watch();
        let look = guidance(GuidanceStatus::Look, 0);
        for tick in 0..100 {
            let seconds = f64::from(tick) * 0.2;
            let scanning = PoseSample {
                heading_rad: seconds.sin(),
                ..pose(seconds, 0.0)
            };
            assert_eq!(watch.step(&scanning, &look, false), None);
        }
    }

    #[test]
    fn an_answer_from_before_the_reset_does_not_reset_again() {
        let mut watch = watch();
        let old = guidance(GuidanceStatus::Unreachable, 0);
        watch.step(&pose(0.0, 0.0), &old, false);
        let reset = watch.step(&pose(1.0, 0.0), &old, false);
        assert_eq!(reset, Some(Rung::Forget { epoch: 1 }));
        assert_eq!(watch.step(&pose(2.5, 0.1), &old, false), None);
    }
}
