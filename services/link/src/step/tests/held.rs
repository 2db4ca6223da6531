//! Inputs of the failsafe, and effects of its decisions.

use super::*;

const STAND: [Option<i16>; 2] = [Some(0), Some(0)];
/// One turn per second, 1200 counts/s.
const TURN: f64 = std::f64::consts::TAU;

/// Runs a tick and its command; wheels have turned as commanded since time 0.
fn tick(link: &mut Link, number: u64, now_ns: u64) -> Vec<Effect> {
    let rolled = (now_ns / MS * 12 / 10) as u16;
    tick_by(
        link,
        now_ns,
        &datagram(255, (32_768 - rolled) % 32_768, rolled),
        &command(number, now_ns, TURN, TURN),
    )
}

fn tick_by(link: &mut Link, now_ns: u64, frames: &[u8], command: &CommandSample) -> Vec<Effect> {
    let mut effects = link.at(Event::Datagram(frames), now_ns);
    effects.extend(link.at(Event::Command(*command), now_ns + MS));
    effects
}

const fn limit(last_tick: u64) -> Event<'static> {
    Event::TickLimit { last_tick, target_number: 1 }
}

fn powered(volts: f64) -> Vec<u8> {
    let ad = |scale: f64| (volts / scale * 4095.0).round() as u16;
    let standard = StandardSensors {
        board_battery: ad(9.0),
        motor_battery: ad(24.0),
        servo_battery: ad(9.0),
        ..StandardSensors::default()
    };
    let mut bytes = Vec::new();
    Report::Standard(standard).encode(Addressing::default(), &mut bytes);
    Report::Motor(MotorSensors::default()).encode(Addressing::default(), &mut bytes);
    bytes
}

#[test]
fn a_supervisor_that_says_nothing_stops_the_robot_and_its_next_directive_lets_it_go_on() {
    let mut link = driving(on_the_wall());
    let mut now = 0;
    for number in 0..14 {
        now = number * 143 * MS;
        let effects = tick(&mut link, number, now);
        assert!(!velocities(&effects).contains(&STAND), "{now} {effects:?}");
    }
    // The last command is fresh.
    let effects = link.at(Event::Quiet, 2001 * MS);
    assert_eq!(velocities(&effects), [STAND; 3]);
    assert_eq!(decided(&effects), [(Action::Stop, Cause::SupervisorSilent)]);
    now += 143 * MS;
    let effects = tick(&mut link, 14, now);
    assert_eq!(ticks(&effects).len(), 1, "the stages work on");
    assert!(velocities(&effects).is_empty(), "{effects:?}");
    link.at(Event::Order(Order::Drive, HoldReason::None), now + 2 * MS);
    let effects = tick(&mut link, 15, now + 143 * MS);
    assert_eq!(velocities(&effects), [[Some(-1200), Some(1200)]]);
}

#[test]
fn in_lockstep_a_hold_lets_no_command_pass_and_the_run_goes_on_where_it_was() {
    let mut link = driving(in_ticks());
    link.at(Event::Datagram(&datagram(255, 0, 0)), 1);
    link.at(Event::Command(command(0, 0, TURN, TURN)), 2);
    let effects = link.at(Event::Datagram(&datagram(255, 0, 0)), 3);
    assert_eq!(ticks(&effects)[0].0, 1);
    let frozen = 2001 * MS;
    let effects = link.at(Event::Command(command(1, PERIOD_NS, TURN, TURN)), frozen);
    assert_eq!(decided(&effects), [(Action::Stop, Cause::SupervisorSilent)]);
    assert_eq!(sent(&effects), [], "each command would be a tick");
    let directive = Event::Order(Order::Drive, HoldReason::None);
    assert_eq!(sent(&link.at(directive, frozen + MS)), []);
    let effects = link.at(Event::Quiet, frozen + 100 * MS);
    assert_eq!(ticks(&effects)[0].0, 1, "the same tick again");
    let answer = command(1, PERIOD_NS, TURN, TURN);
    let effects = link.at(Event::Command(answer), frozen + 101 * MS);
    assert_eq!(velocities(&effects), [[Some(-1200), Some(1200)]]);
}

#[test]
fn a_fresh_command_from_an_old_pose_or_guidance_moves_nothing() {
    let fresh = command(2, 300 * MS, TURN, TURN);
    let old_pose = CommandSample { pose_ns: 49 * MS, ..fresh };
    let old_guidance = CommandSample { guidance_ns: 49 * MS, ..fresh };
    // Commands without these times hold 0.
    let silent = CommandSample { pose_ns: 0, guidance_ns: 0, ..fresh };
    for (command, cause) in [
        (old_pose, Cause::PoseStale),
        (old_guidance, Cause::GuidanceStale),
        (silent, Cause::PoseStale),
    ] {
        let mut link = driving(on_the_wall());
        tick(&mut link, 0, 0);
        tick(&mut link, 1, 150 * MS);
        let effects = tick_by(&mut link, 300 * MS, &datagram(255, 32_408, 360), &command);
        assert_eq!(velocities(&effects), [STAND; 3], "{cause:?}");
        assert_eq!(decided(&effects), [(Action::Stop, cause)]);
        let effects = tick(&mut link, 3, 443 * MS);
        assert_eq!(velocities(&effects), [[Some(-1200), Some(1200)]]);
    }
}

#[test]
fn on_a_low_battery_the_robot_goes_the_same_way_at_half_speed() {
    let mut link = driving(on_the_wall());
    let curve = command(0, MS, TURN, 0.5 * TURN);
    let effects = tick_by(&mut link, MS, &powered(6.5), &curve);
    assert_eq!(velocities(&effects), [[Some(-600), Some(300)]]);
    assert!(decided(&effects).contains(&(Action::Slow, Cause::BatteryLow)));
    let curve = command(1, 143 * MS, TURN, 0.5 * TURN);
    let effects = tick_by(&mut link, 143 * MS, &powered(7.2), &curve);
    assert_eq!(velocities(&effects), [[Some(-1200), Some(600)]]);
}

#[test]
fn on_an_empty_battery_the_robot_stands_for_good() {
    for (mut link, period) in [(in_ticks(), PERIOD_NS), (on_the_wall(), PERIOD_NS)] {
        link.at(Event::Datagram(&powered(5.9)), 0);
        let mut ended = None;
        for number in 0..20 {
            let now = number * period;
            let directive = Event::Order(Order::Drive, HoldReason::None);
            link.at(directive, now);
            let command = command(number, now, TURN, TURN);
            let effects = tick_by(&mut link, now, &powered(5.9), &command);
            if decided(&effects).contains(&(Action::End, Cause::BatteryEmpty)) {
                ended.get_or_insert(number);
            }
        }
        // 2 s are 14 periods.
        assert!(matches!(ended, Some(14..=15)), "{ended:?}");
        let charged = command(21, 21 * period, TURN, TURN);
        let effects = tick_by(&mut link, 21 * period, &powered(7.8), &charged);
        let mut commands = velocities(&effects).into_iter();
        assert!(commands.all(|velocity| velocity == STAND), "{effects:?}");
    }
}

#[test]
fn in_lockstep_no_tick_follows_an_arrival_before_there_is_another_target() {
    let given = |effects: &[Effect]| effects.iter().any(|it| matches!(it, Effect::Tick { .. }));
    let mut link = in_ticks();
    link.at(limit(9), 0);
    let mut link = driving(link);
    let frames = datagram(255, 0, 0);
    assert!(given(&link.at(Event::Datagram(&frames), MS)));
    let state = CommandState::Arrived.into();
    let arrived = CommandSample { state, target_number: 1, ..command(0, 0, 0.0, 0.0) };
    link.at(Event::Command(arrived), 2 * MS);
    assert!(!given(&link.at(Event::Datagram(&frames), 3 * MS)));
    assert!(!given(&link.at(limit(12), 4 * MS)), "it is the same target");
    let next = Event::TickLimit { last_tick: 12, target_number: 2 };
    let effects = link.at(next, 5 * MS);
    let ticks = effects.iter().filter(|it| matches!(it, Effect::Tick { tick: 1, .. }));
    assert_eq!(ticks.count(), 1, "{effects:?}");
}

#[test]
fn in_lockstep_none_begins_beyond_the_supervisors_limit_until_it_was_waited_for_too_long() {
    let given = |effects: &[Effect]| effects.iter().any(|it| matches!(it, Effect::Tick { .. }));
    let frames = datagram(255, 0, 0);
    let limited = || {
        let mut link = from_tick(3);
        link.at(limit(2), 0);
        let mut link = driving(link);
        assert!(!given(&link.at(Event::Datagram(&frames), MS)));
        link
    };
    let mut link = limited();
    assert!(!given(&link.at(Event::Quiet, 200 * MS)));
    assert!(given(&link.at(limit(3), 201 * MS)));
    let late = LIMIT_WAITED.as_nanos() as u64 + 2 * MS;
    assert!(given(&limited().at(Event::Quiet, late)));
    let mut on_the_wall = on_the_wall();
    on_the_wall.at(limit(0), 0);
    let mut on_the_wall = driving(on_the_wall);
    for tick in 1..3 {
        assert!(given(&on_the_wall.at(Event::Datagram(&frames), tick * PERIOD_NS)));
    }
}
