//! Stages killed, frozen and stopped in the middle of missions.

use crate::support::{self, Run, STAGES, assert_nothing_left, processes_of, run};
use rustix::process::Signal;

/// Mission time runs so many times as fast as the wall's: a mission takes ten seconds.
const PACE: &str = "4";

#[test]
fn each_stage_killed_or_frozen_once_the_robot_arrives_and_knows_where_it_is() {
    let start = |robot| Run::start(robot, "obstacle-course", &["--pace", PACE]);
    let (calm, killed, frozen) = (start("calm"), start("kills"), start("frozen"));
    let disturbed = [(killed, Signal::KILL), (frozen, Signal::STOP)].map(|(mut run, signal)| {
        std::thread::spawn(move || {
            run.wait_until_under_way(2.0);
            for stage in STAGES {
                run.kill_and_await_successor(stage, signal);
            }
            run.finish()
        })
    });
    let (_, undisturbed) = calm.finish();
    for run in disturbed {
        let (code, summary) = run.join().unwrap();
        assert_eq!(
            (code, &summary["outcome"]),
            (Some(0), &"reached".into()),
            "{summary}"
        );
        assert_eq!(summary["collisions"], 0, "{summary}");
        for stage in STAGES {
            // A robot that was held long enough is stalled, and a stall ends with a new planner.
            let replans = summary["replans"].as_u64().filter(|_| stage == "planner");
            let restarts = 1 + replans.unwrap_or_default();
            assert_eq!(summary["restarts"][stage], restarts, "{summary}");
        }
        // Another way round reads the wheels at other fractions of a count: a count between them is 9 mm across at the
        // target, 6 m away. A lost pose is metres.
        let error = |summary: &serde_json::Value| summary["pose_error_m"].as_f64().unwrap();
        assert!(
            error(&summary) <= error(&undisturbed) + 0.015,
            "{summary} against {undisturbed}"
        );
    }
    for robot in ["calm", "kills", "frozen"] {
        assert_nothing_left(robot);
    }
}

#[test]
fn each_stage_of_a_car_killed_once_it_arrives_untouched() {
    let car = ["--set", "robot.model=\"car\"", "--pace", PACE];
    let mut run = Run::start("car-kills", "obstacle-course", &car);
    run.wait_until_under_way(2.0);
    for stage in STAGES {
        run.kill_and_await_successor(stage, Signal::KILL);
    }
    let (_, summary) = run.finish();
    assert_eq!(summary["outcome"], "reached", "{summary}");
    assert_eq!(summary["collisions"], 0, "{summary}");
    for stage in STAGES {
        assert_eq!(summary["restarts"][stage], 1, "{summary}");
    }
    assert_nothing_left("car-kills");
}

#[test]
fn a_stage_killed_on_a_clock_of_ticks_does_not_hang_the_mission() {
    // At this speed the mission has thousands of ticks: seconds to be killed in.
    let slow = ["--set", "controller.speed_m_s=0.006", "--timeout", "20000"];
    for stage in STAGES {
        let robot = format!("t-{}", &stage[..6]);
        let mut run = Run::start(&robot, "open-room", &slow);
        let status = run.wait_until("the robot drives", |status| status["order"] == "driving");
        let pid = support::find(&status, stage)["pid"].as_u64().unwrap() as u32;
        support::signal_process(pid, Signal::KILL);
        let (_, summary) = run.finish();
        assert_eq!(summary["outcome"], "reached", "{stage}: {summary}");
        assert_eq!(summary["restarts"][stage], 1, "{stage}: {summary}");
    }
}

/// Names of the node files of `robot`'s bus, its nodes' directories among them.
fn node_files(robot: &str) -> Vec<String> {
    let nodes = support::making(robot).root().join("nodes");
    let entries = std::fs::read_dir(nodes).unwrap().flatten();
    entries
        .map(|entry| entry.file_name().into_string().unwrap())
        .collect()
}

#[test]
fn what_a_stage_killed_in_its_start_left_on_the_bus_is_removed() {
    let mut run = Run::start("leftovers", "obstacle-course", &["--pace", "1"]);
    let status = run.wait_until_under_way(0.5);
    let pid = support::find(&status, "mapper")["pid"].as_u64().unwrap();
    // The process is the third of the four words of a node's id.
    let own = |name: &String| {
        let id = name.parse::<u128>().ok()?;
        ((id >> 64) as u32 == pid as u32).then_some(id)
    };
    let id = node_files("leftovers").iter().find_map(own).unwrap();
    // A generation that was killed between making its node's directory and registering the node.
    let cut_off = (id + (1 << 96)).to_string();
    let making = support::making("leftovers");
    let directory = making.root().join("nodes").join(&cut_off);
    std::fs::create_dir(&directory).unwrap();
    let details = format!("{}node.details", making.shared_memory_prefix());
    std::fs::write(directory.join(details), "").unwrap();
    run.kill_and_await_successor("mapper", Signal::KILL);
    run.wait_until("the node is removed", |_| {
        let left = node_files("leftovers");
        !left
            .iter()
            .any(|name| name.contains(&id.to_string()) || *name == cut_off)
    });
    run.signal(Signal::INT);
    run.finish();
    assert_nothing_left("leftovers");
}

#[test]
fn ctrl_c_sigterm_and_a_closed_terminal_end_a_run_in_order_and_leave_nothing() {
    let mut signals = vec![("ctrl-c", Signal::INT), ("sigterm", Signal::TERM)];
    // Whoever starts these tests under `nohup` starts their runs under it.
    if !ignores(Signal::HUP) {
        signals.push(("hangup", Signal::HUP));
    }
    for (robot, signal) in signals {
        let mut stopped = Run::start(robot, "obstacle-course", &["--pace", "1"]);
        stopped.wait_until_under_way(0.5);
        stopped.signal(signal);
        let directory = stopped.directory();
        let (code, summary, kept) = stopped.finish_in();
        assert_eq!(
            (code, &summary["outcome"]),
            (Some(0), &"aborted".into()),
            "{summary}"
        );
        let log = std::fs::read_to_string(directory.join("x80-link.log")).unwrap();
        assert!(log.contains("stop sent to the robot"), "{log}");
        assert_nothing_left(robot);
        drop(kept);
    }
}

/// Whether this process ignores `signal`, and so what it starts.
fn ignores(signal: Signal) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = u64::from_str_radix(mask.unwrap().trim(), 16).unwrap();
    mask >> (signal.as_raw() - 1) & 1 == 1
}

#[test]
fn stages_die_with_their_supervisor_and_the_link_stops_the_robot_first() {
    let mut orphaned = Run::start("orphans", "obstacle-course", &["--pace", "1"]);
    orphaned.wait_until_under_way(0.5);
    let directory = orphaned.directory();
    orphaned.signal(Signal::KILL);
    let began = std::time::Instant::now();
    orphaned.reap();
    while !processes_of("orphans").is_empty() {
        assert!(
            began.elapsed() < support::PATIENCE,
            "{:?}",
            processes_of("orphans")
        );
    }
    let log = std::fs::read_to_string(directory.join("x80-link.log")).unwrap();
    assert!(log.contains("stop sent to the robot"), "{log}");
    drop(orphaned);
    // What the killed supervisor left does not hinder the next, and is removed with it.
    let (code, summary) = run("orphans", "open-room", &[]);
    assert_eq!(code, Some(0), "{summary}");
    assert_nothing_left("orphans");
}

#[test]
fn a_frozen_stage_that_outlives_its_supervisor_does_not_hinder_the_next() {
    // One that the supervisor started is woken by the kernel when its parent dies; another's stays frozen.
    let watching = ["--pace", "1", "--watch-only"];
    let mut watching = Run::start("frozen-orphan", "obstacle-course", &watching);
    watching.wait_until("there is a bus", |_| true);
    let mapper = ["stage", "mapper", "--robot", "frozen-orphan"];
    let mut mapper = support::firsthand(&mapper).spawn().unwrap();
    watching.wait_until("the mapper runs", |status| {
        support::find(status, "mapper")["state"] == "running"
    });
    support::signal_process(mapper.id(), Signal::STOP);
    watching.signal(Signal::KILL);
    watching.reap();
    let directory = support::directory_of("frozen-orphan");
    let out = directory.path().join("run");
    let next = ["run", "open-room", "--robot", "frozen-orphan", "--out"];
    let next = support::firsthand(&next).arg(out).output().unwrap();
    let gone = mapper.try_wait().unwrap();
    mapper.kill().unwrap();
    mapper.wait().unwrap();
    assert!(next.status.success(), "{next:?}");
    assert!(gone.is_some(), "the frozen stage is still there");
    assert_nothing_left("frozen-orphan");
}

#[test]
fn two_robots_on_one_machine_do_not_see_each_other() {
    let mut one = Run::start("one", "obstacle-course", &["--pace", PACE]);
    let mut two = Run::start("two", "trap", &["--pace", PACE]);
    let status = one.wait_until_under_way(1.0);
    two.wait_until_under_way(1.0);
    assert_ne!(
        support::find(&status, "mapper")["pid"],
        support::find(&two.status().unwrap(), "mapper")["pid"]
    );
    one.kill_and_await_successor("mapper", Signal::KILL);
    let (_, one) = one.finish();
    let (_, two) = two.finish();
    assert_eq!(
        (&one["outcome"], &one["restarts"]["mapper"]),
        (&"reached".into(), &1.into()),
        "{one}"
    );
    assert_eq!(
        (&two["outcome"], &two["restarts"]["mapper"]),
        (&"reached".into(), &0.into()),
        "{two}"
    );
    assert_nothing_left("one");
    assert_nothing_left("two");
}
