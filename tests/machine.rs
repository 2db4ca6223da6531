//! Tests of the machine around a run: a stall, a full disk, full memory, few descriptors.

use std::{
    fs::{self, File},
    io,
    process::Stdio,
    thread,
    time::Duration,
};

use crate::support::{
    ENDLESS, Run, STAGES, all_run, assert_no_restart, assert_nothing_left, assert_refused,
    assert_said, directory_of, domain, find, firsthand, firsthand_under, generation, on_small_disk,
    on_small_shared_memory, pid, reached, records, refused, signal_process, start_piped,
    wait_for_status, wait_until, words,
};
use rustix::process::Signal;
use serde_json::Value;

fn descriptors(process: u32) -> usize {
    fs::read_dir(format!("/proc/{process}/fd")).unwrap().count()
}

#[test]
fn stages_are_not_taken_for_hung_when_the_supervisor_stood_still_with_them() {
    let mut run = Run::start("mach-still", "open-room", ENDLESS);
    let status = run.wait_until_under_way(0.5);
    let stages = STAGES.map(|stage| pid(&status, stage));
    for _ in 0..4 {
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
    // A stage that starts while its supervisor has all its files open inherits none.
    let status = run.kill_and_await_successor("planner", Signal::KILL);
    let (own, supervisors) = (descriptors(pid(&status, "planner")), descriptors(run.pid()));
    // A stage opens 61 descriptors. A leak would add 86 of the supervisor's approximately 200.
    assert!(2 * own < supervisors, "{own} of {supervisors}");
    run.stop();
}

#[test]
fn a_full_disk_ends_no_mission_and_loses_no_result() {
    on_small_disk(8, |disk| {
        let robot = "mach-full";
        let out = disk.path().join("run");
        // The robot arrives only after the second look at its stages.
        let slow = "--pace 2 --set controller.speed_m_s=0.25";
        let mut run = firsthand(&["run", "obstacle-course", "--robot", robot, "--json"]);
        run.args(words(slow)).args(["--set", "sure_within_m=9", "--out"]).arg(&out);
        let run = start_piped(run.stderr(Stdio::piped()));
        wait_for_status(robot, |status| status["mission_time_s"].as_f64() > Some(1.0));
        disk.fill();
        for stage in STAGES {
            let before = wait_for_status(robot, all_run);
            signal_process(pid(&before, stage), Signal::KILL);
            wait_for_status(robot, |status| {
                let newer = generation(status, stage) > generation(&before, stage);
                newer && find(status, stage)["state"] == "running"
            });
        }
        let ended = run.wait_with_output().unwrap();
        assert_eq!(records(&out.join("summary.json")), [reached(&ended)]);
        // The message names the lost file.
        assert_said(&ended, &["picture.svg"]);
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
        let is_summary = |file: io::Result<fs::DirEntry>| {
            file.unwrap().file_name().to_string_lossy().starts_with("summary")
        };
        assert!(!fs::read_dir(out).unwrap().any(is_summary));
        assert_nothing_left(robot);
    });
}

#[test]
fn shared_memory_that_is_full_is_refused_at_the_start_and_harms_no_run_later() {
    on_small_shared_memory(96, |memory| {
        let robot = "mach-shm";
        memory.fill();
        let runs = directory_of(robot);
        let run = ["run", "open-room", "--robot", robot, "--runs", runs.path().to_str().unwrap()];
        refused(&run, "shared-memory", &["--shm-size", "firsthand doctor"]);
        memory.empty();
        let run = Run::under_way(robot, "obstacle-course", "--pace 4", 0.3);
        memory.fill();
        assert_no_restart(&run.arrives());
    });
}

#[test]
fn a_supervisor_waits_for_one_that_was_killed_a_moment_ago() {
    let domain = domain("mach-gone");
    fs::create_dir_all(domain.directory()).unwrap();
    let held = File::create(domain.lock_file()).unwrap();
    held.lock().unwrap();
    let run = Run::at_own_speed("mach-gone", "open-room", "");
    // The supervisor logs before it locks, and retries for a second.
    wait_until("it logs", || run.directory().join("supervisor.log").exists());
    thread::sleep(Duration::from_millis(100));
    drop(held);
    run.arrives();
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
