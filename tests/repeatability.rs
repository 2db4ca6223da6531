//! Tests that runs in lockstep are identical, independent of machine load.

use std::{collections::BTreeMap, fmt::Debug, time::Duration};

use common::{
    bus::Bus,
    grid::Replica,
    samples::{RangeReading, Stamped},
    topics,
    waiter::Waiter,
};
use rustix::process::Signal;
use serde_json::Value;

use crate::support::{self, Run, assert_nothing_left, in_own_process};

/// Returns the summary without wall-clock measurements.
fn numbers(mut summary: Value) -> Value {
    for wall_clock in ["tick_latency_us", "full_solve_us"] {
        summary.as_object_mut().unwrap().remove(wall_clock);
    }
    // A machine may not schedule the supervisor for 2 s. Robot and mission time then stand.
    summary["stops"].as_object_mut().unwrap().remove("supervisor silent");
    summary
}

/// Samples that a consumer receives of a run, and the run's summary.
#[derive(Debug)]
struct Recording {
    samples: BTreeMap<(&'static str, u64), String>,
    /// Cells of each completed version of the grid. A late reader misses some.
    grids: BTreeMap<u64, Vec<u8>>,
    last_grid: u64,
    summary: Value,
}

impl Recording {
    fn add(&mut self, topic: &'static str, mut sample: impl Stamped + Debug) {
        let tick = sample.stamp().tick;
        *sample.stamp_mut() = common::samples::Stamp {
            tick,
            stamp_ns: sample.stamp().stamp_ns,
            ..Default::default()
        };
        self.samples.insert((topic, tick), format!("{sample:?}"));
    }

    fn add_readings(&mut self, tick: u64, readings: &[RangeReading]) {
        self.samples.insert(("ranges", tick), format!("{readings:?}"));
    }

    /// Returns whether each of `topics` topics has a sample for each tick, and the last grid is
    /// present.
    fn is_whole(&self, topics: usize) -> bool {
        let ticks = self.summary["ticks"].as_u64().unwrap();
        self.samples.len() as u64 == topics as u64 * ticks
            && self.grids.contains_key(&self.last_grid)
    }
}

fn record(robot: &str) -> Recording {
    let domain = support::domain(robot);
    let mut run = Run::start(robot, "obstacle-course", &["--seed", "7"]);
    let bus = loop {
        match Bus::join(&domain, "recorder") {
            Ok(bus) => break bus,
            Err(error) => assert!(run.is_running(), "{error}"),
        }
    };
    let mut ranges = bus.reader(&topics::RANGES).unwrap();
    let mut wheels = bus.reader(&topics::WHEELS).unwrap();
    let mut poses = bus.reader(&topics::POSE).unwrap();
    let mut guidances = bus.reader(&topics::GUIDANCE).unwrap();
    let mut commands = bus.reader(&topics::COMMAND).unwrap();
    let mut grids = bus.reader(&topics::GRID).unwrap();
    let mut waiter = Waiter::default();
    waiter.on(bus.wakeup(&topics::GRID).unwrap());
    let mut received = Recording {
        samples: BTreeMap::new(),
        grids: BTreeMap::new(),
        last_grid: 0,
        summary: Value::Null,
    };
    let mut grid = Replica::default();
    loop {
        // Checked first, so that the reads below get all samples published until then.
        let over = !run.is_running();
        while let Ok(Some(part)) = grids.next_slice() {
            grid.apply(&part.header().part, &part);
            // After a missed part the map is empty until the next keyframe.
            if grid.version() > 0 {
                received.grids.insert(grid.version(), grid.cells().to_vec());
            }
        }
        while let Ok(Some(sample)) = ranges.next_slice() {
            received.add_readings(sample.header().stamp.tick, &sample);
        }
        while let Ok(Some(sample)) = wheels.next_sample() {
            received.add("wheels", sample);
        }
        while let Ok(Some(sample)) = poses.next_sample() {
            received.add("pose", sample);
        }
        while let Ok(Some(mut sample)) = guidances.next_sample() {
            // Wall-clock measurement.
            sample.full_solve_ns = 0;
            received.last_grid = sample.grid_version;
            received.add("guidance", sample);
        }
        while let Ok(Some(sample)) = commands.next_sample() {
            received.add("command", sample);
        }
        if over {
            break;
        }
        let _ = waiter.wait(Duration::from_millis(20));
    }
    let (_, summary) = run.finish();
    received.summary = numbers(summary);
    received
}

#[test]
fn the_same_seed_gives_the_same_samples_and_grids_to_the_bit() {
    in_own_process(|| {
        // A consumer that was not scheduled in time has lost samples.
        let whole = || {
            let mut records = (0..20).map(|_| record("recorded"));
            records.find(|recording| recording.is_whole(5)).expect("a recording without a gap")
        };
        let (mut one, mut other) = (whole(), whole());
        assert_eq!(one.last_grid, other.last_grid);
        one.grids.retain(|version, _| other.grids.contains_key(version));
        other.grids.retain(|version, _| one.grids.contains_key(version));
        println!("{} samples, {} grids", one.samples.len(), one.grids.len());
        assert!(one.grids.len() > 10, "{:?}", one.grids.keys());
        for (key, sample) in &one.samples {
            assert_eq!(Some(sample), other.samples.get(key), "{key:?}");
        }
        assert_eq!(one.samples.len(), other.samples.len());
        for (version, cells) in &one.grids {
            let others = &other.grids[version];
            let differ = (0..cells.len()).filter(|&at| cells[at] != others[at]);
            let differ: Vec<_> = differ.map(|at| (at, cells[at], others[at])).collect();
            assert!(differ.is_empty(), "grid {version}: {differ:?}");
        }
        assert_eq!(one.summary, other.summary);
        assert_nothing_left("recorded");
    });
}

#[test]
fn a_mission_that_ends_by_a_touch_or_its_timeout_gives_the_same_summary_to_the_bit() {
    // The robot is blind, because hits beyond 5 cm are not mapped.
    let blind = ["--set", "method='paper'", "--set", "mapper.map_within_m=0.05"];
    for (outcome, arguments) in [("collision", &blind[..]), ("timeout", &["--timeout", "5"])] {
        let summary = || numbers(support::run("again", "obstacle-course", arguments).1);
        let one = summary();
        assert_eq!(one["outcome"], outcome, "{one}");
        for _ in 0..2 {
            assert_eq!(summary(), one);
        }
    }
    assert_nothing_left("again");
}

#[test]
fn a_mission_whose_robot_stalls_gives_the_same_summary_to_the_bit() {
    let closed = [
        "--set",
        "world.wall=[{points=[[1.5,-2],[1.5,2],[-1.5,2],[-1.5,-2],[1.5,-2]]}]",
        // The mission is long enough to find all four walls.
        "--timeout",
        "300",
    ];
    let summary = || numbers(support::run("stalls", "open-room", &closed).1);
    let one = summary();
    let recoveries = one["replans"].as_u64().unwrap() + one["resets"].as_u64().unwrap();
    assert!(recoveries > 0, "{one}");
    for _ in 0..2 {
        assert_eq!(summary(), one);
    }
    assert_nothing_left("stalls");
}

#[test]
fn a_run_that_was_stopped_and_resumed_gives_the_same_summary_to_the_bit() {
    // Thousands of ticks take a second or two, which leaves time to stop the mission.
    let slow = ["--set", "controller.speed_m_s=0.02", "--timeout", "8000"];
    let (_, undisturbed) = support::run("tick-calm", "open-room", &slow);
    let mut run = Run::start("tick-held", "open-room", &slow);
    run.wait_until("the robot drives", |status| status["order"] == "driving");
    support::operate("tick-held", &["stop"]);
    run.wait_until("it is stopped", |status| status["link"]["cause"] == "stopped by an operator");
    support::operate("tick-held", &["resume"]);
    let (_, resumed) = run.finish();
    assert_eq!(numbers(resumed), numbers(undisturbed));
}

#[test]
fn a_robot_with_a_laser_goes_the_same_way_though_a_slow_stage_makes_the_link_repeat_ticks() {
    let robot = ["--set", "robot.model='kobuki'", "--set", "controller.speed_m_s=0.03"];
    let slow = [&robot[..], &["--timeout", "8000"]].concat();
    in_own_process(|| {
        let (_, undisturbed) = support::run("laser-calm", "open-room", &slow);
        let mut run = Run::start("laser-slow", "open-room", &slow);
        let planner = support::pid(&run.wait_until_under_way(1.0), "planner");
        // The bus reports a repeated tick at once. A planner frozen for long would be replaced, and
        // its successor's map differs.
        let bus = Bus::join(&support::domain("laser-slow"), "watcher").unwrap();
        let mut link = bus.reader(&topics::LINK).unwrap();
        let mut waiter = Waiter::default();
        waiter.on(bus.wakeup(&topics::LINK).unwrap());
        let mut repeated_ticks = move || loop {
            if let Some(link) = link.newest().unwrap() {
                break link.repeated_ticks;
            }
            let _ = waiter.wait(Duration::from_millis(20));
        };
        for _ in 0..5 {
            let before = repeated_ticks();
            support::signal_process(planner, Signal::STOP);
            while repeated_ticks() <= before {}
            support::signal_process(planner, Signal::CONT);
        }
        let (_, disturbed) = run.finish();
        assert_eq!(disturbed["restarts"]["planner"], 0, "{disturbed}");
        assert_eq!(numbers(disturbed), numbers(undisturbed));
        assert_nothing_left("laser-slow");
    });
}
