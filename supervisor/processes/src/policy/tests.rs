//! Tests of single rules, then of all rules against a model over every short history and many long
//! ones.

mod model;

use super::*;
use crate::{activity::State, stages::TABLE};

const fn ms(count: u64) -> Duration {
    Duration::from_millis(count)
}

fn running() -> Policy {
    let mut policy = Policy::new(TABLE[0].deadlines);
    assert_eq!(policy.step(Event::Start, ms(0)), Some(Action::Start));
    assert_eq!(policy.step(Event::BeatStarting, ms(5)), None);
    assert_eq!(policy.step(Event::BeatReady, ms(10)), None);
    policy
}

#[test]
fn the_first_death_is_answered_at_once() {
    let mut policy = running();
    assert_eq!(policy.step(Event::Exited, ms(20)), Some(Action::Start));
}

#[test]
fn deaths_in_a_row_wait_longer_and_longer_up_to_a_second() {
    let mut policy = running();
    let mut now = ms(20);
    policy.step(Event::Exited, now);
    let mut waits = Vec::new();
    for _ in 0..10 {
        assert_eq!(policy.step(Event::Exited, now), None);
        let until = policy.deadline().unwrap();
        waits.push((until - now).as_millis());
        assert_eq!(policy.step(Event::Time(None), until - ms(1)), None);
        assert_eq!(policy.step(Event::Time(None), until), Some(Action::Start));
        now = until;
    }
    assert_eq!(waits, [2, 4, 8, 16, 32, 64, 128, 256, 512, 1000]);
}

/// Ends each process at its start until the stage is held; returns the time.
fn crash_until_held(policy: &mut Policy, mut now: Duration) -> Duration {
    for _ in 0..100 {
        policy.step(Event::Exited, now);
        if policy.phase() == Phase::Held {
            return now;
        }
        if let Phase::BackingOff { until } = policy.phase() {
            now = until;
            assert_eq!(policy.step(Event::Time(None), now), Some(Action::Start));
        }
    }
    panic!("it is never held: {policy:?}");
}

#[test]
fn a_stage_that_cannot_run_is_held_within_ten_seconds() {
    let mut policy = running();
    let held = crash_until_held(&mut policy, ms(20));
    assert!(held < Duration::from_secs(10), "{held:?}");
    assert_eq!(policy.recent_deaths(), 12);
    let later = held + Duration::from_secs(3600);
    assert_eq!(policy.step(Event::Time(None), later), None);
    assert_eq!((policy.phase(), policy.deadline()), (Phase::Held, None));
}

#[test]
fn a_stage_that_never_becomes_ready_is_held_after_twelve_starts() {
    let mut policy = Policy::new(TABLE[0].deadlines);
    policy.step(Event::Start, ms(0));
    let mut starts = 1;
    for _ in 0..100 {
        let Some(now) = policy.deadline() else { break };
        let mut action = policy.step(Event::Time(None), now);
        if action == Some(Action::Abort) {
            action = policy.step(Event::Exited, now + ms(1));
        }
        starts += u32::from(action == Some(Action::Start));
    }
    assert_eq!((policy.phase(), starts), (Phase::Held, 12));
}

#[test]
fn a_released_stage_starts_without_a_history() {
    let mut policy = running();
    let held = crash_until_held(&mut policy, ms(20));
    assert_eq!(policy.step(Event::Replace, held + ms(1)), Some(Action::Start));
    assert_eq!(policy.step(Event::Exited, held + ms(2)), Some(Action::Start));
}

#[test]
fn a_stage_killed_once_a_second_is_never_held() {
    let mut policy = running();
    for second in 1..1000 {
        let started = policy.step(Event::Exited, ms(second * 1000));
        assert_eq!(started, Some(Action::Start), "after {second} kills");
        policy.step(Event::BeatReady, ms(second * 1000 + 100));
    }
}

#[test]
fn a_stage_killed_again_and_again_is_held_though_it_was_stable_in_between() {
    let mut policy = running();
    for death in 1..12 {
        assert_eq!(policy.step(Event::Exited, ms(death * 600)), Some(Action::Start));
        policy.step(Event::BeatReady, ms(death * 600 + 1));
    }
    assert_eq!(policy.step(Event::Exited, ms(12 * 600)), None);
    assert_eq!(policy.phase(), Phase::Held);
}

#[test]
fn a_stable_generation_clears_the_deaths_before_it() {
    let mut policy = running();
    policy.step(Event::Exited, ms(20));
    policy.step(Event::BeatReady, ms(30));
    assert_eq!(policy.step(Event::Exited, ms(530)), Some(Action::Start));
    policy.step(Event::BeatReady, ms(540));
    assert_eq!(policy.step(Event::Exited, ms(1039)), None);
}

#[test]
fn a_stage_that_stops_beating_is_aborted_then_killed() {
    let mut policy = running();
    assert_eq!(policy.step(Event::Time(None), ms(759)), None);
    assert_eq!(policy.step(Event::Time(None), ms(760)), Some(Action::Abort));
    assert_eq!(policy.step(Event::Time(None), ms(859)), None);
    assert_eq!(policy.step(Event::Time(None), ms(860)), Some(Action::Kill));
    assert_eq!(policy.step(Event::Exited, ms(861)), Some(Action::Start));
}

/// Returns the silent time until the abort of a stage that spends each second like this.
fn aborted_after(ran: f64, starved: f64, state: State) -> Option<u64> {
    let mut policy = running();
    (1..60_000).find(|&age| {
        let (ran, starved) = (ms(age).mul_f64(ran), ms(age).mul_f64(starved));
        let time = Event::Time(Some(Activity { ran, starved, state }));
        policy.step(time, ms(10 + age)) == Some(Action::Abort)
    })
}

#[test]
fn a_starved_stage_is_not_aborted() {
    assert_eq!(aborted_after(0.0, 0.0, State::Ready), None, "it waits since its beat");
    assert_eq!(aborted_after(0.01, 0.99, State::Ready), None);
    assert_eq!(aborted_after(0.01, 0.99, State::Asleep), None);
}

#[test]
fn a_stage_that_spins_without_a_beat_is_aborted_after_its_deadline_of_processor_time() {
    assert_eq!(aborted_after(1.0, 0.0, State::Ready), Some(750));
    assert_eq!(aborted_after(0.25, 0.75, State::Ready), Some(3000));
}

#[test]
fn a_blocked_stage_is_aborted_after_four_deadlines_and_a_stopped_one_after_one() {
    assert_eq!(aborted_after(0.0, 0.0, State::Asleep), Some(3000));
    assert_eq!(aborted_after(0.0, 0.5, State::Stopped), Some(750));
}

#[test]
fn a_stage_that_beats_without_output_is_aborted() {
    let mut policy = running();
    assert_eq!(policy.step(Event::OutputStale, ms(50)), Some(Action::Abort));
    assert_eq!(policy.step(Event::Exited, ms(60)), Some(Action::Start));
    assert_eq!(policy.recent_deaths(), 1);
}

#[test]
fn a_stage_that_never_becomes_ready_is_aborted() {
    let mut policy = Policy::new(TABLE[0].deadlines);
    policy.step(Event::Start, ms(0));
    policy.step(Event::BeatStarting, ms(2999));
    assert_eq!(policy.step(Event::Time(None), ms(2999)), None);
    assert_eq!(policy.step(Event::Time(None), ms(3000)), Some(Action::Abort));
}

#[test]
fn a_bus_that_blocks_starts_is_recreated_once() {
    for refused in [false, true] {
        let mut policy = running();
        let mut now = ms(600);
        assert_eq!(policy.step(Event::Exited, now), Some(Action::Start));
        let mut answers = Vec::new();
        for _ in 0..4 {
            if refused {
                now += ms(5);
            } else {
                now += ms(3000);
                assert_eq!(policy.step(Event::Time(None), now), Some(Action::Abort));
            }
            let event = if refused { Event::Refused } else { Event::Exited };
            answers.push(policy.step(event, now));
            policy.step(Event::Stop, now);
            assert_eq!(policy.step(Event::Start, now), Some(Action::Start));
        }
        let once = [None, Some(Action::RecreateBus), None, None];
        assert_eq!(answers, once, "refused: {refused}");
    }
}

#[test]
fn a_generation_that_became_ready_clears_the_bus() {
    let mut policy = running();
    for second in 1..5 {
        policy.step(Event::Exited, ms(second * 1000));
        // Two starts lie between two refusals.
        assert_ne!(policy.step(Event::Refused, ms(second * 1000 + 1)), Some(Action::RecreateBus));
        policy.step(Event::Time(None), ms(second * 1000 + 51));
        policy.step(Event::BeatReady, ms(second * 1000 + 60));
    }
}

#[test]
fn a_replaced_stage_is_told_to_stop_and_followed_and_has_not_died() {
    let mut policy = running();
    for turn in 1..100 {
        let now = ms(turn * 50);
        assert_eq!(policy.step(Event::Replace, now), Some(Action::Terminate));
        let gone = policy.step(Event::Exited, now + ms(10));
        assert_eq!(gone, Some(Action::Start));
        policy.step(Event::BeatReady, now + ms(20));
    }
    assert_eq!(policy.recent_deaths(), 0);
}

#[test]
fn a_replaced_stage_that_stays_is_killed() {
    let mut policy = running();
    policy.step(Event::Replace, ms(50));
    assert_eq!(policy.step(Event::Time(None), ms(349)), None);
    assert_eq!(policy.step(Event::Time(None), ms(350)), Some(Action::Kill));
}

#[test]
fn a_stage_that_got_no_process_is_tried_again_but_not_at_once() {
    let mut policy = Policy::new(TABLE[0].deadlines);
    policy.step(Event::Start, ms(0));
    assert_eq!(policy.step(Event::StartFailed, ms(0)), None);
    assert_eq!(policy.deadline(), Some(ms(2)));
}

#[test]
fn a_stopped_stage_is_not_followed_and_killed_if_it_stays() {
    let mut policy = running();
    assert_eq!(policy.step(Event::Stop, ms(50)), Some(Action::Terminate));
    assert_eq!(policy.step(Event::Time(None), ms(349)), None);
    assert_eq!(policy.step(Event::Time(None), ms(350)), Some(Action::Kill));
    assert_eq!(policy.step(Event::Exited, ms(351)), None);
    assert_eq!(policy.phase(), Phase::Down);
    assert_eq!(policy.step(Event::Time(None), ms(9999)), None);
}
