//! Tests that a late consumer gets everything, and that its exit changes nothing.

use std::{
    io::{BufRead as _, BufReader},
    sync::{
        Mutex,
        atomic::{AtomicBool, Ordering},
    },
    thread,
    time::{Duration, Instant},
};

use crate::support::{
    Killed, PATIENCE, Run, STAGES, assert_no_restart, assert_nothing_left, assert_reached, domain,
    firsthand, in_own_process, start_piped, start_quietly,
};
use common::{
    bus::{Bus, BusError},
    follower::{Event, Follower},
    topics,
};
use rustix::process::Signal;

type HeardPoses = Mutex<Vec<usize>>;

fn follow(robot: &str, runs: usize, heard: &HeardPoses) {
    let domain = domain(robot);
    let mut follower = Follower::new(domain, "logger", &topics::POSE, |bus| {
        Ok((bus.reader(&topics::POSE)?, bus.reader(&topics::GRID)?))
    });
    let mut here = false;
    let patience = PATIENCE * runs as u32;
    let began = Instant::now();
    while heard.lock().unwrap().len() < runs || here {
        assert!(began.elapsed() < patience, "{heard:?}");
        match follower.wait(Duration::from_secs(1)).unwrap() {
            Event::Connected => {
                here = true;
                heard.lock().unwrap().push(0);
            }
            Event::Disconnected => here = false,
            Event::Nothing => {}
            Event::Samples((poses, grids)) => {
                while poses.next_sample().unwrap().is_some() {
                    *heard.lock().unwrap().last_mut().unwrap() += 1;
                }
                while grids.next_slice().unwrap().is_some() {}
            }
        }
    }
}

#[test]
fn a_logger_follows_its_robot_through_three_runs_one_of_them_killed_and_harms_none() {
    in_own_process(|| {
        let heard = &HeardPoses::default();
        thread::scope(|scope| {
            scope.spawn(|| follow("followed", 3, heard));
            for run in 0..3 {
                let mut started = Run::at_own_speed("followed", "open-room", "--pace 4");
                if run == 1 {
                    let has_heard = || heard.lock().unwrap().get(1).is_some_and(|&poses| poses > 5);
                    started.wait_until("the logger hears it", |_| has_heard());
                    started.kill();
                    // The bus of a killed supervisor stays until the next run removes it.
                    thread::park_timeout(Duration::from_secs(3));
                    continue;
                }
                let (code, summary) = started.finish();
                assert_reached(code, &summary);
                assert_no_restart(&summary);
                // The pause lets the consumer notice the end of the run. Robots are not restarted
                // within a second.
                thread::park_timeout(Duration::from_secs(1));
            }
        });
        assert!(heard.lock().unwrap().iter().all(|&poses| poses > 5), "{heard:?}");
        assert_nothing_left("followed");
    });
}

#[test]
fn a_consumer_that_holds_too_much_or_wants_every_place_is_told_and_no_stage_notices() {
    in_own_process(|| {
        // The robot arrives only after its stages run again, on a busy machine too.
        let slowly = "--pace 2 --set controller.speed_m_s=0.02";
        let mut run = Run::under_way("greedy", "open-room", slowly, 0.5);
        let bus = Bus::join(&domain("greedy"), "greedy").unwrap();
        let mut grids = bus.reader(&topics::GRID).unwrap();
        let mut held = Vec::new();
        let began = Instant::now();
        let refused = loop {
            match grids.next_slice() {
                Ok(sample) => held.extend(sample),
                Err(error) => break error,
            }
            assert!(began.elapsed() < PATIENCE, "{} held", held.len());
        };
        assert!(matches!(refused, BusError::HoldsTooMany { .. }), "{refused}");
        let mut shown = firsthand(&["status", "--follow", "--robot", "greedy"]);
        let mut shown = Killed(start_piped(&mut shown));
        let mut first = String::new();
        let mut said = BufReader::new(shown.0.stdout.take().unwrap());
        said.read_line(&mut first).unwrap();
        let mut readers = Vec::new();
        let refused = loop {
            match bus.reader(&topics::POSE) {
                Ok(reader) => readers.push(reader),
                Err(error) => break error,
            }
        };
        assert!(matches!(refused, BusError::NoPlace { .. }), "{refused}");
        drop(shown);
        readers
            .push(bus.reader(&topics::POSE).expect("a reader gets the place of a killed process"));
        // The status command needs a place, too.
        readers.pop();
        // A stage that needs a place gets one.
        for stage in ["mapper", "planner"] {
            run.kill_and_await_successor(stage, Signal::KILL);
        }
        run.signal(Signal::TERM);
        let (code, summary) = run.finish();
        assert_eq!(code, Some(0), "{summary}");
        for stage in ["mapper", "planner"] {
            assert_eq!(summary["restarts"][stage], 1, "{summary}");
        }
        assert_eq!(summary["restarts"]["controller"], 0, "{summary}");
        drop((held, readers, grids, bus));
        assert_nothing_left("greedy");
    });
}

/// Joins the bus of `robot`, reads grid and field, and leaves, repeatedly until `over`. Returns the
/// number of successes.
fn join_again_and_again(robot: &str, over: &AtomicBool) -> usize {
    let domain = domain(robot);
    let mut joined = 0;
    while !over.load(Ordering::Relaxed) {
        let Ok(bus) = Bus::join(&domain, "visitor") else {
            continue;
        };
        let grid = bus.reader(&topics::GRID);
        let field = bus.reader(&topics::FIELD);
        if let (Ok(mut grid), Ok(mut field)) = (grid, field) {
            joined += 1;
            let _ = (grid.next_slice(), field.next_slice());
        }
    }
    joined
}

#[test]
fn consumers_that_stay_and_that_join_again_and_again_take_no_stages_place() {
    in_own_process(|| {
        let robot = "visited-c6";
        let slowly = "--pace 2 --set controller.speed_m_s=0.05";
        let mut run = Run::under_way(robot, "obstacle-course", slowly, 0.5);
        let mut staying = Vec::new();
        for consumer in 0..10 {
            let topic = ["grid", "field"][consumer % 2];
            let mut echo = firsthand(&["topic", "echo", topic, "--robot", robot]);
            staying.push(Killed(start_quietly(&mut echo)));
        }
        let over = AtomicBool::new(false);
        let joined: usize = thread::scope(|scope| {
            let visitor = || scope.spawn(|| join_again_and_again(robot, &over));
            let visitors = [visitor(), visitor(), visitor()];
            run.wait_until_under_way(5.0);
            let bus = Bus::join(&domain(robot), robot).unwrap();
            let all_that_there_are: Vec<_> =
                std::iter::from_fn(|| bus.reader(&topics::GRID).ok()).collect();
            // The restarted stage gets its place before waiting consumers.
            run.kill_and_await_successor("planner", Signal::KILL);
            run.wait_until_under_way(8.0);
            over.store(true, Ordering::Relaxed);
            drop(all_that_there_are);
            visitors.map(|visitor| visitor.join().unwrap()).iter().sum()
        });
        assert!(joined > 10, "{joined}");
        drop(staying);
        let summary = run.stop();
        for stage in STAGES {
            let killed = u64::from(stage == "planner");
            assert_eq!(summary["restarts"][stage], killed, "{summary}");
        }
    });
}
