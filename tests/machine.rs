//! Tests of the machine around a run: a stall, a full disk, a closed terminal, a suspension.

use std::{
    fs::{self, File},
    io,
    os::unix::fs::{FileTypeExt as _, MetadataExt as _},
    path::Path,
    process::{Command, Stdio},
    thread,
    time::Duration,
};

use crate::support::{
    self, Run, STAGES, all_run, assert_nothing_left, assert_reached, assert_refused, directory_of,
    find, firsthand, firsthand_under, generation, json_of, on_small_disk, on_small_shared_memory,
    output, pid, refused, signal_process, start_quietly,
};
use rustix::process::Signal;
use serde_json::Value;

/// Speed at which a mission outlasts its test, which stops it.
const SLOW: [&str; 6] =
    ["--pace", "1", "--set", "controller.speed_m_s=0.002", "--timeout", "80000"];

#[test]
fn stages_are_not_taken_for_hung_when_the_supervisor_stood_still_with_them() {
    let mut run = Run::start("mach-still", "open-room", &SLOW);
    let status = run.wait_until_under_way(0.5);
    let stages = STAGES.map(|stage| pid(&status, stage));
    for _ in 0..6 {
        let all = [&[run.pid()][..], &stages].concat();
        for &process in &all {
            signal_process(process, Signal::STOP);
        }
        thread::sleep(Duration::from_millis(800));
        for &process in all.iter().rev() {
            signal_process(process, Signal::CONT);
        }
        let status = run.wait_until_driving();
        assert_eq!(STAGES.map(|stage| pid(&status, stage)), stages, "{status}");
    }
    assert_eq!(run.records("deaths.jsonl"), Vec::<Value>::new());
    run.stop();
}

#[test]
fn a_full_disk_ends_no_mission_and_loses_no_result() {
    on_small_disk(8, |disk| {
        let robot = "mach-full";
        let out = disk.path().join("run");
        // The robot arrives only after the second look at its stages.
        let slow = ["--pace", "2", "--set", "controller.speed_m_s=0.25"];
        let run = firsthand(&["run", "obstacle-course", "--robot", robot, "--json"])
            .args(slow)
            .args(["--set", "sure_within_m=9", "--out"])
            .arg(&out)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        support::wait_for_status(robot, |status| status["mission_time_s"].as_f64() > Some(1.0));
        disk.fill();
        for stage in STAGES {
            let before = support::wait_for_status(robot, all_run);
            signal_process(pid(&before, stage), Signal::KILL);
            support::wait_for_status(robot, |status| {
                let newer = generation(status, stage) > generation(&before, stage);
                newer && find(status, stage)["state"] == "running"
            });
        }
        let ended = run.wait_with_output().unwrap();
        let (exit, printed) = json_of(&ended);
        assert_reached(exit.code(), &printed[0]);
        assert_eq!(support::records(&out.join("summary.json")), printed);
        // The message names the lost file.
        let said = String::from_utf8(ended.stderr).unwrap();
        assert!(said.contains("picture.svg"), "{said}");
        assert_nothing_left(robot);
    });
}

#[test]
fn a_disk_without_room_for_the_result_is_told_before_the_start_and_names_the_file() {
    on_small_disk(1, |disk| {
        let out = disk.path().join("run");
        fs::create_dir(&out).unwrap();
        disk.fill();
        let robot = "mach-none";
        let out = out.to_str().unwrap();
        let run = ["run", "open-room", "--robot", robot, "--out", out];
        assert_eq!(refused(&run, "disk-full", &["summary.json"]), Some(1));
        disk.empty();
        // The disk has space for the summary, but not for the other files of a run.
        assert_eq!(refused(&run, "disk-full", &[out, "KiB"]), Some(1));
        assert_eq!(fs::read_dir(out).unwrap().filter(is_summary).count(), 0);
        assert_nothing_left(robot);
    });
}

fn is_summary(file: &io::Result<fs::DirEntry>) -> bool {
    let name = file.as_ref().unwrap().file_name();
    name.to_string_lossy().starts_with("summary")
}

#[test]
fn shared_memory_that_is_full_is_refused_at_the_start_and_harms_no_run_later() {
    on_small_shared_memory(96, |memory| {
        let robot = "mach-shm";
        memory.fill();
        let run = ["run", "open-room", "--robot", robot, "--runs"];
        let runs = directory_of(robot);
        let runs = runs.path().to_str().unwrap();
        refused(
            &[&run[..], &[runs]].concat(),
            "shared-memory",
            &["--shm-size", "firsthand doctor"],
        );
        memory.empty();
        let run = Run::under_way(robot, "obstacle-course", &["--pace", "4"], 0.3);
        memory.fill();
        let summary = run.arrives();
        support::assert_no_restart(&summary);
    });
}

#[test]
fn a_wrongly_written_mission_has_an_exit_code_that_the_units_do_not_try_again() {
    let directory = tempfile::tempdir().unwrap();
    let wrong = directory.path().join("wrong.toml");
    fs::write(&wrong, "target = [3, 0]\nspeed = 1\n").unwrap();
    let wrong = wrong.to_str().unwrap();
    let runs = directory.path().join("runs");
    let runs = runs.to_str().unwrap();
    let address = ["open-room", "--set", "robot.address='nowhere'"];
    let planner = ["open-room", "--set", "planner.executable='/no/planner'"];
    for (mission, code) in [
        (&[wrong][..], "mission"),
        (&["/no/such/mission.toml"], "mission"),
        (&address, "mission"),
        (&planner, "planner-executable"),
    ] {
        let run = ["run", "--robot", "mach-wrong", "--runs", runs];
        let exit = refused(&[&run, mission].concat(), code, &[]);
        assert_eq!(exit, Some(78), "{mission:?}");
    }
    for unit in ["firsthand", "firsthand-watch"] {
        let file = format!("{}/../systemd/{unit}.service", env!("CARGO_MANIFEST_DIR"));
        let unit = fs::read_to_string(&file).unwrap();
        let setting = |key: &str| unit.lines().find_map(|line| line.strip_prefix(key));
        let never = setting("RestartPreventExitStatus=").unwrap();
        assert!(never.split(' ').any(|code| code == "78"), "{file}: {never}");
        assert!(setting("ExecStopPost=").unwrap().contains(" stop --robot "), "{file}");
        assert!(setting("ExecStart=").unwrap().contains(" --keep "), "{file}");
        assert_eq!(setting("LimitCORE="), None, "{file}");
    }
}

#[test]
fn a_robot_that_is_off_leaves_no_directory_start_by_start() {
    let runs = directory_of("mach-off");
    for _ in 0..2 {
        let mut run = firsthand(&["run", "open-room", "--robot", "mach-off", "--runs"]);
        // This address is unused.
        let address = ["--set", "robot.address='127.0.0.1:9'"];
        let mut run = start_quietly(run.arg(runs.path()).args(address));
        support::wait_for_status("mach-off", all_run);
        signal_process(run.id(), Signal::TERM);
        run.wait().unwrap();
        assert_eq!(fs::read_dir(runs.path()).unwrap().count(), 0);
    }
    assert_nothing_left("mach-off");
}

#[test]
fn the_robot_of_another_user_is_named_and_not_said_to_be_missing() {
    // File with the name of this user's bus, except for the user's number.
    let bus = Path::new("/dev/shm/fh54321_mach-whose_bus");
    fs::create_dir_all(bus).unwrap();
    let status = output(&["status", "--robot", "mach-whose"]);
    fs::remove_dir(bus).unwrap();
    assert_refused(&status, "not-running", &["54321"]);
}

/// Returns the exit code of a command with a closed standard output. A panic would be 101.
fn unread(arguments: &[&str]) -> Option<i32> {
    let (reader, writer) = io::pipe().unwrap();
    drop(reader);
    let status = firsthand(arguments).stdout(writer).status();
    status.unwrap().code()
}

#[test]
fn a_closed_standard_output_is_no_failure_of_any_command() {
    let directory = directory_of("mach-shut");
    let mission = format!("{}/../missions/trap.toml", env!("CARGO_MANIFEST_DIR"));
    let run = Run::under_way("mach-shut", "open-room", &SLOW, 0.3);
    let out = directory.path().join("run");
    let out = out.to_str().unwrap();
    let commands: [&[&str]; 11] = [
        &["missions"],
        &["missions", "trap"],
        &["check", &mission],
        &["install", "--print"],
        &["topic", "list"],
        &["stage", "list"],
        &["table", "failsafe"],
        &["help", "tables"],
        &["status", "--robot", "mach-shut"],
        &["status", "--robot", "mach-shut", "--json"],
        &["run", "open-room", "--robot", "mach-shut2", "--out", out],
    ];
    for command in commands {
        assert_eq!(unread(command), Some(0), "{command:?}");
    }
    run.stop();
}

fn descriptors(process: u32) -> usize {
    fs::read_dir(format!("/proc/{process}/fd")).unwrap().count()
}

#[test]
fn a_stage_inherits_no_descriptor_of_its_supervisor() {
    let mut run = Run::under_way("mach-fds", "open-room", &SLOW, 0.3);
    // The stage started when its supervisor had all its files open.
    let status = run.kill_and_await_successor("planner", Signal::KILL);
    let (own, supervisors) = (descriptors(pid(&status, "planner")), descriptors(run.pid()));
    // A stage has 61 descriptors of its own. It would inherit 86 of its supervisor's some 200.
    assert!(2 * own < supervisors, "{own} of {supervisors}");
    run.stop();
}

#[test]
fn a_checkpoint_of_another_version_is_refused_by_name_and_not_taken_for_none() {
    let mut run = Run::under_way("mach-vers", "open-room", &SLOW, 0.5);
    run.kill();
    let file = run.directory().join("supervisor.checkpoint");
    let mut bytes = fs::read(&file).unwrap();
    let slots: Vec<_> =
        (0..bytes.len() - 4).filter(|&at| bytes[at..].starts_with(b"FHC")).collect();
    assert!(!slots.is_empty());
    for at in slots {
        bytes[at + 3] = b'1';
    }
    fs::write(&file, bytes).unwrap();
    let directory = run.directory();
    let resume = ["run", "--resume", directory.to_str().unwrap()];
    refused(&resume, "other-version", &["supervisor.checkpoint"]);
    assert_nothing_left("mach-vers");
}

#[test]
fn another_robots_run_is_not_gone_on_with() {
    let runs = directory_of("mach-mine");
    let run = |robot: &str| {
        let mut command = firsthand(&["run", "open-room", "--resume-last", "--robot", robot]);
        start_quietly(command.arg("--runs").arg(runs.path()).args(SLOW))
    };
    let mut first = run("mach-mine");
    support::wait_for_status("mach-mine", |status| status["order"] == "driving");
    let mut second = run("mach-yours");
    support::wait_for_status("mach-yours", |status| status["order"] == "driving");
    assert_eq!(fs::read_dir(runs.path()).unwrap().count(), 2);
    for run in [&mut second, &mut first] {
        signal_process(run.id(), Signal::TERM);
        assert_eq!(run.wait().unwrap().code(), Some(0));
    }
    assert_nothing_left("mach-mine");
    assert_nothing_left("mach-yours");
}

#[test]
fn a_supervisor_waits_for_one_that_was_killed_a_moment_ago() {
    let runs = directory_of("mach-gone");
    let domain = support::domain("mach-gone");
    fs::create_dir_all(domain.directory()).unwrap();
    let held = File::create(domain.lock_file()).unwrap();
    held.lock().unwrap();
    let out = runs.path().join("run");
    let mut run = firsthand(&["run", "open-room", "--robot", "mach-gone", "--out"]);
    let mut run = start_quietly(run.arg(&out));
    // The supervisor logs before it locks, and retries for a second.
    support::wait_until("it logs", || out.join("supervisor.log").exists());
    thread::sleep(Duration::from_millis(100));
    drop(held);
    assert_eq!(run.wait().unwrap().code(), Some(0));
    assert_nothing_left("mach-gone");
}

#[test]
fn a_latency_measurement_removes_no_directory_but_its_own() {
    let user = rustix::process::geteuid().as_raw();
    // Another robot of this user, with its directory below the removed one.
    let run = Run::under_way("mach-lat", "open-room", &SLOW, 0.3);
    let tick = ["bench", "tick", "--robot", support::suite(), "--rounds", "1", "--json"];
    support::printed(&[&tick[..], &["--rate", "max"]].concat());
    let root = fs::metadata(support::domain("mach-lat").directory()).unwrap();
    assert!(root.is_dir() && root.uid() == user);
    assert!(run.status().is_some());
    run.stop();
}

#[test]
fn a_pipe_in_place_of_a_mission_is_refused_by_name_and_not_waited_for() {
    let directory = tempfile::tempdir().unwrap();
    let pipe = directory.path().join("pipe.toml");
    let made = Command::new("mkfifo").arg(&pipe).status().unwrap();
    assert!(made.success() && fs::metadata(&pipe).unwrap().file_type().is_fifo());
    refused(&["check", pipe.to_str().unwrap()], "mission", &["pipe.toml"]);
}

#[test]
fn fewer_descriptors_than_a_supervisor_needs_are_refused_and_as_many_as_it_says_suffice() {
    let directory = tempfile::tempdir().unwrap();
    let run = ["run", "open-room", "--robot", "mach-few", "--runs"];
    let limited_to = |most: &str| {
        let mut limited = firsthand_under(&["prlimit", &format!("--nofile={most}:{most}")], &run);
        limited.arg(directory.path()).output().unwrap()
    };
    let output = limited_to("64");
    assert_refused(&output, "descriptors", &["64"]);
    let said = String::from_utf8(output.stderr).unwrap();
    let (_, needed) = said.split_once("needs ").unwrap();
    let output = limited_to(needed.split_once(';').unwrap().0);
    assert_eq!(output.status.code(), Some(0), "{output:?}");
}

#[test]
fn a_target_where_the_robot_stands_is_reached_in_a_finite_ratio() {
    let directory = directory_of("mach-here");
    let out = directory.path().join("run");
    let run = ["run", "open-room", "--set", "target=[0,0]", "--robot"];
    let out = ["mach-here", "--out", out.to_str().unwrap()];
    let printed = support::printed(&[&run[..], &out].concat());
    assert!(!printed.contains("NaN") && !printed.contains("inf"), "{printed}");
    assert_nothing_left("mach-here");
}
