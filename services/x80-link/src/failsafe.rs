//! Whether the robot may move: one pure function of what is known to the worst action that applies, evaluated
//! where the stop is made.
//!
//! [`TABLE`] is all there is to it. The README shows it (`firsthand failsafe`).

use std::time::Duration;

use common::samples::{Action, Cause, HoldReason, Order};

use crate::{odometry::Plausibility, streams::Motor};

/// A supervisor that has published nothing for so long watches nobody: ten times the interval of its directives,
/// so that a loaded machine does not stop the robot, and a second before systemd's watchdog would kill it.
pub const SUPERVISOR_SILENT: Duration = Duration::from_secs(2);

/// The share of its speed that a robot with a low battery goes at. Motors that draw less let the battery give
/// more; slower still, and wheels begin to stick.
pub const SLOW_SHARE: f64 = 0.5;

/// What the link knows when it decides.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Flags {
    /// The supervisor's last directive; none before the first.
    pub directive: Option<Directive>,
    /// Whether the robot answers.
    pub connected: bool,
    /// How old the newest command is; none before the first.
    pub command: Option<Ages>,
    /// The worst of the batteries that the robot drives on.
    pub battery: Charge,
    /// What the robot's frames say of it.
    pub health: HealthFlags,
}

/// What is known of a robot by its frames.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct HealthFlags {
    /// It was told to stand and moves.
    pub does_not_stop: bool,
    /// Whether its wheels turn as told.
    pub odometry: Plausibility,
    /// How its motor frames come.
    pub motor: Motor,
    /// What it sends is old, or may be: that is being found out.
    pub late: bool,
    /// A mission that senses gets no readings of the front sonar.
    pub range_silent: bool,
}

/// What the supervisor ordered last.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Directive {
    /// What it wants.
    pub order: Order,
    /// Why it does not want the robot to drive.
    pub reason: HoldReason,
    /// How long ago, by the machine's clock.
    pub age: Duration,
}

/// How old a command and what it was computed from are, in mission time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ages {
    /// Since the tick it answers began.
    pub command: Duration,
    /// Since the oldest pose it was computed from.
    pub pose: Duration,
    /// Since the guidance it follows.
    pub guidance: Duration,
}

/// What a battery still holds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Charge {
    /// Enough, or there is no such battery.
    #[default]
    Well,
    /// Little.
    Low,
    /// Nothing to drive on.
    Empty,
}

/// What to do, and why.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Decision {
    /// What.
    pub action: Action,
    /// Why.
    pub cause: Cause,
}

impl Decision {
    /// Nothing is wrong.
    pub const GO: Self = Self {
        action: Action::Go,
        cause: Cause::None,
    };

    /// Whether no command may pass.
    #[must_use]
    pub fn stops(self) -> bool {
        self.action >= Action::Stop
    }
}

/// A row of the table. What it says for people stands beside what it does.
#[derive(Debug)]
pub struct Rule {
    /// What is wrong.
    pub cause: Cause,
    /// The same in a few words.
    pub name: &'static str,
    /// When it applies, in words.
    pub when: &'static str,
    /// What is done.
    pub action: Action,
    /// When it no longer applies, in words.
    pub until: &'static str,
    /// Whether it applies; the duration is how old a command may be.
    applies: fn(&Flags, Duration) -> bool,
}

/// Every rule, the worst action first; of those with the same action the first that applies is reported.
pub static TABLE: &[Rule] = &[
    Rule {
        cause: Cause::MissionOver,
        name: "mission over",
        when: "the supervisor ends the mission",
        action: Action::End,
        until: "a mission is started",
        applies: |flags, _| ordered(flags, Order::Stop),
    },
    Rule {
        cause: Cause::BatteryEmpty,
        name: "battery empty",
        when: "the boards' or the motors' battery has given less than 10/11 of its `robot.low_battery_v` for 2 s",
        action: Action::End,
        until: "it is charged and a mission started",
        applies: |flags, _| flags.battery == Charge::Empty,
    },
    Rule {
        cause: Cause::OdometryGivenUp,
        name: "odometry implausible for long",
        when: "commands and encoders have disagreed for 10 s; `x80-link.log` says how",
        action: Action::End,
        until: "it is mended and a mission started",
        applies: |flags, _| flags.health.odometry == Plausibility::GivenUp,
    },
    Rule {
        cause: Cause::RobotDoesNotStop,
        name: "robot does not obey",
        when: "it was told to stand, and 0.6 s later its encoders say for 0.5 s that it moves",
        action: Action::Stop,
        until: "they have said for 0.5 s that it rests; till then other methods are tried in turn: disable, pulse width 0, suspend",
        applies: |flags, _| flags.health.does_not_stop,
    },
    Rule {
        cause: Cause::OperatorStop,
        name: "stopped by an operator",
        when: "`firsthand stop`",
        action: Action::Stop,
        until: "`firsthand resume`",
        applies: |flags, _| held(flags) == Some(HoldReason::Operator),
    },
    Rule {
        cause: Cause::StageHeld,
        name: "stage held",
        when: "a stage died again and again",
        action: Action::Stop,
        until: "`firsthand restart NAME`",
        applies: |flags, _| held(flags) == Some(HoldReason::StageHeld),
    },
    Rule {
        cause: Cause::NotOrdered,
        name: "no order to drive",
        when: "the supervisor has not said drive: the stages start",
        action: Action::Stop,
        until: "it does",
        applies: |flags, _| {
            let other = |reason| !matches!(reason, HoldReason::Operator | HoldReason::StageHeld);
            flags.directive.is_none() || held(flags).is_some_and(other)
        },
    },
    Rule {
        cause: Cause::SupervisorSilent,
        name: "supervisor silent",
        when: "it has said nothing for 2 s, which it does five times a second",
        action: Action::Stop,
        until: "its next word",
        applies: |flags, _| {
            let silent = |directive: Directive| directive.age > SUPERVISOR_SILENT;
            flags.directive.is_some_and(silent)
        },
    },
    Rule {
        cause: Cause::RobotLost,
        name: "robot lost",
        when: "it has said nothing for three times `robot.command_limit_s`, or the wire is down",
        action: Action::Stop,
        until: "its next frame",
        applies: |flags, _| !flags.connected,
    },
    Rule {
        cause: Cause::RobotLate,
        name: "robot late",
        when: "it was lost and has just been found, or it acknowledges later than `robot.command_limit_s` what it is sent",
        action: Action::Stop,
        until: "it is sent nothing for that time and 0.4 s, and acknowledges nothing late; tried every 2 s",
        applies: |flags, _| flags.health.late,
    },
    Rule {
        cause: Cause::FramesSilent,
        name: "motor frames missing",
        when: "it answers, and no motor frame has come for three times `robot.command_limit_s`; they are asked for",
        action: Action::Stop,
        until: "the next one",
        applies: |flags, _| flags.health.motor == Motor::Silent,
    },
    Rule {
        cause: Cause::FramesSlow,
        name: "motor frames too slow",
        when: "they come less often than every `robot.command_limit_s`, which commands last for: let the robot send faster, or raise it",
        action: Action::Stop,
        until: "they come often enough",
        applies: |flags, _| matches!(flags.health.motor, Motor::Slow(_)),
    },
    Rule {
        cause: Cause::OdometryImplausible,
        name: "odometry implausible",
        when: "0.55 s of commanded motion with less than a quarter of it in the encoders, or 3 jumps within 2 s; `x80-link.log` says which",
        action: Action::Stop,
        until: "the robot restarts, or `firsthand stop` and `resume`, or 2 s without jumps",
        applies: |flags, _| flags.health.odometry != Plausibility::Plausible,
    },
    Rule {
        cause: Cause::RangeSilent,
        name: "front sonar silent",
        when: "a mission that senses has had no reading of it for three times `robot.command_limit_s`: none came, or 0",
        action: Action::Stop,
        until: "the next reading; 255 is one",
        applies: |flags, _| flags.health.range_silent,
    },
    Rule {
        cause: Cause::CommandStale,
        name: "command stale",
        when: "the newest command's tick began more than `robot.command_limit_s` ago, or there is none",
        action: Action::Stop,
        until: "a fresh one",
        applies: |flags, limit| flags.command.is_none_or(|ages| ages.command > limit),
    },
    Rule {
        cause: Cause::PoseStale,
        name: "pose stale",
        when: "the command or its guidance was computed from a pose older than that",
        action: Action::Stop,
        until: "a command from a fresh one",
        applies: |flags, limit| flags.command.is_some_and(|ages| ages.pose > limit),
    },
    Rule {
        cause: Cause::GuidanceStale,
        name: "guidance stale",
        when: "the command follows a guidance older than that",
        action: Action::Stop,
        until: "a command that follows a fresh one",
        applies: |flags, limit| flags.command.is_some_and(|ages| ages.guidance > limit),
    },
    Rule {
        cause: Cause::BatteryLow,
        name: "battery low",
        when: "the boards' or the motors' battery gives less than its `robot.low_battery_v`",
        action: Action::Slow,
        until: "it gives 0.3 V more than that",
        applies: |flags, _| flags.battery == Charge::Low,
    },
];

/// What an action means for the robot.
#[must_use]
pub const fn effect(action: Action) -> &'static str {
    match action {
        Action::Go => "goes",
        Action::Slow => "goes at half speed",
        Action::Stop => "stands",
        Action::End => "stands, and the mission ends",
    }
}

/// The row of a cause; none for [`Cause::None`].
#[must_use]
pub fn rule(cause: Cause) -> Option<&'static Rule> {
    TABLE.iter().find(|rule| rule.cause == cause)
}

/// A cause in a few words.
#[must_use]
pub fn name(cause: Cause) -> &'static str {
    rule(cause).map_or("nothing is wrong", |rule| rule.name)
}

/// The worst action that applies, and the first cause of it.
#[must_use]
pub fn decide(flags: &Flags, command_limit: Duration) -> Decision {
    worst(TABLE, flags, command_limit)
}

fn worst<'a>(
    rules: impl IntoIterator<Item = &'a Rule>,
    flags: &Flags,
    command_limit: Duration,
) -> Decision {
    let mut worst = Decision::GO;
    for rule in rules {
        if rule.action > worst.action && (rule.applies)(flags, command_limit) {
            worst = Decision {
                action: rule.action,
                cause: rule.cause,
            };
        }
    }
    worst
}

fn ordered(flags: &Flags, order: Order) -> bool {
    let orders = |directive: Directive| directive.order == order;
    flags.directive.is_some_and(orders)
}

/// Why the supervisor has the robot wait, if it has.
fn held(flags: &Flags) -> Option<HoldReason> {
    let directive = flags.directive?;
    (directive.order == Order::Hold).then_some(directive.reason)
}

#[cfg(test)]
mod tests;
