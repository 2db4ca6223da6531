//! Tests that a robot stops after any failure of its driving processes. The robots are separate
//! processes without command time limits, so they drive on unless stopped.

use std::{
    fs,
    path::Path,
    sync::{Arc, Mutex},
    thread,
    time::{Duration, Instant},
};

use common::wire::{Addressing, Command, Decoder, Motion, Report};
use rustix::process::Signal;
use tempfile::TempDir;

use crate::support::{
    Run, STAGES, assert_ended, domain, find, logged, mission_file, operate, output, pid, printed,
    processes_with, refused, shared_memory, signal_process, wait_until,
    wire::{Pass, Proxy, Robot},
};

fn mission(target_m: f64) -> (TempDir, String) {
    mission_file(&format!("target = [{target_m}, 0]\n[simulation]\nignores_time = true"))
}

/// Starts a robot on a wire and a run, and waits until it is under way.
fn under_way(name: &str, transport: &str) -> (TempDir, Robot, Run) {
    let (directory, mission) = mission(5.0);
    let mut robot = Robot::start(&mission, transport, "127.0.0.1:0");
    let mut run = Run::start(name, &mission, &robot.as_robot());
    run.wait_until_driving();
    robot.wait_until_driven(0.3);
    (directory, robot, run)
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
    let mut all = processes_with(&run.robot, "stop-guard");
    assert_eq!(all.len(), 1, "a guard for the link");
    all.extend(STAGES.map(|stage| pid(&status, stage)));
    run.signal(Signal::KILL);
    for process in all {
        signal_process(process, Signal::KILL);
    }
    run.reap();
    printed(&["stop", "--robot", &run.robot]);
    robot.wait_until_at_rest();
}

#[test]
fn a_robot_on_any_wire_stands_after_kills_of_its_link_its_supervisor_or_all() {
    thread::scope(|scope| {
        for transport in ["udp", "tcp", "pty"] {
            scope.spawn(move || stands_after_kills(transport));
        }
    });
}

fn is_any_stop(command: &Command) -> bool {
    let stands = |motion: &Motion| {
        [0, 1].into_iter().all(|channel| motion.targets.of(channel).is_none_or(|it| it == 0))
    };
    match command {
        Command::Motion(motion) => motion.limit_ms.is_none() || stands(motion),
        Command::Enable { on, .. } => !on,
        _ => false,
    }
}

/// Fault of a wire, which a test changes.
#[derive(Clone, Copy, PartialEq)]
enum Fault {
    None,
    /// No stop reaches the robot.
    NoStop,
    /// No motor frame reaches the link.
    NoFrame,
    /// The encoders count at random.
    Random,
}

struct Wire {
    proxy: Proxy,
    fault: Arc<Mutex<Fault>>,
}

impl Wire {
    fn before(robot: &Robot, fault: Fault) -> Self {
        let shared = Arc::new(Mutex::new(fault));
        let (out, back) = (Arc::clone(&shared), Arc::clone(&shared));
        let mut decoder = Decoder::default();
        let to_robot: Box<Pass> = Box::new(move |bytes| {
            decoder.push(bytes);
            let mut passed = Vec::new();
            while let Some(frame) = decoder.next_frame() {
                let stops = Command::parse(&frame).is_ok_and(|command| is_any_stop(&command));
                if !stops || *out.lock().unwrap() != Fault::NoStop {
                    frame.encode(&mut passed);
                }
            }
            passed
        });
        let (mut decoder, mut frames) = (Decoder::default(), 0_u16);
        let to_link: Box<Pass> = Box::new(move |bytes| {
            decoder.push(bytes);
            let mut passed = Vec::new();
            while let Some(frame) = decoder.next_frame() {
                let Ok(mut report) = Report::parse(&frame) else { continue };
                if let Report::Motor(sensors) = &mut report {
                    frames = frames.wrapping_add(1);
                    let random = |factor| frames.wrapping_mul(factor) % 32_768;
                    match *back.lock().unwrap() {
                        Fault::NoFrame => continue,
                        Fault::Random => {
                            sensors.encoders[0].position = random(9973);
                            sensors.encoders[1].position = random(20_011);
                        }
                        _ => {}
                    }
                }
                report.encode(Addressing::default(), &mut passed);
            }
            passed
        });
        Self { proxy: Proxy::before(robot, to_robot, to_link), fault: shared }
    }

    fn set(&self, fault: Fault) {
        *self.fault.lock().unwrap() = fault;
    }
}

#[test]
fn a_robot_that_gets_no_stop_has_an_outcome_of_its_own_and_a_guard_that_stops_it_after_the_run() {
    let name = "sd-nothing";
    let (_directory, mission) = mission(0.6);
    let mut robot = Robot::start(&mission, "udp", "127.0.0.1:0");
    let wire = Wire::before(&robot, Fault::NoStop);
    let mut run = Run::start(name, &mission, &wire.proxy.as_robot());
    let directory = run.directory();
    wait_until("there is a summary", || {
        assert!(run.is_running(), "the run ended while its robot moves");
        fs::metadata(directory.join("summary.json")).is_ok_and(|file| file.len() > 2)
    });
    let status = run.wait_until("the link tells it to stand", |status| {
        find(status, "link")["state"] == "running"
    });
    assert_eq!(status["link"]["at_rest"], false, "{status}");
    let stop = ["stop", "--robot", name];
    refused(&stop, "not-at-rest", &["it moves"]);
    run.keeps_guard = true;
    run.signal(Signal::TERM);
    let (code, summary) = run.finish();
    assert_ended(code, &summary, 10, "could_not_be_stopped");
    refused(&stop, "not-at-rest", &["it moves"]);
    let status = output(&["status", "--robot", name]);
    assert!(String::from_utf8_lossy(&status.stdout).contains("it moves"), "{status:?}");
    wire.set(Fault::None);
    robot.wait_until_at_rest();
    wait_until("the guard leaves", || !domain(name).directory().exists());
}

/// Longest time from a signal to the end of a run without wheel reports, including machine load.
const ENDS_WITHIN: Duration = Duration::from_secs(15);

#[test]
fn a_robot_without_usable_motor_frames_is_said_to_be_unknown_and_the_first_signal_ends_its_run() {
    let ends = |robot: &str, before: Fault, fault: Fault| {
        let mut body = Robot::on_the_course();
        let wire = Wire::before(&body, before);
        let mut run = Run::start(robot, "obstacle-course", &wire.proxy.as_robot());
        if before == Fault::None {
            body.wait_until_driven(0.1);
            wire.set(fault);
        }
        run.wait_until("the link stands", |status| {
            let link = &status["link"];
            link["connected"] == true && link["stopped"] == true && link["at_rest"] == false
        });
        refused(&["stop", "--robot", robot], "not-at-rest", &["whether it rests is unknown"]);
        run.signal(Signal::INT);
        let began = Instant::now();
        run.reap();
        assert!(began.elapsed() < ENDS_WITHIN, "{robot}: {:?}", began.elapsed());
        let summary = run.ends(0, "aborted");
        let reason = summary["reason"].as_str().unwrap();
        assert!(reason.contains("whether it rests is unknown: no usable motor fr"), "{reason}");
    };
    thread::scope(|scope| {
        scope.spawn(|| ends("fi-unheard", Fault::NoFrame, Fault::NoFrame));
        scope.spawn(|| ends("fi-lost", Fault::None, Fault::NoFrame));
        scope.spawn(|| ends("fi-useless", Fault::None, Fault::Random));
    });
}

fn remove_directory_of(robot: &str) {
    // Its processes may recreate a part meanwhile.
    wait_until("it is removed", || fs::remove_dir_all(domain(robot).directory()).is_ok());
}

/// Truncates or removes the robot's files of the middleware.
fn damage_bus(robot: &str, damage: fn(&Path)) {
    shared_memory(&domain(robot).shared_memory_prefix()).iter().for_each(|path| damage(path));
}

fn remove(path: &Path) {
    // Its processes remove some files themselves.
    let removed = fs::remove_file(path).or_else(|_| fs::remove_dir_all(path));
    assert!(!path.exists(), "{}: {removed:?}", path.display());
}

fn truncate(path: &Path) {
    if path.is_file() {
        fs::File::options().write(true).open(path).unwrap().set_len(0).unwrap();
    }
}

#[test]
fn an_operator_stops_a_robot_whose_supervisor_is_frozen_or_whose_files_are_damaged() {
    let is_stopped = |name: &str, damage: &dyn Fn(&Run)| {
        let (_directory, mut robot, run) = under_way(name, "udp");
        damage(&run);
        operate(name, "stop");
        assert!(robot.is_at_rest(), "{name}");
        run
    };
    let frozen: [(_, fn(&str)); 3] = [
        ("so-frozen", |_| ()),
        ("so-directory", remove_directory_of),
        ("so-truncated", |robot| damage_bus(robot, truncate)),
    ];
    thread::scope(|scope| {
        for (name, damage) in frozen {
            scope.spawn(move || {
                is_stopped(name, &|run| {
                    run.signal(Signal::STOP);
                    damage(&run.robot);
                });
            });
        }
        is_stopped("so-removed", &|run| damage_bus(&run.robot, remove)).stop();
    });
}

#[test]
fn a_robot_whose_directory_is_removed_again_and_again_is_stopped_resumed_sent_and_leaves_nothing() {
    let robot = "so-cleaned";
    let (_directory, mut body, mut run) = under_way(robot, "udp");
    let domain = domain(robot);
    for what in ["stop", "resume", "goto 4 0", "stop", "resume"] {
        remove_directory_of(robot);
        operate(robot, what);
        match what {
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
fn a_second_ctrl_c_ends_a_run_that_draws_its_picture() {
    let mut run = Run::under_way("drawing", "open-room", "--pace 1", 0.5);
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
    assert_ended(code, &summary, 0, "aborted");
}
