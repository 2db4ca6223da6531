//! Decision whether the robot may move.
//!
//! [`Monitor`]s observe the link and report which causes apply. Each cause has a row in [`TABLE`]
//! with its action and clearing condition. The link takes the worst action that applies.
//!
//! A new cause needs a variant of [`Cause`], a row, and a monitor: a file in `failsafe/` and a line
//! in `monitors!`.

pub mod base_response;
pub mod battery;
pub mod commander;
mod contact;
mod echoes;
mod hearing;
pub mod latency_monitor;
pub(crate) mod modelled_wheels;
pub mod monitor;
mod motion_bank;
pub mod odometry;
pub mod orders;
pub mod presence;
pub mod range;
mod range_motion;
mod repeats;
mod response_fit;
pub mod restart;
mod scan_motion;
pub mod staleness;
pub mod stop_distance;
pub mod stop_monitor;
pub mod streams;
pub mod touch;
pub(crate) mod wheel_shares;

use std::{collections::VecDeque, time::Duration};

use common::{
    mission::Mission,
    samples::{Action, Cause, DoubtsSample},
};

use self::monitor::{Clears, Moment, Monitor, Observation};

macro_rules! monitors {
    ($($name:ident: $monitor:ty,)*) => {
        #[derive(Clone, Debug)]
        pub(crate) struct Failsafe {
            $(pub(crate) $name: $monitor,)*
            applied: [bool; TABLE.len()],
        }

        impl Failsafe {
            pub(crate) fn new(mission: &Mission) -> Self {
                Self { $($name: <$monitor>::new(mission),)* applied: [false; TABLE.len()] }
            }

            pub(crate) fn observe(&mut self, what: &Observation<'_>, now: Moment) {
                $(self.$name.observe(what, now);)*
                if matches!(what, Observation::Resumed) {
                    for (applied, rule) in self.applied.iter_mut().zip(TABLE) {
                        *applied &= !matches!(rule.clears, Clears::OnResume { .. });
                    }
                }
            }

            pub(crate) fn doubts(&self) -> DoubtsSample {
                let mut doubts = DoubtsSample::default();
                $(self.$name.doubt(&mut doubts);)*
                doubts
            }
        }
    };
}

monitors! {
    battery: battery::Batteries,
    base: base_response::BaseResponse,
    commander: commander::OtherCommander,
    latency: latency_monitor::LatencyMonitor,
    odometry: odometry::Odometry,
    orders: orders::Orders,
    presence: presence::Presence,
    range: range::Range,
    staleness: staleness::Staleness,
    stop: stop_monitor::StopMonitor,
    streams: streams::Streams,
    touch: touch::Touches,
}

#[derive(Debug)]
pub struct Rule {
    pub cause: Cause,
    pub when: &'static str,
    pub action: Action,
    pub clears: Clears,
    /// Longest time from the fault until the link commands a stop or the last command expires,
    /// seconds.
    ///
    /// It counts from the operator's stop if the robot ignores that. None if unbounded, or if an
    /// operator or another commander acts.
    known_within_s: Option<fn(&Mission) -> f64>,
    monitor: fn(&Failsafe) -> &dyn Monitor,
}

/// Command limit: without frames there are no ticks, and without ticks no commands.
const LIMIT: Option<fn(&Mission) -> f64> = Some(|mission| mission.robot.command_limit_s);

macro_rules! rules {
    ($($cause:ident, $action:ident, $monitor:ident, $clears:expr, $known_within_s:expr, $when:literal;)*) => {
        /// All rules, worst action first. Of rules with equal action, the first that applies is
        /// reported.
        pub const TABLE: &[Rule] = {
            use self::monitor::Clears::{After, OnNewMission, OnResume, WithCondition};
            &[$(Rule {
                cause: Cause::$cause,
                when: $when,
                action: Action::$action,
                clears: $clears,
                known_within_s: $known_within_s,
                monitor: |all| &all.$monitor,
            }),*]
        };
    };
}

rules! {
    MissionOver, End, orders, WithCondition, None,
        "the supervisor ends the mission";
    BatteryEmpty, End, battery, OnNewMission, Some(|_| battery::EMPTY_AFTER.as_secs_f64()),
        "the boards' or the motors' battery has been below 10/11 of its `robot.low_battery_v` for 2 s";
    OdometryGivenUp, End, odometry, OnNewMission, None,
        "commands and encoders have disagreed for 10 s; `link.log` describes it";
    AnotherCommander, Stop, commander, WithCondition, None,
        "one of three signs; `link.log` says which. Another node has published motion on `robot.ros2.cmd_vel` within 1 s, or rest for 2 s. The robot has acknowledged 6 commands within 2 s that the link did not send. An X80 has acknowledged all commands for 4 s while a fifth of its motor frames went elsewhere. The link commands a stop after each command of the other";
    RobotDoesNotStop, Stop, stop, After(Duration::from_millis(500)), Some(stop_monitor::known_within_s),
        "after a commanded stop, the encoders still report motion 0.5 s beyond the stopping time by `robot.response` (X80: 0.6 s); the link tries the robot's other stop methods in turn";
    OperatorStop, Stop, orders, WithCondition, None,
        "`firsthand stop`, until `firsthand resume`";
    StageHeld, Stop, orders, WithCondition, None,
        "a stage failed repeatedly, until `firsthand stage restart NAME`";
    NotOrdered, Stop, orders, WithCondition, None,
        "the supervisor has not ordered driving: the stages are starting, or the robot waits for a target";
    SupervisorSilent, Stop, orders, WithCondition, Some(|_| orders::SUPERVISOR_SILENT.as_secs_f64()),
        "the supervisor, which publishes five times a second, has been silent for 2 s";
    RobotLost, Stop, presence, WithCondition, LIMIT,
        "the robot has been silent for three times `robot.command_limit_s`, or the wire is down";
    RobotLate, Stop, latency, WithCondition, None,
        "the robot has just answered again, or it acknowledges messages later than `robot.command_limit_s`. Every 2 s the link pauses for that time plus 0.4 s to test whether the delay lasts";
    FramesSilent, Stop, streams, WithCondition, LIMIT,
        "the robot answers, but has sent no motor frame for three times `robot.command_limit_s`; the link requests them";
    FramesSlow, Stop, streams, WithCondition, Some(|mission| mission.robot.command_limit_s * (streams::INTERVALS - streams::SHORT_ONES) as f64),
        "motor frames come less often than every `robot.command_limit_s`, the lifetime of a command; let the robot send faster, or raise the limit";
    OdometryImplausible, Stop, odometry, OnResume { or_after: Some(odometry::CALM) }, Some(|mission| mission.trusted_response().dead_time_s() + odometry::STILL_AFTER_S),
        "one of three signs; `link.log` says which. The encoders show less than a quarter of 0.55 s of commanded motion, due by `robot.response`. They show 1 s of motion that was not commanded, and no other response explains it. The counts make 3 jumps within 2 s. A restart of the robot also ends the first two";
    WheelsHeld, Stop, odometry, WithCondition, Some(|mission| mission.trusted_response().dead_time_s() + contact::HELD_AFTER_S),
        "the encoders show less than a quarter of 0.4 s of commanded motion, at a motor current of `robot.held_current_ad` or more. The robot stands for 0.5 s, `contact` gives the place of contact, and the supervisor treats it as a stall";
    Felt, Stop, touch, WithCondition, None,
        "a bumper of `robot.touch` is pressed, or a cliff sensor sees no floor; `link.log` names the row. The robot stands for 0.5 s, or for its stopping time by `robot.response`. Then `contact` gives the place, and the robot goes no nearer while the contact lasts";
    RangeSilent, Stop, streams, WithCondition, Some(|mission| mission.robot.silent_after_s()),
        "a sensor that the mission uses has given no valid reading for three times `robot.command_limit_s`; `link.log` names it. A single infrared ranger may only slow the robot. \"Nothing in range\" is a valid reading";
    RangeImplausible, Stop, range, OnResume { or_after: Some(range::CHANGES) }, Some(range::known_within_s),
        "one of five signs; `link.log` names the sensor. The front sonar stays within 1 cm to either side while the robot drives 0.4 m or turns by 90 degrees. Another sensor does so while the robot turns by 90 degrees on the spot. For a band of 7 cm, 1.8 times that motion is needed. Most readings do not follow from those before. Readings or scans are consistent only if they are late, if scans have another scale, or if the robot rolls another distance than its wheels count. More than 4 times in a row, the front sonar hears nothing of a surface nearer than 0.45 m that the two infrared rangers beside it see within 12 degrees of square. No sensor reads anything while readings at the end of the infrared rangers' scale are due";
    CommandStale, Stop, staleness, WithCondition, LIMIT,
        "the newest command's tick began more than `robot.command_limit_s` ago, or no command exists";
    PoseStale, Stop, staleness, WithCondition, LIMIT,
        "the command or its guidance was computed from a pose older than `robot.command_limit_s`";
    GuidanceStale, Stop, staleness, WithCondition, LIMIT,
        "the command follows guidance older than `robot.command_limit_s`";
    RangeDoubtful, Slow, range, After(range::CHANGES), None,
        "half to two thirds of the evidence that makes a ranging sensor implausible, or no sensor reads anything over a drive as long as their reach; `link.log` names the sensor. Slow driving shows whether the sensor is faulty";
    InfraredSilent, Slow, streams, WithCondition, None,
        "one infrared ranger has given no valid reading for three times `robot.command_limit_s`; `link.log` names it. It looks to the side or back, or into the cone of a sonar that the mission uses";
    BaseSlow, Slow, base, WithCondition, None,
        "the wheels show that the base answers later or accelerates more slowly than `robot.response` states; `link.log` gives the values. The robot goes slowly until planner and controller use the measured response. With the paper's method or an external planner, it goes slowly to the end of the mission";
    BatteryLow, Slow, battery, WithCondition, None,
        "the boards' or the motors' battery falls below its `robot.low_battery_v`, until it exceeds that by 0.3 V";
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Decision {
    pub action: Action,
    pub cause: Cause,
}

impl Decision {
    pub const GO: Self = Self { action: Action::Go, cause: Cause::None };

    pub fn stops(self) -> bool {
        self.action >= Action::Stop
    }

    fn of(applying: [Option<bool>; TABLE.len()]) -> Self {
        let rules = TABLE.iter().zip(applying);
        Self::worst(rules.filter_map(|(rule, applies)| applies?.then_some(rule)))
    }

    fn worst<'a>(applying: impl IntoIterator<Item = &'a Rule>) -> Self {
        let mut worst = Self::GO;
        for &Rule { action, cause, .. } in applying {
            if action > worst.action {
                worst = Self { action, cause };
            }
        }
        assert_eq!(worst.action == Action::Go, worst.cause == Cause::None);
        worst
    }
}

/// Keeps at most so many values of the last `for_s` seconds, oldest first.
fn keep<T>(kept: &mut VecDeque<(f64, T)>, new: (f64, T), for_s: f64, most: usize) {
    let now = new.0;
    kept.push_back(new);
    while kept.len() > most || kept.front().is_some_and(|(at, _)| now - at > for_s) {
        kept.pop_front();
    }
}

pub fn rule(cause: Cause) -> Option<&'static Rule> {
    TABLE.iter().find(|rule| rule.cause == cause)
}

impl Failsafe {
    /// Decides what to do now. Monitors of frames are skipped in lockstep and while the robot is
    /// silent.
    pub(crate) fn decide(&mut self, lockstep: bool, now: Moment) -> Decision {
        let applying = self.applying(lockstep, now);
        for (applied, applies) in self.applied.iter_mut().zip(applying) {
            *applied = applies.unwrap_or(*applied);
        }
        Decision::of(applying)
    }

    pub(crate) fn foresee(&self, lockstep: bool, then: Moment) -> Decision {
        Decision::of(self.applying(lockstep, then))
    }

    /// Returns None where the monitor is skipped.
    fn applying(&self, lockstep: bool, now: Moment) -> [Option<bool>; TABLE.len()] {
        let judges_frames = !lockstep && self.presence.connected;
        std::array::from_fn(|row| {
            let rule = &TABLE[row];
            let monitor = (rule.monitor)(self);
            let is_asked = judges_frames || !monitor.judges_frames();
            let applies =
                || rule.clears.applies(self.applied[row], monitor.condition(rule.cause, now));
            is_asked.then(applies)
        })
    }

    pub(crate) fn applied(&self, cause: Cause) -> bool {
        let mut rules = TABLE.iter().zip(self.applied);
        rules.any(|(rule, applied)| rule.cause == cause && applied)
    }

    pub(crate) fn explain(&self, cause: Cause, now: Moment) -> Option<String> {
        (rule(cause)?.monitor)(self).explain(cause, now)
    }
}

#[cfg(test)]
mod tests;
