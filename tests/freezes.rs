//! Tests that repeated freezes of stages are noticed soon.
#![allow(clippy::unwrap_used, clippy::panic, clippy::print_stdout)]

mod support;

use processes::stages::find as find_stage;
use rustix::process::Signal;
use support::{ENDLESS, Run, STAGES};

/// Longest time after its deadline until a freeze is noticed, seconds.
const SLACK: f64 = 0.020;

/// Freezes each stage `times` times in a mission at wall-clock pace, and prints the delay of each
/// detection.
fn freeze_each(robot: &str, times: usize) -> Vec<f64> {
    let mut run = Run::under_way(robot, "open-room", ENDLESS, 0.5);
    for _ in 0..times {
        run.kill_each(Signal::STOP);
    }
    let deaths = run.records("deaths.jsonl");
    run.stop();
    // A brief stall of the machine may make other stages late, too.
    assert!(deaths.len() >= times * STAGES.len(), "{deaths:?}");
    let mut late: Vec<f64> = deaths
        .iter()
        .map(|death| {
            assert_eq!(death["hung"], true, "{death}");
            let stage = find_stage(death["stage"].as_str().unwrap()).unwrap();
            let deadline = stage.deadlines.heartbeat.as_secs_f64();
            death["noticed_after_s"].as_f64().unwrap() - deadline
        })
        .collect();
    late.sort_by(f64::total_cmp);
    let at = |share: f64| late[((late.len() - 1) as f64 * share) as usize] * 1e3;
    println!(
        "{} freezes, noticed so many ms after the deadline: median {:.2}, 99 % {:.2}, most {:.2}",
        late.len(),
        at(0.5),
        at(0.99),
        at(1.0)
    );
    late
}

#[test]
fn frozen_stages_are_noticed_when_their_beat_is_due() {
    let late = freeze_each("freezes", 2);
    // Other programs share the processors, so only the median counts.
    let median = late[late.len() / 2];
    assert!(late[0] >= 0.0 && median < SLACK, "{late:?}");
}

/// Takes ten minutes on an otherwise idle machine:
/// `cargo test --release -p firsthand --test freezes -- --ignored --nocapture`.
#[test]
#[ignore = "takes ten minutes and a quiet machine"]
fn five_hundred_frozen_stages_are_noticed_within_20_ms() {
    for late in freeze_each("freezes-500", 100) {
        assert!((0.0..SLACK).contains(&late), "{late}");
    }
}
