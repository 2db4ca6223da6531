//! The paper's rule: a robot that should move and does not has a planner to blame. Pure.
//!
//! Rungs, in order: plan anew from the same belief; forget what was sensed and plan anew; give up.
//!
//! | cause | seen as | first rung |
//! |---|---|---|
//! | still | it neither drives nor turns | plan anew |
//! | pinned | it drives or turns, and stays where it is | plan anew |
//! | buried | it stands in hazard, and has driven far without coming out | forget |
//! | cut off | it stands where no way leads to the target, and has looked around | forget |

use std::{f64::consts::TAU, time::Duration};

use common::{
    clock::MissionTime,
    mission::{Method, Mission},
    samples::{GuidanceSample, GuidanceStatus, PoseSample, StallCause},
};
use glam::DVec2;

pub(crate) mod record;

/// Mission time without motion that is a stall: longer than the slowest turn on the spot takes to begin.
const STALLED_AFTER: Duration = Duration::from_secs(3);
/// Mission time without a way to the target that is no passing false echo.
const CUT_OFF_AFTER: Duration = Duration::from_secs(1);
/// A careful robot that is cut off turns so often on the spot first, at half the speed it is told to.
const LOOKS_AROUND: f64 = 1.2;
/// A robot that gets on turns no more often than so at one place, at the slower of its two rates.
const TURNS_AT_A_PLACE: f64 = 2.0;
/// Farther than this is another place, metres; likewise less for a robot that is to drive slower than that.
const PLACE_M: f64 = 0.2;
/// Where a robot circles what it should stand on, another place begins beyond this many of its circles.
const CIRCLES: f64 = 1.2;
/// Less than this is standing still, metres; less still for a robot that is to drive slower than that.
const MOVED_M: f64 = 0.02;
/// Less than this is not turning either, radians; likewise.
const TURNED_RAD: f64 = 0.1;
/// The share of what full speed would give that counts as motion: near its target a robot crawls.
const SHARE: f64 = 0.05;
/// A way so long leads out of any margin: several of them on top of each other, metres.
const WAY_OUT_M: f64 = 1.0;
/// Fresh planners tried before the belief is blamed.
const MOST_REPLANS: u32 = 2;
/// Beliefs forgotten before the target is called unreachable.
const MOST_RESETS: u64 = 3;

/// A robot that does not get on: how, and what to do about it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Stall {
    /// How it was seen.
    pub(crate) cause: StallCause,
    /// What to do.
    pub(crate) rung: Rung,
}

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
    /// End the mission: the target is unreachable.
    GiveUp,
}

/// Watches one mission.
#[derive(Debug)]
pub(crate) struct StallWatch {
    moved_m: f64,
    turned_rad: f64,
    place_m: f64,
    pinned_after: Duration,
    cut_off_after: Duration,
    anchor: Option<Anchor>,
    place: Option<Place>,
    cut_off_since: Option<MissionTime>,
    /// What it had travelled when it was first seen in hazard, metres.
    buried_since: Option<f64>,
    /// Fresh planners at this place, with this belief.
    replans_here: u32,
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

/// Where the robot has been for a while.
#[derive(Clone, Copy, Debug)]
struct Place {
    since: MissionTime,
    middle: DVec2,
    /// The nearest it has been to the target there, metres.
    nearest_m: f64,
}

impl StallWatch {
    /// For the robot of a mission.
    pub(crate) fn new(mission: &Mission) -> Self {
        let seconds = STALLED_AFTER.as_secs_f64();
        let controller = &mission.controller;
        let slowest_turn = TAU / controller.turn_rad_s.min(controller.look_rad_s);
        let at_a_place = TURNS_AT_A_PLACE * slowest_turn;
        Self {
            moved_m: MOVED_M.min(controller.speed_m_s * seconds * SHARE),
            turned_rad: TURNED_RAD.min(controller.turn_rad_s * seconds * SHARE),
            place_m: match mission.method {
                Method::Careful => PLACE_M.min(controller.speed_m_s * at_a_place * SHARE),
                // It turns as it drives.
                Method::Paper => CIRCLES * 2.0 * controller.speed_m_s / controller.turn_rad_s,
            },
            pinned_after: STALLED_AFTER + Duration::from_secs_f64(at_a_place),
            cut_off_after: match mission.method {
                Method::Careful => {
                    let turn = LOOKS_AROUND * TAU / controller.look_rad_s;
                    CUT_OFF_AFTER + Duration::from_secs_f64(2.0 * turn)
                }
                Method::Paper => CUT_OFF_AFTER,
            },
            anchor: None,
            place: None,
            cut_off_since: None,
            buried_since: None,
            replans_here: 0,
            replans: 0,
            epoch: 0,
        }
    }

    /// The belief's current epoch.
    pub(crate) const fn epoch(&self) -> u64 {
        self.epoch
    }

    /// Fresh planners so far in this mission.
    pub(crate) const fn replans(&self) -> u32 {
        self.replans
    }

    /// Beliefs forgotten so far in this mission.
    pub(crate) const fn resets(&self) -> u64 {
        self.epoch
    }

    /// Look at a tick of a robot that is ordered to drive. `held` says that something else holds it: the
    /// link's failsafe, a stage that is down.
    pub(crate) fn step(
        &mut self,
        pose: &PoseSample,
        guidance: &GuidanceSample,
        held: bool,
    ) -> Option<Stall> {
        // The belief outlives its supervisor.
        self.epoch = self.epoch.max(guidance.epoch);
        if held {
            (self.anchor, self.place) = (None, None);
            return None;
        }
        let cause = self
            .without_ground(pose, guidance)
            .or_else(|| self.without_motion(pose, guidance))?;
        let rung = match cause {
            StallCause::Still | StallCause::Pinned if self.replans_here < MOST_REPLANS => {
                self.replans_here += 1;
                self.replans += 1;
                Rung::Replan
            }
            _ if self.epoch < MOST_RESETS => {
                self.epoch += 1;
                self.replans_here = 0;
                Rung::Forget { epoch: self.epoch }
            }
            _ => Rung::GiveUp,
        };
        // What is tried gets the time that the robot had.
        let now = pose.stamp.time();
        if let (Some(anchor), Some(place)) = (&mut self.anchor, &mut self.place) {
            (anchor.time, place.since) = (now, now);
        }
        (self.cut_off_since, self.buried_since) = (None, None);
        Some(Stall { cause, rung })
    }

    /// Whether u = 0 where the robot stands, by this very belief, for longer than a robot needs to get away.
    fn without_ground(
        &mut self,
        pose: &PoseSample,
        guidance: &GuidanceSample,
    ) -> Option<StallCause> {
        let (now, travelled) = (pose.stamp.time(), pose.travelled_m);
        let status = GuidanceStatus::from_byte(guidance.status);
        let is = |what| status == what && guidance.epoch == self.epoch;
        if !is(GuidanceStatus::Unreachable) {
            self.cut_off_since = None;
        } else if now.since(*self.cut_off_since.get_or_insert(now)) >= self.cut_off_after {
            return Some(StallCause::CutOff);
        }
        if !is(GuidanceStatus::WayOut) {
            self.buried_since = None;
        } else if travelled - *self.buried_since.get_or_insert(travelled) >= WAY_OUT_M {
            return Some(StallCause::Buried);
        }
        None
    }

    /// Whether the robot has neither moved nor turned for long, or both for longer and to no avail.
    fn without_motion(
        &mut self,
        pose: &PoseSample,
        guidance: &GuidanceSample,
    ) -> Option<StallCause> {
        let now = pose.stamp.time();
        let here = Anchor {
            time: now,
            travelled: pose.travelled_m,
            heading: pose.heading_rad,
        };
        let anchor = *self.anchor.get_or_insert(here);
        if (here.travelled - anchor.travelled).abs() >= self.moved_m
            || (here.heading - anchor.heading).abs() >= self.turned_rad
        {
            self.anchor = Some(here);
        }
        let arrived = Place {
            since: now,
            middle: pose.pose().position,
            nearest_m: guidance.distance_m,
        };
        let place = *self.place.get_or_insert(arrived);
        if arrived.middle.distance(place.middle) >= self.place_m {
            self.place = Some(arrived);
            self.replans_here = 0;
        } else if arrived.nearest_m <= place.nearest_m - self.moved_m {
            // One that crawls to its target gets on, too.
            self.place = Some(Place {
                middle: place.middle,
                ..arrived
            });
        }
        // It looks around first, and that has a time of its own.
        if GuidanceStatus::from_byte(guidance.status) == GuidanceStatus::Unreachable {
            return None;
        }
        let since = |then: Option<MissionTime>| then.map_or(Duration::ZERO, |then| now.since(then));
        let still = since(self.anchor.map(|anchor| anchor.time)) >= STALLED_AFTER;
        let pinned = since(self.place.map(|place| place.since)) >= self.pinned_after;
        match (still, pinned) {
            (true, _) => Some(StallCause::Still),
            (_, true) => Some(StallCause::Pinned),
            _ => None,
        }
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
        for tick in (0..100).map(f64::from) {
            let driving = PoseSample {
                x_m: tick * 0.05,
                ..pose(tick, tick * 0.05)
            };
            assert_eq!(
                watch.step(&driving, &guidance(GuidanceStatus::Along, 0), false),
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
        let want = [Rung::Replan, Rung::Replan, Rung::Forget { epoch: 1 }];
        let cause = StallCause::Still;
        assert_eq!(rungs, want.map(|rung| Stall { cause, rung }));
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
            if matches!(rungs.last(), Some(stall) if stall.rung == Rung::GiveUp) {
                break;
            }
        }
        let [first, second, third, last] = rungs[..] else {
            panic!("{rungs:?}");
        };
        let cause = StallCause::CutOff;
        let epochs = [1, 2, 3].map(|epoch| Rung::Forget { epoch });
        let forgets = epochs.map(|rung| Stall { cause, rung });
        assert_eq!([first, second, third], forgets);
        let rung = Rung::GiveUp;
        assert_eq!(last, Stall { cause, rung });
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
        for tick in 0..75 {
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
        let rung = Rung::Forget { epoch: 1 };
        assert_eq!(reset.map(|stall| stall.rung), Some(rung));
        assert_eq!(watch.step(&pose(2.5, 0.1), &old, false), None);
    }

    /// Rocks to and fro at one place, so long as `seconds` go.
    fn rock(watch: &mut StallWatch, seconds: std::ops::Range<u32>) -> Vec<Stall> {
        let along = guidance(GuidanceStatus::Along, 0);
        let rocking = seconds.filter_map(|second| {
            let seconds = f64::from(second);
            let rocking = PoseSample {
                x_m: 0.05 * seconds.sin(),
                heading_rad: seconds,
                ..pose(seconds, 0.05 * seconds)
            };
            watch.step(&rocking, &along, false)
        });
        rocking.collect()
    }

    #[test]
    fn a_robot_that_moves_and_stays_where_it_is_gets_a_fresh_planner_twice_then_a_fresh_belief() {
        let want = [Rung::Replan, Rung::Replan, Rung::Forget { epoch: 1 }];
        let cause = StallCause::Pinned;
        let stalls = rock(&mut watch(), 0..60);
        assert_eq!(stalls, want.map(|rung| Stall { cause, rung }));
    }

    #[test]
    fn a_robot_that_circles_what_it_should_stand_on_is_pinned_and_one_that_crawls_to_it_is_not() {
        let path = std::path::Path::new("test.toml");
        let mission = Mission::parse("target = [3, 0]\nmethod = 'paper'", path).unwrap();
        let (speed, turn) = (mission.controller.speed_m_s, mission.controller.turn_rad_s);
        let radius = speed / turn;
        let mut circling = StallWatch::new(&mission);
        let mut crawling = StallWatch::new(&mission);
        let mut seen = [None; 2];
        for second in (0..40).map(f64::from) {
            let heading = turn * second;
            let circle = PoseSample {
                x_m: radius * heading.sin(),
                y_m: -radius * heading.cos(),
                heading_rad: heading,
                ..pose(second, speed * second)
            };
            let crawl = PoseSample {
                x_m: 0.01 * second,
                ..pose(second, 0.01 * second)
            };
            let near = |distance_m| GuidanceSample {
                distance_m,
                ..guidance(GuidanceStatus::Along, 0)
            };
            let stalls = [
                circling.step(&circle, &near(3.0 - circle.x_m), false),
                crawling.step(&crawl, &near(0.5 - crawl.x_m), false),
            ];
            for (first, stall) in seen.iter_mut().zip(stalls) {
                *first = first.or(stall.map(|stall| stall.cause));
            }
        }
        assert_eq!(seen, [Some(StallCause::Pinned), None]);
    }

    #[test]
    fn a_place_that_was_left_is_forgiven() {
        let mut watch = watch();
        assert_eq!(rock(&mut watch, 0..40).len(), 2);
        let elsewhere = PoseSample {
            x_m: 1.0,
            ..pose(40.0, 3.0)
        };
        watch.step(&elsewhere, &guidance(GuidanceStatus::Along, 0), false);
        let rungs: Vec<_> = rock(&mut watch, 41..85)
            .iter()
            .map(|stall| stall.rung)
            .collect();
        assert_eq!(rungs, [Rung::Replan, Rung::Replan]);
        assert_eq!(watch.replans(), 4);
    }

    #[test]
    fn a_robot_that_drives_far_in_hazard_forgets_and_one_that_gets_out_does_not() {
        let way_out = guidance(GuidanceStatus::WayOut, 0);
        let drive = |watch: &mut StallWatch, metres: std::ops::Range<u32>| {
            let mut driving = metres.map(|tenths| PoseSample {
                x_m: f64::from(tenths) * 0.1,
                ..pose(f64::from(tenths), f64::from(tenths) * 0.1)
            });
            driving.find_map(|pose| watch.step(&pose, &way_out, false))
        };
        let rung = Rung::Forget { epoch: 1 };
        let cause = StallCause::Buried;
        assert_eq!(drive(&mut watch(), 0..12), Some(Stall { cause, rung }));
        let mut watch = watch();
        assert_eq!(drive(&mut watch, 0..8), None);
        let out = PoseSample {
            x_m: 0.8,
            ..pose(8.0, 0.8)
        };
        watch.step(&out, &guidance(GuidanceStatus::Along, 0), false);
        assert_eq!(drive(&mut watch, 9..17), None);
    }
}
