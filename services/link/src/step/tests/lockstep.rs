//! Tests of lockstep, in which the robot waits for each command.

use common::wire::COUNT_CYCLE;

use super::*;

#[test]
fn in_lockstep_no_command_is_sent_again() {
    let mut link = driving(in_ticks());
    link.at(Event::Datagram(&datagram(255, 0, 0)), 1);
    link.at(Event::Command(command(0, 0, 1.0, 1.0)), 2);
    for now in (0..90).step_by(10) {
        assert_eq!(timed(&link.at(Event::Quiet, now * MS)), []);
    }
    assert_eq!(link.tally.repeated_commands, 0);
}

#[test]
fn in_lockstep_the_order_asks_for_tick_0_and_each_command_for_the_next() {
    let mut link = in_ticks();
    let effects = link.at(Event::Datagram(&datagram(255, 0, 0)), 0);
    assert_eq!(ticks(&effects), [], "the greeting's frames start nothing");
    let effects = link.at(Event::Order(Order::Drive, HoldReason::None), 1);
    assert_eq!(sent(&effects), [Command::System(SystemSignal::Ping)]);
    for tick in 0..3 {
        let effects = link.at(Event::Datagram(&datagram(255, 0, 0)), 2);
        assert_eq!(ticks(&effects)[0].0, tick);
        let effects = link.at(Event::Command(command(tick, tick * PERIOD_NS, 1.0, 1.0)), 3);
        assert_eq!(velocities(&effects).len(), 1);
    }
}

#[test]
fn in_lockstep_a_robot_found_after_the_order_still_starts() {
    let mut link = in_ticks();
    link.at(Event::Order(Order::Drive, HoldReason::None), 0);
    let effects = link.at(Event::Datagram(&datagram(255, 0, 0)), 1);
    assert_eq!(ticks(&effects)[0].0, 0);
}

#[test]
fn in_lockstep_a_late_answer_to_a_ping_is_none_to_a_command() {
    let mut link = in_ticks();
    let pings = |effects: &[Effect]| {
        let ping = Command::System(SystemSignal::Ping);
        sent(effects).iter().filter(|sent| **sent == ping).count()
    };
    // A slow robot is pinged again before it is found, and answers each ping once.
    let mut owed = pings(&link.at(Event::Quiet, 0));
    owed += pings(&link.at(Event::Quiet, 200 * MS));
    assert_eq!(owed, 2);
    owed += pings(&link.at(Event::Datagram(&datagram(255, 0, 0)), 201 * MS));
    owed += pings(&link.at(Event::Order(Order::Drive, HoldReason::None), 202 * MS));
    let began = ticks(&link.at(Event::Datagram(&datagram(255, 0, 0)), 203 * MS));
    link.at(Event::Command(command(0, 0, 1.0, 1.0)), 204 * MS);
    let late =
        (2..owed).flat_map(|_| ticks(&link.at(Event::Datagram(&datagram(255, 0, 0)), 205 * MS)));
    let late: Vec<_> = late.collect();
    let answered = ticks(&link.at(Event::Datagram(&datagram(120, 9, 9)), 206 * MS));
    let numbers: [Vec<u64>; 3] =
        [began, late, answered].map(|ticks| ticks.iter().map(|tick| tick.0).collect());
    assert_eq!(numbers, [vec![0], vec![], vec![1]]);
}

#[test]
fn in_lockstep_an_unanswered_tick_is_given_again_and_answered_once() {
    let mut link = driving(in_ticks());
    let first = ticks(&link.at(Event::Datagram(&datagram(80, 5, 6)), 0));
    assert_eq!(ticks(&link.at(Event::Quiet, 99 * MS)), []);
    let again = ticks(&link.at(Event::Quiet, 100 * MS));
    assert_eq!(again, first, "the same tick, to the bit");
    let effects = link.at(Event::Command(command(0, 0, 1.0, 1.0)), 101 * MS);
    assert_eq!(velocities(&effects).len(), 1);
    let effects = link.at(Event::Command(command(0, 0, 1.0, 1.0)), 102 * MS);
    let second = velocities(&effects);
    assert!(second.is_empty(), "a tick given twice is answered once");
}

#[test]
fn in_lockstep_frames_that_begin_no_tick_change_nothing_of_what_the_wheels_count() {
    let wheels = |more_frames: usize| {
        let mut link = driving(in_ticks());
        let tick = |tick: u64| {
            let tick = tick as u16;
            datagram(255, COUNT_CYCLE - 1 - 130 * tick, 120 * tick)
        };
        let effects = (0..60).flat_map(|number| {
            let effects = link.at(Event::Datagram(&tick(number)), number);
            for _ in 0..more_frames {
                link.at(Event::Datagram(&tick(number)), number);
            }
            let stamp_ns = number * PERIOD_NS;
            link.at(Event::Command(command(number, stamp_ns, 5.0, 5.0)), number);
            effects
        });
        ticks(&effects.collect::<Vec<_>>()).pop().unwrap().2
    };
    let once = wheels(0);
    assert!((once.told_ratio - 12.0 / 13.0).abs() < 0.01, "{once:?}");
    assert_eq!(wheels(1), once);
}

#[test]
fn a_successor_numbers_its_ticks_after_its_predecessors() {
    let mut link = driving(from_tick(41));
    let effects = link.at(Event::Datagram(&datagram(255, 0, 0)), 0);
    assert_eq!(ticks(&effects)[0].0, 41);
}
