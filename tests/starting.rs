//! Tests of signals during the start of a run: it ends with a summary, and leaves nothing.

use std::{fs, path::Path, process::Stdio, thread};

use rustix::process::Signal;

use crate::support::{
    all_run, assert_nothing_left, directory_of, domain, firsthand, process_with, signal_process,
    start_piped, status_of, wait_until,
};

/// Ends a run when `is_there` is true for its directory of runs.
fn ends(robot: &str, arguments: &[&str], is_there: impl Fn(&Path) -> bool) {
    let runs = directory_of(robot);
    let mut run = firsthand(&["run", "open-room", "--robot", robot, "--pace", "1", "--runs"]);
    let run = start_piped(run.arg(runs.path()).args(arguments).stderr(Stdio::piped()));
    wait_until("it is there", || is_there(runs.path()));
    signal_process(run.id(), Signal::TERM);
    let output = run.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    let said = [output.stdout, output.stderr].concat();
    let said = String::from_utf8_lossy(&said);
    assert!(said.contains("stopped by a signal"), "{said}");
    assert_nothing_left(robot);
    // The robot never drove.
    let left: Vec<_> = fs::read_dir(runs.path()).unwrap().collect();
    assert!(left.is_empty(), "{left:?}");
}

#[test]
fn a_signal_at_any_moment_of_a_start_ends_the_run_with_a_summary_and_leaves_nothing() {
    ends("st-log", &[], |runs| runs.join("open-room-001/supervisor.log").exists());
    ends("st-claim", &[], |_| domain("st-claim").is_supervised());
    ends("st-bus", &[], |_| domain("st-bus").middleware_config().exists());
    for (robot, word) in [
        ("st-robot", "x80-sim.checkpoint"),
        ("st-recorder", "firsthand record"),
        ("st-stage", "stage planner"),
    ] {
        ends(robot, &[], |_| process_with(robot, word).is_some());
    }
    // The robot is off.
    let nowhere = ["--set", "robot.address='127.0.0.1:9'"];
    ends("st-off", &nowhere, |_| status_of("st-off").is_some_and(|status| all_run(&status)));
}

#[test]
fn a_signal_ends_a_run_whose_robot_or_recorder_gets_no_processor_while_it_starts() {
    let [simulator, recorder] = ["x80-sim.checkpoint", "firsthand record"];
    // The recorder starts once the robot listens.
    let cases = [
        ("st-no-robot", simulator, simulator),
        ("st-listens", recorder, simulator),
        ("st-no-rec", recorder, recorder),
    ];
    thread::scope(|scope| {
        for (robot, appears, frozen) in cases {
            scope.spawn(move || {
                ends(robot, &[], |_| {
                    let child =
                        process_with(robot, appears).and_then(|_| process_with(robot, frozen));
                    child.inspect(|&child| signal_process(child, Signal::STOP)).is_some()
                });
            });
        }
    });
}
