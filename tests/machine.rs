//! The machine around a run: it stands still, its disk is full, its terminal is closed, it was suspended.

use std::{
    fs::{self, File},
    io::{self, Read as _, Write as _},
    os::unix::fs::{FileTypeExt as _, MetadataExt as _},
    path::{Path, PathBuf},
    process::{Command, Stdio},
    thread,
    time::{Duration, Instant},
};

use crate::support::{
    self, Run, STAGES, assert_nothing_left, directory_of, find, firsthand, output, pid,
    signal_process,
};
use rustix::process::Signal;
use serde_json::Value;

/// So long a mission goes on: every test below stops it, or lets it arrive.
const SLOW: [&str; 6] = [
    "--pace",
    "1",
    "--set",
    "controller.speed_m_s=0.002",
    "--timeout",
    "80000",
];

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
        // What is tested is how long it lasts: longer than a stage may go without a beat.
        thread::sleep(Duration::from_millis(800));
        for &process in all.iter().rev() {
            signal_process(process, Signal::CONT);
        }
        let status = run.wait_until("it drives", |status| status["order"] == "driving");
        assert_eq!(STAGES.map(|stage| pid(&status, stage)), stages, "{status}");
    }
    assert_eq!(run.records("deaths.jsonl"), Vec::<Value>::new());
    run.signal(Signal::INT);
    assert_eq!(run.finish().0, Some(0));
    assert_nothing_left("mach-still");
}

/// A file system of so many MiB at `directory` until this is dropped. The tests of a full disk need root for it, and say
/// so instead of passing without.
struct Disk(PathBuf);

impl Disk {
    fn mount(directory: &Path, mebibytes: u32) -> Self {
        fs::create_dir_all(directory).unwrap();
        let size = format!("size={mebibytes}m");
        let mounted = Command::new("mount")
            .args(["-t", "tmpfs", "-o", &size, "tmpfs"])
            .arg(directory)
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&mounted.stderr);
        assert!(
            mounted.status.success(),
            "a full disk needs a file system of its own: run this test as root ({said})"
        );
        Self(directory.to_owned())
    }

    /// Use up what is free.
    fn fill(&self) {
        let mut file = File::create(self.0.join("filler")).unwrap();
        let full = |error: io::Error| error.kind() == io::ErrorKind::StorageFull;
        let bytes = [1; 4096];
        let refused = std::iter::repeat_with(|| file.write_all(&bytes)).find_map(Result::err);
        assert!(refused.is_some_and(full));
    }
}

impl Drop for Disk {
    fn drop(&mut self) {
        let _ = Command::new("umount").arg("-l").arg(&self.0).status();
    }
}

#[test]
fn a_disk_that_is_full_ends_no_mission_and_loses_no_result() {
    let directory = directory_of("mach-full");
    let disk = Disk::mount(&directory.path().join("disk"), 8);
    let out = disk.0.join("run");
    let mut run = firsthand(&["run", "obstacle-course", "--robot", "mach-full", "--json"])
        .args(["--pace", "4", "--out"])
        .arg(&out)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let under_way = |status: &Value| status["mission_time_s"].as_f64().unwrap() > 1.0;
    support::wait_for_status("mach-full", under_way);
    disk.fill();
    for stage in STAGES {
        let status = support::wait_for_status("mach-full", |status| {
            find(status, stage)["state"] == "running"
        });
        let generation = find(&status, stage)["generation"].as_u64();
        signal_process(pid(&status, stage), Signal::KILL);
        support::wait_for_status("mach-full", |status| {
            let stage = find(status, stage);
            stage["state"] == "running" && stage["generation"].as_u64() > generation
        });
    }
    let mut said = String::new();
    run.stdout
        .take()
        .unwrap()
        .read_to_string(&mut said)
        .unwrap();
    let mut complaints = String::new();
    run.stderr
        .take()
        .unwrap()
        .read_to_string(&mut complaints)
        .unwrap();
    assert_eq!(run.wait().unwrap().code(), Some(0), "{said}{complaints}");
    let printed: Value = serde_json::from_str(&said).unwrap();
    assert_eq!(printed["outcome"], "reached", "{printed}");
    let kept = fs::read_to_string(out.join("summary.json")).unwrap();
    assert_eq!(serde_json::from_str::<Value>(&kept).unwrap(), printed);
    // What was lost is named.
    assert!(complaints.contains("picture.svg"), "{complaints}");
    assert_nothing_left("mach-full");
}

#[test]
fn a_disk_without_room_for_the_result_is_told_before_the_start_and_names_the_file() {
    let directory = directory_of("mach-none");
    let disk = Disk::mount(&directory.path().join("disk"), 1);
    fs::create_dir(disk.0.join("run")).unwrap();
    disk.fill();
    let out = disk.0.join("run");
    let refused = output(&[
        "run",
        "open-room",
        "--robot",
        "mach-none",
        "--out",
        out.to_str().unwrap(),
    ]);
    let said = String::from_utf8(refused.stderr).unwrap();
    assert_eq!(refused.status.code(), Some(1), "{said}");
    assert!(
        said.contains("summary.json") && said.contains("full"),
        "{said}"
    );
    assert_nothing_left("mach-none");
}

#[test]
fn a_wrongly_written_mission_has_an_exit_code_that_the_units_do_not_try_again() {
    let directory = tempfile::tempdir().unwrap();
    let wrong = directory.path().join("wrong.toml");
    fs::write(&wrong, "target = [3, 0]\nspeed = 1\n").unwrap();
    let wrong = wrong.to_str().unwrap();
    let runs = directory.path().join("runs");
    let run = |arguments: &[&str]| {
        let mut command = firsthand(&["run", "--robot", "mach-wrong", "--runs"]);
        let output = command.arg(&runs).args(arguments).output().unwrap();
        (
            output.status.code(),
            String::from_utf8(output.stderr).unwrap(),
        )
    };
    let codes = [
        run(&[wrong]),
        run(&["/no/such/mission.toml"]),
        run(&["open-room", "--set", "robot.address='nowhere'"]),
        run(&["open-room", "--set", "planner.executable='/no/planner'"]),
    ];
    for (code, said) in codes {
        assert_eq!(code, Some(78), "{said}");
    }
    for unit in ["firsthand", "firsthand-watch"] {
        let file = format!("{}/../systemd/{unit}.service", env!("CARGO_MANIFEST_DIR"));
        let unit = fs::read_to_string(&file).unwrap();
        let setting = |key: &str| unit.lines().find_map(|line| line.strip_prefix(key));
        let never = setting("RestartPreventExitStatus=").unwrap();
        assert!(never.split(' ').any(|code| code == "78"), "{file}: {never}");
        assert!(
            setting("ExecStart=").unwrap().contains(" --keep "),
            "{file}"
        );
        assert_eq!(setting("LimitCORE="), None, "{file}");
    }
}

#[test]
fn a_robot_that_is_off_leaves_no_directory_start_by_start() {
    let runs = directory_of("mach-off");
    for _ in 0..2 {
        let mut run = firsthand(&["run", "open-room", "--robot", "mach-off", "--runs"])
            .arg(runs.path())
            // Nobody answers there.
            .args(["--set", "robot.address='127.0.0.1:9'"])
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        support::wait_for_status("mach-off", |status| {
            STAGES
                .iter()
                .all(|stage| find(status, stage)["state"] == "running")
        });
        signal_process(run.id(), Signal::TERM);
        run.wait().unwrap();
        assert_eq!(fs::read_dir(runs.path()).unwrap().count(), 0);
    }
    assert_nothing_left("mach-off");
}

#[test]
fn the_robot_of_another_user_is_named_and_not_said_to_be_missing() {
    // As this user's, but for the number in its name.
    let bus = Path::new("/dev/shm/fh54321_mach-whose_bus");
    fs::create_dir_all(bus).unwrap();
    let refused = output(&["status", "--robot", "mach-whose"]);
    fs::remove_dir(bus).unwrap();
    let said = String::from_utf8(refused.stderr).unwrap();
    assert!(said.contains("for user 54321"), "{said}");
}

/// The exit code of a command whose standard output nobody reads; a panic would be 101.
fn unread(arguments: &[&str]) -> (Option<i32>, String) {
    let (reader, writer) = io::pipe().unwrap();
    drop(reader);
    let mut command = firsthand(arguments);
    let output = command
        .stdout(writer)
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let output = output.wait_with_output().unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    (output.status.code(), said)
}

#[test]
fn a_closed_standard_output_is_no_failure_of_any_command() {
    let directory = directory_of("mach-shut");
    let mission = format!("{}/../missions/trap.toml", env!("CARGO_MANIFEST_DIR"));
    let mut run = Run::start("mach-shut", "open-room", &SLOW);
    run.wait_until_under_way(0.3);
    let out = directory.path().join("run");
    let out = out.to_str().unwrap();
    let commands: [&[&str]; 11] = [
        &["missions"],
        &["missions", "trap"],
        &["check", &mission],
        &["install", "--print"],
        &["topics"],
        &["stages"],
        &["failsafe"],
        &["help", "tables"],
        &["status", "--robot", "mach-shut"],
        &["status", "--robot", "mach-shut", "--json"],
        &["run", "open-room", "--robot", "mach-shut2", "--out", out],
    ];
    for command in commands {
        let (code, said) = unread(command);
        assert_eq!(code, Some(0), "{command:?}: {said}");
    }
    run.signal(Signal::INT);
    run.finish();
    assert_nothing_left("mach-shut");
}

/// How many descriptors a process has.
fn descriptors(process: u32) -> usize {
    fs::read_dir(format!("/proc/{process}/fd")).unwrap().count()
}

#[test]
fn a_stage_inherits_no_descriptor_of_its_supervisor() {
    let mut run = Run::start("mach-fds", "open-room", &SLOW);
    run.wait_until_under_way(0.3);
    // One that was started when its supervisor had everything open.
    let status = run.kill_and_await_successor("planner", Signal::KILL);
    let (own, supervisors) = (descriptors(pid(&status, "planner")), descriptors(run.pid()));
    // By itself it has 61, and its supervisor some 200, of which it inherited 86.
    assert!(2 * own < supervisors, "{own} of {supervisors}");
    run.signal(Signal::INT);
    run.finish();
    assert_nothing_left("mach-fds");
}

#[test]
fn a_checkpoint_of_another_version_is_refused_by_name_and_not_taken_for_none() {
    let mut run = Run::start("mach-vers", "open-room", &SLOW);
    run.wait_until_under_way(0.5);
    run.signal(Signal::KILL);
    run.reap();
    let file = run.directory().join("supervisor.checkpoint");
    let mut bytes = fs::read(&file).unwrap();
    let slots: Vec<_> = (0..bytes.len() - 4)
        .filter(|&at| bytes[at..].starts_with(b"FHC2"))
        .collect();
    assert!(!slots.is_empty());
    for at in slots {
        bytes[at + 3] = b'1';
    }
    fs::write(&file, bytes).unwrap();
    let refused = output(&["run", "--resume", run.directory().to_str().unwrap()]);
    let said = String::from_utf8(refused.stderr).unwrap();
    assert_eq!(refused.status.code(), Some(1), "{said}");
    let named = said.contains("supervisor.checkpoint") && said.contains("another version");
    assert!(named, "{said}");
    assert_nothing_left("mach-vers");
}

#[test]
fn a_run_is_not_resumed_after_the_machine_was_suspended_for_hours() {
    let runs = directory_of("mach-susp");
    let run = |before: &[&str]| {
        let executable = env!("CARGO_BIN_EXE_firsthand");
        let line = [
            before,
            &[executable, "run", "open-room", "--robot", "mach-susp"],
            // One that goes on by mistake ends all the same.
            &["--pace", "1", "--timeout", "20"],
        ]
        .concat();
        let mut command = Command::new(line[0]);
        command
            .args(&line[1..])
            .arg("--resume-last")
            .arg("--runs")
            .arg(runs.path());
        command
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::piped());
        command
    };
    let mut first = run(&[]).spawn().unwrap();
    support::wait_for_status("mach-susp", |status| status["order"] == "driving");
    signal_process(first.id(), Signal::KILL);
    first.wait().unwrap();
    // A clock that went on for two hours while CLOCK_MONOTONIC stood, as over a suspension: needs root, and says so.
    let suspended = ["unshare", "--time", "--boottime", "7200", "--fork", "--"];
    let late = run(&suspended).output().unwrap();
    let said = String::from_utf8(late.stderr).unwrap();
    assert_eq!(late.status.code(), Some(7), "{said}");
    assert!(said.contains("was cut off"), "{said}");
    support::wait_until_all_ended("mach-susp");
    // The next run removes what the killed one left.
    assert_eq!(support::run("mach-susp", "open-room", &[]).0, Some(0));
    assert_nothing_left("mach-susp");
}

#[test]
fn another_robots_run_is_not_gone_on_with() {
    let runs = directory_of("mach-mine");
    let run = |robot: &str| {
        let mut command = firsthand(&["run", "open-room", "--resume-last", "--robot", robot]);
        command.arg("--runs").arg(runs.path()).args(SLOW);
        command.stdout(Stdio::null()).stderr(Stdio::piped());
        command.spawn().unwrap()
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
    let domain = common::domain::Domain::of("mach-gone".parse().unwrap());
    fs::create_dir_all(domain.directory()).unwrap();
    let held = File::create(domain.lock_file()).unwrap();
    held.lock().unwrap();
    let out = runs.path().join("run");
    let run = firsthand(&["run", "open-room", "--robot", "mach-gone", "--out"])
        .arg(&out)
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // It logs before it locks, and asks again for a second.
    let began = Instant::now();
    while !out.join("supervisor.log").exists() && began.elapsed() < support::PATIENCE {
        thread::yield_now();
    }
    thread::sleep(Duration::from_millis(100));
    drop(held);
    let output = run.wait_with_output().unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(0), "{said}");
    assert_nothing_left("mach-gone");
}

#[test]
fn a_latency_measurement_removes_no_directory_but_its_own() {
    let user = rustix::process::geteuid().as_raw();
    // Another robot of this user, whose directory is below the one that was removed.
    let mut run = Run::start("mach-lat", "open-room", &SLOW);
    run.wait_until_under_way(0.3);
    let robot = user.to_string();
    let mut command = firsthand(&["latency", "--robot", &robot, "--rounds", "1", "--json"]);
    let output = command.output().unwrap();
    assert!(output.status.success(), "{output:?}");
    let root = fs::metadata(format!("/tmp/firsthand-{user}/mach-lat")).unwrap();
    assert!(root.is_dir() && root.uid() == user);
    assert!(run.status().is_some());
    run.signal(Signal::INT);
    assert_eq!(run.finish().0, Some(0));
    assert_nothing_left("mach-lat");
}

#[test]
fn messages_name_what_is_wrong() {
    let directory = tempfile::tempdir().unwrap();
    let said = |arguments: &[&str]| {
        let output = output(arguments);
        assert!(!output.status.success(), "{arguments:?} succeeded");
        String::from_utf8(output.stderr).unwrap()
    };
    // A pipe that nobody writes to, in place of a mission.
    let pipe = directory.path().join("pipe.toml");
    let made = Command::new("mkfifo").arg(&pipe).status().unwrap();
    assert!(made.success() && fs::metadata(&pipe).unwrap().file_type().is_fifo());
    let refused = said(&["check", pipe.to_str().unwrap()]);
    assert!(
        refused.contains("pipe.toml") && refused.contains("no regular file"),
        "{refused}"
    );
    let refused = said(&["run", "trap", "--set", "perimeter.cells=3"]);
    assert!(refused.contains("--set perimeter.cells=3"), "{refused}");
    assert!(
        !refused.contains("trap.toml:"),
        "cites a line of the file: {refused}"
    );
    // Fewer descriptors than a supervisor needs are not told as full shared memory.
    let limited = Command::new("prlimit")
        .args(["--nofile=64:64", env!("CARGO_BIN_EXE_firsthand")])
        .args(["run", "open-room", "--robot", "mach-few", "--runs"])
        .arg(directory.path())
        .output()
        .unwrap();
    let refused = String::from_utf8(limited.stderr).unwrap();
    assert!(
        !limited.status.success() && refused.contains("64 descriptors"),
        "{refused}"
    );
    let refused = said(&["run", "--resume", "/no/such/run"]);
    assert!(refused.contains("/no/such/run"), "{refused}");
}

#[test]
fn a_target_where_the_robot_stands_is_reached_in_a_finite_ratio() {
    let directory = directory_of("mach-here");
    let out = directory.path().join("run");
    let output = firsthand(&[
        "run",
        "open-room",
        "--set",
        "target=[0,0]",
        "--robot",
        "mach-here",
        "--out",
    ])
    .arg(&out)
    .output()
    .unwrap();
    let said = String::from_utf8(output.stdout).unwrap();
    assert_eq!(output.status.code(), Some(0), "{said}");
    assert!(!said.contains("NaN") && !said.contains("inf"), "{said}");
    assert_nothing_left("mach-here");
}
