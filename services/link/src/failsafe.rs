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
mod deafness;
pub mod latency_monitor;
mod lost_echo;
pub(crate) mod modelled_wheels;
pub mod monitor;
pub mod odometry;
pub mod orders;
pub mod presence;
pub mod range;
mod range_motion;
mod response_fit;
pub mod restart;
mod scan_motion;
pub mod staleness;
pub mod stop_distance;
pub mod stop_monitor;
pub mod streams;
pub mod touch;
mod undetected_surface;
pub(crate) mod wheel_shares;

use std::time::Duration;

use common::{
    mission::Mission,
    samples::{Action, Cause},
};

use self::monitor::{Clears, Moment, Monitor, Observation};

macro_rules! monitors {
    ($($name:ident: $monitor:ty,)*) => {
        #[derive(Clone, Debug)]
        pub(crate) struct Monitors {
            $(pub(crate) $name: $monitor,)*
        }

        impl Monitors {
            pub(crate) fn new(mission: &Mission) -> Self {
                Self { $($name: <$monitor>::new(mission),)* }
            }

            pub(crate) fn observe(&mut self, what: &Observation<'_>, now: Moment) {
                $(self.$name.observe(what, now);)*
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
    /// Condition in words, for the documentation.
    pub when: &'static str,
    pub action: Action,
    pub clears: Clears,
    /// Longest time from the fault until the link commands a stop or the last command expires,
    /// seconds.
    ///
    /// It counts from the operator's stop if the robot ignores that. None if unbounded, or if an
    /// operator or another commander acts.
    known_within_s: Option<fn(&Mission) -> f64>,
    monitor: fn(&Monitors) -> &dyn Monitor,
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
        "the boards' or the motors' battery has given less than 10/11 of its `robot.low_battery_v` for 2 s";
    OdometryGivenUp, End, odometry, OnNewMission, None,
        "commands and encoders have disagreed for 10 s; `link.log` says how";
    AnotherCommander, Stop, commander, WithCondition, None,
        "another node has published on `robot.ros2.cmd_vel` within 1 s: that the robot moves, or for 2 s that it stands; or the robot has acknowledged 6 commands within 2 s that the link did not send, or an X80 for 4 s those that it did while a fifth of its motor frames went elsewhere; `link.log` says which. It is told to stand after each command of the other";
    RobotDoesNotStop, Stop, stop, After(Duration::from_millis(500)), Some(stop_monitor::known_within_s),
        "it was told to stand, and when it should rest by its `robot.response` (an X80 after 0.6 s) its encoders say for 0.5 s that it moves; its other methods are tried in turn";
    OperatorStop, Stop, orders, WithCondition, None,
        "`firsthand stop`, until `firsthand resume`";
    StageHeld, Stop, orders, WithCondition, None,
        "a stage died again and again, until `firsthand stage restart NAME`";
    NotOrdered, Stop, orders, WithCondition, None,
        "the supervisor has not said drive: the stages start, or the robot waits for a target";
    SupervisorSilent, Stop, orders, WithCondition, Some(|_| orders::SUPERVISOR_SILENT.as_secs_f64()),
        "it has said nothing for 2 s, which it does five times a second";
    RobotLost, Stop, presence, WithCondition, LIMIT,
        "it has said nothing for three times `robot.command_limit_s`, or the wire is down";
    RobotLate, Stop, latency, WithCondition, None,
        "it was lost and has just been found, or it acknowledges later than `robot.command_limit_s` what it is sent; every 2 s it is sent nothing for that time and 0.4 s, to see whether it still does";
    FramesSilent, Stop, streams, WithCondition, LIMIT,
        "it answers, and no motor frame has come for three times `robot.command_limit_s`; they are asked for";
    FramesSlow, Stop, streams, WithCondition, Some(|mission| mission.robot.command_limit_s * (streams::INTERVALS - streams::SHORT_ONES) as f64),
        "they come less often than every `robot.command_limit_s`, which commands last for: let the robot send faster, or raise it";
    OdometryImplausible, Stop, odometry, OnResume { or_after: Some(odometry::CALM) }, Some(|mission| mission.trusted_response().dead_time_s() + odometry::STILL_AFTER.as_secs_f64()),
        "0.55 s of motion that was commanded and due by `robot.response` with less than a quarter of it in the encoders, or 1 s of motion that was not commanded, and no other response explains what they say, until the robot restarts, or 3 jumps within 2 s; `link.log` says which";
    WheelsHeld, Stop, odometry, WithCondition, Some(|mission| mission.trusted_response().dead_time_s() + contact::HELD_AFTER.as_secs_f64()),
        "0.4 s of commanded motion with less than a quarter of it in the encoders, and a motor current of `robot.held_current_ad` or more; the robot stands for 0.5 s, `contact` says where it is touched, and the supervisor takes it for a stall";
    Felt, Stop, touch, WithCondition, None,
        "a bumper of `robot.touch` is pressed, or a cliff sensor sees no floor; the robot stands for 0.5 s, or as long as it needs by its `robot.response`, then `contact` says where, and it goes no nearer while that lasts; `link.log` names the row";
    RangeSilent, Stop, streams, WithCondition, Some(|mission| mission.robot.silent_after_s()),
        "a sensor that the mission uses has given no valid reading for three times `robot.command_limit_s`, and it is not a single infrared ranger without which the robot goes on; `link.log` names it. Nothing in range is a reading";
    RangeImplausible, Stop, range, OnResume { or_after: Some(range::CHANGES) }, Some(range::known_within_s),
        "the front sonar says the same within 1 cm to either side while the robot drives 0.4 m or turns by 90 degrees, another sensor while it turns by 90 degrees on the spot, or within 7 cm for 1.8 times as much; two of three readings do not follow from those before; scans, or readings of sonars and infrared rangers, change as if they were 0.3 s late or more, scans also as if the robot stood; or the front sonar hears nothing more than 4 times in a row of a surface nearer than 0.45 m that the two infrared rangers beside it see within 12 degrees of square; or no sensor reads anything while readings at the end of the infrared rangers' scale are due; `link.log` names the sensor";
    CommandStale, Stop, staleness, WithCondition, LIMIT,
        "the newest command's tick began more than `robot.command_limit_s` ago, or there is none";
    PoseStale, Stop, staleness, WithCondition, LIMIT,
        "the command or its guidance was computed from a pose older than that";
    GuidanceStale, Stop, staleness, WithCondition, LIMIT,
        "the command follows a guidance older than that";
    RangeDoubtful, Slow, range, After(range::CHANGES), None,
        "half of what makes a ranging sensor implausible, or no reading of any for as far as they reach; a robot that goes slowly shows whether it is; `link.log` names the sensor";
    InfraredSilent, Slow, streams, WithCondition, None,
        "one infrared ranger has given no valid reading for so long, and it looks aside or back, or into the cone of a sonar that the mission uses; `link.log` names it";
    BaseSlow, Slow, base, WithCondition, None,
        "its wheels have shown that it answers later or accelerates more slowly than `robot.response` says, until planner and controller go by what was found; by the paper's method and with a planner of another executable until the next mission; `link.log` says how";
    BatteryLow, Slow, battery, WithCondition, None,
        "the boards' or the motors' battery gives less than its `robot.low_battery_v`, and then less than 0.3 V more";
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Decision {
    pub action: Action,
    pub cause: Cause,
}

impl Decision {
    /// Decision while no cause applies.
    pub const GO: Self = Self { action: Action::Go, cause: Cause::None };

    /// Returns whether the link withholds all commands.
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
        worst
    }
}

/// Returns the row of a cause; none for [`Cause::None`].
pub fn rule(cause: Cause) -> Option<&'static Rule> {
    TABLE.iter().find(|rule| rule.cause == cause)
}

#[derive(Clone, Debug)]
pub(crate) struct Failsafe {
    pub(crate) monitors: Monitors,
    /// Rows of [`TABLE`] that applied at the last decision.
    applied: [bool; TABLE.len()],
}

impl Failsafe {
    pub(crate) fn new(mission: &Mission) -> Self {
        Self { monitors: Monitors::new(mission), applied: [false; TABLE.len()] }
    }

    pub(crate) fn observe(&mut self, what: &Observation<'_>, now: Moment) {
        self.monitors.observe(what, now);
        if matches!(what, Observation::Resumed) {
            for (applied, rule) in self.applied.iter_mut().zip(TABLE) {
                *applied &= !matches!(rule.clears, Clears::OnResume { .. });
            }
        }
    }

    /// Decides what to do now. Monitors of frames are skipped in lockstep and while the robot is
    /// silent.
    pub(crate) fn decide(&mut self, lockstep: bool, now: Moment) -> Decision {
        let applying = self.applying(lockstep, now);
        for (applied, applies) in self.applied.iter_mut().zip(applying) {
            *applied = applies.unwrap_or(*applied);
        }
        Decision::of(applying)
    }

    /// Returns the decision at a later time without further input.
    pub(crate) fn foresee(&self, lockstep: bool, then: Moment) -> Decision {
        Decision::of(self.applying(lockstep, then))
    }

    /// Returns which rows of [`TABLE`] apply; None where the monitor is skipped.
    fn applying(&self, lockstep: bool, now: Moment) -> [Option<bool>; TABLE.len()] {
        let judges_frames = !lockstep && self.monitors.presence.connected();
        std::array::from_fn(|row| {
            let rule = &TABLE[row];
            let monitor = (rule.monitor)(&self.monitors);
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

    /// Explains `cause` and its remedy.
    pub(crate) fn explain(&self, cause: Cause, now: Moment) -> Option<String> {
        (rule(cause)?.monitor)(&self.monitors).explain(cause, now)
    }
}

#[cfg(test)]
mod tests;
