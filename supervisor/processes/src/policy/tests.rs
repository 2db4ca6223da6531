//! The model checks each rule, with its times, over every short history and many long ones. Tests
//! here guard what follows from the rules together, and shares of processor time.

mod model;

use super::*;
use crate::{activity::State, stages::TABLE};
use Event::*;

const fn ms(count: u64) -> Duration {
    Duration::from_millis(count)
}

fn running() -> Policy {
    let mut policy = Policy::new(TABLE[0].deadlines);
    policy.step(Start, ms(0));
    policy.step(BeatReady, ms(10));
    policy
}

#[test]
fn a_stage_that_cannot_run_is_held_within_ten_seconds() {
    let mut policy = running();
    policy.step(Exited, ms(20));
    while let Some(now) = policy.deadline().filter(|_| policy.phase() != Phase::Held) {
        assert!(now < ms(10_000), "{policy:?}");
        policy.step(Time(None), now);
        policy.step(Exited, now);
    }
    assert_eq!((policy.phase(), policy.recent_deaths()), (Phase::Held, 12));
}

#[test]
fn a_stage_killed_once_a_second_is_never_held() {
    let mut policy = running();
    for second in 1..1000 {
        let started = policy.step(Exited, ms(second * 1000));
        assert_eq!(started, Some(Action::Start), "after {second} kills");
        policy.step(BeatReady, ms(second * 1000 + 100));
    }
}

#[test]
fn silence_is_aborted_by_processor_time_of_its_own_and_by_time_asleep_and_not_by_starvation() {
    use State::{Asleep, Ready, Stopped};
    // Shares of each second in which the stage runs and starves, and milliseconds until its abort.
    for (ran, starved, state, want) in [
        (0.0, 0.0, Ready, None),
        (0.01, 0.99, Ready, None),
        (0.01, 0.99, Asleep, None),
        (1.0, 0.0, Ready, Some(750)),
        (0.25, 0.75, Ready, Some(3000)),
        (0.0, 0.0, Asleep, Some(3000)),
        (0.0, 0.5, Stopped, Some(750)),
    ] {
        let mut policy = running();
        let aborted = (1..60_000).find(|&age| {
            let [ran, starved] = [ran, starved].map(|share| ms(age).mul_f64(share));
            let time = Time(Some(Activity { ran, starved, state }));
            policy.step(time, ms(10 + age)) == Some(Action::Abort)
        });
        assert_eq!(aborted, want, "{state:?}, {ran} run, {starved} starved");
    }
}
