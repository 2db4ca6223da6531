use super::*;

const LIMIT: Duration = Duration::from_millis(250);
const MOMENT: Duration = Duration::from_nanos(1);
/// Nothing is wrong, and all is as old as it may be.
const GO: Flags = Flags {
    directive: Some(DRIVE),
    connected: true,
    command: Some(AGES),
    battery: Charge::Well,
    health: WELL,
};
const WELL: HealthFlags = HealthFlags {
    does_not_stop: false,
    odometry: Plausibility::Plausible,
    motor: Motor::Regular,
    late: false,
    range_silent: false,
};
const DRIVE: Directive = Directive {
    order: Order::Drive,
    reason: HoldReason::None,
    age: SUPERVISOR_SILENT,
};
const AGES: Ages = Ages {
    command: LIMIT,
    pose: LIMIT,
    guidance: LIMIT,
};

const fn hold(reason: HoldReason) -> Flags {
    Flags {
        directive: Some(Directive {
            order: Order::Hold,
            reason,
            ..DRIVE
        }),
        ..GO
    }
}

/// What alone raises each cause, and what is to be done about it.
fn cases() -> Vec<(Flags, Action, Cause)> {
    let directive = |directive| Flags { directive, ..GO };
    let command = |command| Flags { command, ..GO };
    let ordered = |order| directive(Some(Directive { order, ..DRIVE }));
    let battery = |battery| Flags { battery, ..GO };
    let health = |health| Flags { health, ..GO };
    let odometry = |odometry| health(HealthFlags { odometry, ..WELL });
    let motor = |motor| health(HealthFlags { motor, ..WELL });
    let does_not_stop = HealthFlags {
        does_not_stop: true,
        ..WELL
    };
    let range_silent = HealthFlags {
        range_silent: true,
        ..WELL
    };
    let late_frames = HealthFlags { late: true, ..WELL };
    let silent = Directive {
        age: SUPERVISOR_SILENT + MOMENT,
        ..DRIVE
    };
    let late = LIMIT + MOMENT;
    let old = |ages| command(Some(ages));
    vec![
        (ordered(Order::Stop), Action::End, Cause::MissionOver),
        (battery(Charge::Empty), Action::End, Cause::BatteryEmpty),
        (
            hold(HoldReason::Operator),
            Action::Stop,
            Cause::OperatorStop,
        ),
        (hold(HoldReason::StageHeld), Action::Stop, Cause::StageHeld),
        (directive(None), Action::Stop, Cause::NotOrdered),
        (hold(HoldReason::Starting), Action::Stop, Cause::NotOrdered),
        (hold(HoldReason::None), Action::Stop, Cause::NotOrdered),
        (hold(HoldReason::Ending), Action::Stop, Cause::NotOrdered),
        (
            directive(Some(silent)),
            Action::Stop,
            Cause::SupervisorSilent,
        ),
        (
            Flags {
                connected: false,
                ..GO
            },
            Action::Stop,
            Cause::RobotLost,
        ),
        (command(None), Action::Stop, Cause::CommandStale),
        (
            old(Ages {
                command: late,
                ..AGES
            }),
            Action::Stop,
            Cause::CommandStale,
        ),
        (
            old(Ages { pose: late, ..AGES }),
            Action::Stop,
            Cause::PoseStale,
        ),
        (
            old(Ages {
                guidance: late,
                ..AGES
            }),
            Action::Stop,
            Cause::GuidanceStale,
        ),
        (
            odometry(Plausibility::GivenUp),
            Action::End,
            Cause::OdometryGivenUp,
        ),
        (health(does_not_stop), Action::Stop, Cause::RobotDoesNotStop),
        (motor(Motor::Silent), Action::Stop, Cause::FramesSilent),
        (motor(Motor::Slow(3.0)), Action::Stop, Cause::FramesSlow),
        (
            odometry(Plausibility::Suspected),
            Action::Stop,
            Cause::OdometryImplausible,
        ),
        (health(late_frames), Action::Stop, Cause::RobotLate),
        (health(range_silent), Action::Stop, Cause::RangeSilent),
        (battery(Charge::Low), Action::Slow, Cause::BatteryLow),
    ]
}

#[test]
fn where_nothing_is_wrong_commands_pass() {
    assert_eq!(decide(&GO, LIMIT), Decision::GO);
}

#[test]
fn each_cause_alone_leads_to_its_action() {
    for (flags, action, cause) in cases() {
        assert_eq!(
            decide(&flags, LIMIT),
            Decision { action, cause },
            "{flags:?}"
        );
    }
}

#[test]
fn every_cause_has_one_row_and_a_case_that_is_decided_otherwise_without_it() {
    for byte in 1..=u8::MAX {
        let cause = Cause::from_byte(byte);
        if u8::from(cause) != byte {
            // No cause has this byte.
            continue;
        }
        let rows = TABLE.iter().filter(|rule| rule.cause == cause).count();
        assert_eq!(rows, 1, "{cause:?}");
        let cases = cases();
        let mut own = cases.iter().filter(|(_, _, reported)| *reported == cause);
        let (flags, action, _) = own.next().unwrap();
        let others = TABLE.iter().filter(|rule| rule.cause != cause);
        let without = worst(others, flags, LIMIT);
        assert_ne!(
            without,
            Decision {
                action: *action,
                cause
            }
        );
    }
}

/// Every combination of what can be wrong.
fn combinations() -> Vec<Flags> {
    let mut directives = vec![None];
    let reasons = [0, 1, 2, 3, 4].map(HoldReason::from_byte);
    for order in [Order::Hold, Order::Drive, Order::Stop] {
        for reason in reasons {
            for age in [Duration::ZERO, SUPERVISOR_SILENT, Duration::MAX] {
                directives.push(Some(Directive { order, reason, age }));
            }
        }
    }
    let ages = [Duration::ZERO, LIMIT, Duration::MAX];
    let mut commands = vec![None];
    for command in ages {
        for pose in ages {
            for guidance in ages {
                commands.push(Some(Ages {
                    command,
                    pose,
                    guidance,
                }));
            }
        }
    }
    let mut all = Vec::new();
    for &directive in &directives {
        for &command in &commands {
            for connected in [true, false] {
                for battery in [Charge::Well, Charge::Low, Charge::Empty] {
                    for health in sensed() {
                        all.push(Flags {
                            directive,
                            connected,
                            command,
                            battery,
                            health,
                        });
                    }
                }
            }
        }
    }
    all
}

/// Every combination of what frames can say.
fn sensed() -> Vec<HealthFlags> {
    let mut all = Vec::new();
    for odometry in [
        Plausibility::Plausible,
        Plausibility::Suspected,
        Plausibility::GivenUp,
    ] {
        for motor in [Motor::Regular, Motor::Silent, Motor::Slow(3.0)] {
            for bits in 0..8_u8 {
                all.push(HealthFlags {
                    does_not_stop: bits & 1 != 0,
                    odometry,
                    motor,
                    late: bits & 2 != 0,
                    range_silent: bits & 4 != 0,
                });
            }
        }
    }
    all
}

#[test]
fn whatever_is_wrong_at_once_nothing_milder_is_done_than_the_worst_of_it_asks_for() {
    let mut went = 0;
    for flags in combinations() {
        let decision = decide(&flags, LIMIT);
        let mut applying = TABLE.iter().filter(|rule| (rule.applies)(&flags, LIMIT));
        let worst = applying.clone().map(|rule| rule.action).max();
        assert_eq!(decision.action, worst.unwrap_or(Action::Go), "{flags:?}");
        let reported = applying.find(|rule| Some(rule.action) == worst);
        assert_eq!(
            decision.cause,
            reported.map_or(Cause::None, |rule| rule.cause)
        );
        went += u32::from(decision == Decision::GO);
    }
    // Drive, said for any of five reasons and not too long ago; three ages, none too old.
    assert_eq!(went, 5 * 2 * 8);
}

#[test]
fn the_worst_actions_stand_first_in_the_table() {
    assert!(TABLE.is_sorted_by(|one, next| one.action >= next.action));
}

#[test]
fn the_words_of_the_table_say_the_numbers_that_hold() {
    let says = |cause: Cause, words: &str| {
        let rule = rule(cause).unwrap();
        assert!(
            format!("{} {}", rule.when, rule.until).contains(words),
            "{words} in {rule:?}"
        );
    };
    says(Cause::RobotLost, "three times");
    assert_eq!(crate::presence::SILENT_LIMITS, 3);
    let seconds = |span: Duration| format!("{} s", span.as_secs());
    says(Cause::SupervisorSilent, &seconds(SUPERVISOR_SILENT));
    assert_eq!(common::topics::RESTATE * 5, Duration::from_secs(1));
    says(Cause::BatteryEmpty, &seconds(crate::telemetry::EMPTY_AFTER));
    assert!((crate::telemetry::EMPTY_SHARE - 10.0 / 11.0).abs() < 1e-9);
    let recovered = format!("{} V", crate::telemetry::RECOVERED_V);
    says(Cause::BatteryLow, &recovered);
    use crate::odometry::{GIVEN_UP_AFTER, JUMPS_WITHIN, MOST_JUMPS, SUSPECTED_AFTER};
    says(Cause::OdometryGivenUp, &seconds(GIVEN_UP_AFTER));
    let suspected = format!("{} s", SUSPECTED_AFTER.as_secs_f64());
    says(Cause::OdometryImplausible, &suspected);
    let jumps = format!("{MOST_JUMPS} jumps within {}", seconds(JUMPS_WITHIN));
    says(Cause::OdometryImplausible, &jumps);
    let does_not_stop = format!(
        "{} s",
        crate::stop_monitor::DOES_NOT_STOP_AFTER.as_secs_f64()
    );
    says(Cause::RobotDoesNotStop, &does_not_stop);
    assert!((SLOW_SHARE - 0.5).abs() < 1e-9 && effect(Action::Slow).contains("half"));
}
