//! Tests that a robot stops after any failure of its driving processes. The robots are separate
//! processes without command time limits, so they drive on unless stopped.

use std::{
    fs,
    path::PathBuf,
    sync::atomic::{AtomicBool, Ordering},
    time::Instant,
};

use common::wire::{Command, Decoder, Motion};
use rustix::process::Signal;
use serde_json::Value;
use tempfile::TempDir;

use crate::support::{
    PATIENCE, Run, domain, find, logged, operate, output, pid, refused, shared_memory,
    signal_process, wait_until,
    wire::{Pass, Proxy, Robot},
};

/// Writes a mission of a robot that ignores command time limits, with its target `target_m` ahead.
fn mission(target_m: f64) -> (TempDir, PathBuf) {
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("straight.toml");
    let text = format!("target = [{target_m}, 0]\n[simulation]\nignores_time = true");
    fs::write(&file, text).unwrap();
    (directory, file)
}

/// Starts a robot on a wire and a run, and waits until it is under way.
fn under_way(name: &str, transport: &str) -> (TempDir, Robot, Run) {
    let (directory, mission) = mission(5.0);
    let mission = mission.to_str().unwrap();
    let mut robot = Robot::start(mission, transport, "127.0.0.1:0");
    let scheme = match transport {
        "udp" => "",
        "tcp" => "tcp://",
        _ => "serial://",
    };
    let address = format!("robot.address=\"{scheme}{}\"", robot.listening);
    let mut run = Run::start(name, mission, &["--set", &address]);
    run.wait_until_driving();
    robot.wait_until_driven(0.3);
    (directory, robot, run)
}

fn guards(run: &Run) -> Vec<u32> {
    let directory = run.directory();
    let is_guard = |id: &u32| {
        let line = fs::read_to_string(format!("/proc/{id}/cmdline")).unwrap_or_default();
        let words: Vec<_> = line.split('\0').collect();
        words.contains(&"stop-guard") && words.contains(&directory.to_str().unwrap())
    };
    let entries = fs::read_dir("/proc").unwrap().flatten();
    entries.filter_map(|entry| entry.file_name().to_str()?.parse().ok()).filter(is_guard).collect()
}

fn stages(status: &Value) -> Vec<u32> {
    let stages = status["stages"].as_array().unwrap();
    stages.iter().map(|stage| pid(status, stage["name"].as_str().unwrap())).collect()
}

fn stands_after_kills(transport: &str) {
    // The frozen supervisor cannot start another link.
    let (_directory, mut robot, run) = under_way(&format!("sl-{transport}"), transport);
    let status = run.status().unwrap();
    run.signal(Signal::STOP);
    signal_process(pid(&status, "link"), Signal::KILL);
    robot.wait_until_at_rest();

    // Each stage ends with its parent, including the link.
    let (_directory, mut robot, mut run) = under_way(&format!("ss-{transport}"), transport);
    run.kill();
    robot.wait_until_at_rest();

    // systemd does this with a unit: it kills all processes at once, then runs ExecStopPost.
    let (_directory, mut robot, mut run) = under_way(&format!("sa-{transport}"), transport);
    let status = run.status().unwrap();
    let mut all = guards(&run);
    assert_eq!(all.len(), 1, "a guard for the link");
    all.extend(stages(&status));
    run.signal(Signal::KILL);
    for process in all {
        signal_process(process, Signal::KILL);
    }
    run.reap();
    let stopped = output(&["stop", "--robot", &run.robot]);
    robot.wait_until_at_rest();
    assert!(stopped.status.success(), "{stopped:?}");
}

#[test]
fn a_robot_on_datagrams_stands_after_kills_of_its_link_its_supervisor_or_all() {
    stands_after_kills("udp");
}

#[test]
fn a_robot_on_a_connection_stands_after_kills_of_its_link_its_supervisor_or_all() {
    stands_after_kills("tcp");
}

#[test]
fn a_robot_on_a_serial_line_stands_after_kills_of_its_link_its_supervisor_or_all() {
    stands_after_kills("pty");
}

/// Forwards the host's bytes without the commands that `ignored` selects.
fn without(ignored: fn(&Command) -> bool) -> Box<Pass> {
    let mut decoder = Decoder::default();
    Box::new(move |bytes| {
        decoder.push(bytes);
        let mut passed = Vec::new();
        while let Some(frame) = decoder.next_frame() {
            if !Command::parse(&frame).is_ok_and(|command| ignored(&command)) {
                frame.encode(&mut passed);
            }
        }
        passed
    })
}

fn stands(motion: &Motion) -> bool {
    [0, 1].into_iter().all(|channel| motion.targets.of(channel).is_none_or(|target| target == 0))
}

fn is_velocity_0(command: &Command) -> bool {
    matches!(command, Command::Motion(motion) if stands(motion))
}

fn is_any_stop(command: &Command) -> bool {
    let slows = matches!(command, Command::Motion(motion) if motion.limit_ms.is_none());
    slows || is_velocity_0(command) || matches!(command, Command::Enable { on: false, .. })
}

/// Starts a run to a close target with a robot that ignores some commands.
fn disobedient(name: &str, ignored: fn(&Command) -> bool) -> (TempDir, Robot, Proxy, Run) {
    let (directory, mission) = mission(0.6);
    let mission = mission.to_str().unwrap();
    let robot = Robot::start(mission, "udp", "127.0.0.1:0");
    let proxy = Proxy::before(&robot, without(ignored), Box::new(<[u8]>::to_vec));
    let run = Run::start(name, mission, &["--set", &proxy.as_robot()]);
    (directory, robot, proxy, run)
}

#[test]
fn no_mission_ends_before_a_robot_rests_that_ignores_velocity_0_and_obeys_disable() {
    let (_directory, mut robot, _proxy, run) = disobedient("sd-disable", is_velocity_0);
    let (code, summary) = run.finish();
    assert!(robot.is_at_rest(), "{summary}");
    let outcome = summary["outcome"].as_str().unwrap();
    assert!(["reached", "wrong_place"].contains(&outcome), "{summary}");
    assert_eq!(code, Some(if outcome == "reached" { 0 } else { 9 }), "{summary}");
}

/// Whether the robot of the next test gets no stop.
static IS_DEAF: AtomicBool = AtomicBool::new(true);

#[test]
fn a_robot_that_gets_no_stop_has_an_outcome_of_its_own_and_a_guard_that_stops_it_after_the_run() {
    let name = "sd-nothing";
    let (_directory, mut robot, _proxy, mut run) =
        disobedient(name, |command| IS_DEAF.load(Ordering::Relaxed) && is_any_stop(command));
    let directory = run.directory();
    let began = Instant::now();
    while !fs::metadata(directory.join("summary.json")).is_ok_and(|file| file.len() > 2) {
        assert!(run.is_running(), "the run ended while its robot moves");
        assert!(began.elapsed() < PATIENCE, "no summary");
        robot.wait_for_a_tick();
    }
    let status = run.wait_until("the link tells it to stand", |status| {
        find(status, "link")["state"] == "running"
    });
    assert_eq!(status["link"]["at_rest"], false, "{status}");
    let stop = ["stop", "--robot", name];
    refused(&stop, "not-at-rest", &["it moves"]);
    run.keeps_guard = true;
    run.signal(Signal::TERM);
    let (code, summary) = run.finish();
    assert_eq!(summary["outcome"], "could_not_be_stopped", "{summary}");
    assert_eq!(code, Some(10), "{summary}");
    refused(&stop, "not-at-rest", &["it moves"]);
    let status = output(&["status", "--robot", name]);
    assert!(String::from_utf8_lossy(&status.stdout).contains("it moves"), "{status:?}");
    IS_DEAF.store(false, Ordering::Relaxed);
    robot.wait_until_at_rest();
    wait_until("the guard leaves", || !domain(name).directory().exists());
}

fn stops_without_middleware(name: &str, damage: impl Fn(&Run)) {
    let (_directory, mut robot, run) = under_way(name, "udp");
    damage(&run);
    let stopped = output(&["stop", "--robot", name]);
    assert!(stopped.status.success(), "{stopped:?}");
    assert!(robot.is_at_rest(), "{stopped:?}");
}

#[test]
fn an_operator_stops_a_robot_whose_supervisor_is_frozen() {
    stops_without_middleware("so-frozen", |run| run.signal(Signal::STOP));
}

fn remove_directory_of(robot: &str) {
    // Its processes may recreate a part meanwhile.
    wait_until("it is removed", || fs::remove_dir_all(domain(robot).directory()).is_ok());
}

#[test]
fn an_operator_stops_a_robot_whose_directory_was_removed_and_its_supervisor_frozen() {
    stops_without_middleware("so-directory", |run| {
        run.signal(Signal::STOP);
        remove_directory_of(&run.robot);
    });
}

#[test]
fn a_robot_whose_directory_is_removed_again_and_again_is_stopped_resumed_sent_and_leaves_nothing() {
    let robot = "so-cleaned";
    let (_directory, mut body, mut run) = under_way(robot, "udp");
    let domain = domain(robot);
    for what in [&["stop"][..], &["resume"], &["goto", "4", "0"], &["stop"], &["resume"]] {
        remove_directory_of(robot);
        operate(robot, what);
        match what[0] {
            "stop" => assert!(body.is_at_rest()),
            _ => drop(run.wait_until_driving()),
        }
    }
    remove_directory_of(robot);
    // The robot's name stays taken, although its file is removed.
    refused(&["run", "open-room", "--robot", robot], "supervised", &[robot]);
    run.wait_until("it is found", |_| domain.lock_file().exists());
    assert!(logged(&run.directory(), "supervisor", &["files of the robot were removed"]) > 0);
    fs::remove_file(domain.lock_file()).unwrap();
    fs::remove_file(domain.middleware_config()).unwrap();
    run.wait_until("it is found", |_| domain.lock_file().exists());
    remove_directory_of(robot);
    run.stop();
}

#[test]
fn a_robot_without_its_files_of_the_middleware_is_stopped_and_its_run_leaves_nothing() {
    let robot = "so-memory";
    let (_directory, mut body, run) = under_way(robot, "udp");
    for path in shared_memory(&domain(robot).shared_memory_prefix()) {
        let removed = if path.is_dir() { fs::remove_dir_all(path) } else { fs::remove_file(path) };
        removed.unwrap();
    }
    let stopped = output(&["stop", "--robot", robot]);
    assert!(stopped.status.success(), "{stopped:?}");
    assert!(body.is_at_rest());
    run.stop();
}

#[test]
fn an_operator_stops_a_robot_whose_bus_is_damaged() {
    let files = |run: &Run| {
        let user = rustix::process::geteuid().as_raw();
        let prefix = format!("fh{user}_{}_", run.robot);
        let files = fs::read_dir("/dev/shm").unwrap().flatten();
        files.filter(move |file| file.file_name().to_str().unwrap().starts_with(&prefix))
    };
    stops_without_middleware("so-truncated", |run| {
        run.signal(Signal::STOP);
        for file in files(run).filter(|file| file.file_type().unwrap().is_file()) {
            fs::File::options().write(true).open(file.path()).unwrap().set_len(0).unwrap();
        }
    });
    stops_without_middleware("so-removed", |run| {
        for file in files(run) {
            let removed = match file.file_type().unwrap().is_dir() {
                true => fs::remove_dir_all(file.path()),
                false => fs::remove_file(file.path()),
            };
            removed.unwrap();
        }
    });
}

#[test]
fn a_second_ctrl_c_ends_a_run_that_draws_its_picture() {
    let mut run = Run::under_way("drawing", "open-room", &["--pace", "1"], 0.5);
    // A write into a pipe without a reader blocks forever.
    let picture = run.directory().join("picture.svg");
    assert!(std::process::Command::new("mkfifo").arg(&picture).status().unwrap().success());
    run.signal(Signal::INT);
    wait_until("the summary is written", || {
        fs::read_to_string(run.directory().join("summary.json")).is_ok_and(|text| text.len() > 1)
    });
    wait_until("the run ends", || {
        run.signal(Signal::INT);
        !run.is_running()
    });
    let (code, summary) = run.finish();
    assert_eq!((code, summary["outcome"].as_str()), (Some(0), Some("aborted")));
}
