//! Whether the robot may move: one pure function, evaluated where the stop is made.

use std::time::Duration;

use common::samples::Order;

/// What the link knows when it decides.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Flags {
    /// What the supervisor wants; none before it spoke.
    pub order: Option<Order>,
    /// Mission time since the newest command was computed from its tick; none before the first.
    pub command_age: Option<Duration>,
    /// Whether the robot answers.
    pub connected: bool,
}

/// Why the robot must stand still.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// The supervisor has not said drive.
    NotOrdered,
    /// No command yet, or the newest is too old: a stage is down or slow.
    CommandStale,
    /// The robot does not answer; it is told to stand in case it hears.
    RobotLost,
}

impl Cause {
    /// For logs.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::NotOrdered => "no order to drive",
            Self::CommandStale => "command stale",
            Self::RobotLost => "robot lost",
        }
    }
}

/// The first cause that applies; none lets the newest command through.
#[must_use]
pub fn stop_cause(flags: &Flags, command_limit: Duration) -> Option<Cause> {
    if flags.order != Some(Order::Drive) {
        return Some(Cause::NotOrdered);
    }
    if !flags.connected {
        return Some(Cause::RobotLost);
    }
    match flags.command_age {
        Some(age) if age <= command_limit => None,
        _ => Some(Cause::CommandStale),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMIT: Duration = Duration::from_millis(250);
    const GO: Flags = Flags {
        order: Some(Order::Drive),
        command_age: Some(LIMIT),
        connected: true,
    };

    #[test]
    fn a_fresh_command_passes_and_one_past_its_limit_does_not() {
        assert_eq!(stop_cause(&GO, LIMIT), None);
        let stale = Flags {
            command_age: Some(LIMIT + Duration::from_nanos(1)),
            ..GO
        };
        assert_eq!(stop_cause(&stale, LIMIT), Some(Cause::CommandStale));
        let never = Flags {
            command_age: None,
            ..GO
        };
        assert_eq!(stop_cause(&never, LIMIT), Some(Cause::CommandStale));
    }

    #[test]
    fn without_an_order_to_drive_nothing_passes() {
        for order in [None, Some(Order::Hold), Some(Order::Stop)] {
            assert_eq!(
                stop_cause(&Flags { order, ..GO }, LIMIT),
                Some(Cause::NotOrdered)
            );
        }
    }

    #[test]
    fn a_robot_that_does_not_answer_is_told_to_stand() {
        let lost = Flags {
            connected: false,
            ..GO
        };
        assert_eq!(stop_cause(&lost, LIMIT), Some(Cause::RobotLost));
    }
}
