//! Tests of lockstep, in which the robot waits for each command.

use super::*;

#[test]
fn in_lockstep_the_order_asks_for_tick_0_and_each_command_for_the_next() {
    let mut link = in_ticks();
    assert_eq!(ticks(&link.still(0)), [], "the greeting's frames start nothing");
    assert_eq!(sent(&link.drive(0)), [PING]);
    for tick in 0..3 {
        assert_eq!(ticks(&link.still(0))[0].0, tick);
        assert_eq!(velocities(&link.answer(tick, 0)).len(), 1);
        assert!(!link.is_at_rest());
    }
    let mut found_later = in_ticks();
    found_later.drive(0);
    assert_eq!(ticks(&found_later.still(0))[0].0, 0);
    let mut successor = driving(started(&x80(), Pace::Max, 41));
    assert_eq!(ticks(&successor.still(0))[0].0, 41);
}

#[test]
fn in_lockstep_a_late_answer_to_a_ping_is_none_to_a_command() {
    let mut link = in_ticks();
    let pings = |effects: &[Effect]| sent(effects).iter().filter(|sent| **sent == PING).count();
    // A slow robot is pinged again before it is found, and answers each ping once.
    let mut owed = pings(&link.quiet(0)) + pings(&link.quiet(200));
    assert_eq!(owed, 2);
    owed += pings(&link.still(201)) + pings(&link.drive(202));
    assert_eq!(ticks(&link.still(203))[0].0, 0);
    link.answer(0, 204);
    for _ in 2..owed {
        assert_eq!(ticks(&link.still(205)), []);
    }
    assert_eq!(ticks(&link.hears(&datagram(120, [9; 2]), 206))[0].0, 1);
}

#[test]
fn in_lockstep_an_unanswered_tick_is_given_again_and_answered_once_and_no_command_is_sent_again() {
    let mut link = driving(in_ticks());
    let first = ticks(&link.hears(&datagram(80, [5, 6]), 0));
    assert_eq!(ticks(&link.quiet(99)), []);
    assert_eq!(ticks(&link.quiet(100)), first, "the same tick, to the bit");
    let answers = [101, 102].map(|ms| velocities(&link.answer(0, ms)).len());
    assert_eq!(answers, [1, 0], "a tick given twice is answered once");
    assert!((103..193).all(|ms| timed(&link.quiet(ms)).is_empty()));
    assert_eq!((link.tally.repeated_ticks, link.tally.repeated_commands), (1, 0));
}

#[test]
fn in_lockstep_frames_that_begin_no_tick_change_nothing_of_what_the_wheels_count() {
    let wheels = |more_frames: usize| {
        let mut link = driving(in_ticks());
        let mut effects = Vec::new();
        for tick in 0..60 {
            let frames = datagram(255, [-130.0, 120.0].map(|counts| on_wire(counts * tick as f64)));
            effects.extend(link.hears(&frames, 0));
            for _ in 0..more_frames {
                link.hears(&frames, 0);
            }
            link.answer(tick, 0);
        }
        ticks(&effects).pop().unwrap().2
    };
    let once = wheels(0);
    near(once.told_ratio, 12.0 / 13.0, 0.01);
    assert_eq!(wheels(1), once);
}
