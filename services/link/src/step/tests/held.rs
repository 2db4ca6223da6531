//! Inputs of the failsafe, and effects of its decisions.

use super::*;

const fn limit(last_tick: u64) -> Event<'static> {
    Event::TickLimit { last_tick, target_number: 1 }
}

fn limited(pace: Pace, next_tick: u64, last_tick: u64) -> Link {
    let mut link = started(&x80(), pace, next_tick);
    link.at(limit(last_tick), 0);
    driving(link)
}

#[test]
fn in_lockstep_a_hold_lets_no_command_pass_and_the_run_goes_on_where_it_was() {
    let mut link = driving(in_ticks());
    link.still(1);
    link.answer(0, 2);
    assert_eq!(ticks(&link.still(3))[0].0, 1);
    let effects = link.answer(1, 2001);
    assert_eq!(decided(&effects), [(Action::Stop, Cause::SupervisorSilent)]);
    assert_eq!(sent(&effects), [], "each command would be a tick");
    assert_eq!(sent(&link.drive(2002)), []);
    assert_eq!(ticks(&link.quiet(2101))[0].0, 1, "the same tick again");
    assert_eq!(velocities(&link.answer(1, 2102)), [[Some(-1200), Some(1200)]]);
}

#[test]
fn in_lockstep_no_tick_follows_an_arrival_before_there_is_another_target() {
    let mut link = limited(Pace::Max, 0, 9);
    assert_eq!(ticks(&link.still(1)).len(), 1);
    let state = CommandState::Arrived.into();
    let arrived = CommandSample { state, target_number: 1, ..command(0, 0, [0.0; 2]) };
    link.at(Event::Command(arrived), 2);
    assert_eq!(ticks(&link.still(3)), []);
    assert_eq!(ticks(&link.at(limit(12), 4)), [], "it is the same target");
    let next = Event::TickLimit { last_tick: 12, target_number: 2 };
    assert!(matches!(ticks(&link.at(next, 5))[..], [(1, ..)]));
}

#[test]
fn in_lockstep_a_given_tick_is_answered_alike_before_and_after_the_order_to_wait() {
    let wait = Event::Order(Order::Hold, HoldReason::Waiting);
    let answer = Event::Command(command(0, 0, [TURN; 2]));
    let outcome = |events: [Event<'_>; 2]| {
        let mut link = limited(Pace::Max, 0, 9);
        link.still(1);
        let sent = events.map(|event| velocities(&link.at(event, 2))).concat();
        assert_eq!(ticks(&link.still(3)), []);
        (sent, link.state.next_tick, link.decision)
    };
    let before = outcome([wait, answer]);
    assert_eq!(before, outcome([answer, wait]));
    assert_eq!((before.0.len(), before.1, before.2.stops()), (1, 1, true));
}

#[test]
fn in_lockstep_none_begins_beyond_the_supervisors_limit_until_it_was_waited_for_too_long() {
    let given = |effects: &[Effect]| !ticks(effects).is_empty();
    let late = LIMIT_WAITED.as_millis() as u64 + 2;
    for (event, ms, is_given) in
        [(Event::Quiet, 200, false), (limit(3), 201, true), (Event::Quiet, late, true)]
    {
        let mut link = limited(Pace::Max, 3, 2);
        assert!(!given(&link.still(1)));
        assert_eq!(given(&link.at(event, ms)), is_given, "{ms} ms");
    }
    let mut on_the_wall = limited(Pace::Rate(1.0), 3, 0);
    assert!([143, 286].into_iter().all(|ms| given(&on_the_wall.still(ms))));
}
