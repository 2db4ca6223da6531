//! Tests that runs in lockstep are identical, independent of machine load. `firsthand-lab
//! both-ways` compares their samples.

use std::time::Duration;

use common::{bus::Bus, topics, waiter::Waiter};
use rustix::process::Signal;
use serde_json::Value;

use crate::support::{
    Run, assert_nothing_left, domain, in_own_process, operate, pid, run, signal_process,
};

/// Returns the summary without wall-clock measurements.
fn numbers(mut summary: Value) -> Value {
    for wall_clock in ["tick_latency_us", "full_solve_us"] {
        summary.as_object_mut().unwrap().remove(wall_clock);
    }
    summary
}

#[test]
fn a_run_that_was_stopped_and_resumed_gives_the_same_summary_to_the_bit() {
    // Thousands of ticks take a second or two, which leaves time to stop the mission.
    let slow = "--set controller.speed_m_s=0.05 --timeout 8000 --seed 7";
    let calm = Run::start("tick-calm", "obstacle-course", slow);
    let mut held = Run::start("tick-held", "obstacle-course", slow);
    held.wait_until_driving();
    operate("tick-held", "stop");
    held.wait_until("it is stopped", |status| status["link"]["cause"] == "stopped by an operator");
    operate("tick-held", "resume");
    assert_eq!(numbers(held.arrives()), numbers(calm.arrives()));
}

#[test]
fn a_mission_that_ends_by_a_touch_or_whose_robot_stalls_gives_the_same_summary_to_the_bit() {
    // The robot is blind, because hits beyond 5 cm are not mapped.
    let blind = "--set method='paper' --set mapper.map_within_m=0.05";
    // The mission is long enough to find all four walls.
    let closed = "--timeout 300 \
        --set world.wall=[{points=[[1.5,-2],[1.5,2],[-1.5,2],[-1.5,-2],[1.5,-2]]}]";
    for (mission, arguments, code) in
        [("obstacle-course", blind, Some(5)), ("open-room", closed, Some(3))]
    {
        let [one, other] = [(); 2].map(|()| run("again", mission, arguments));
        assert_eq!(one.0, code, "{}", one.1);
        assert_eq!(numbers(one.1), numbers(other.1));
    }
    assert_nothing_left("again");
}

#[test]
fn a_robot_with_a_laser_goes_the_same_way_though_a_slow_stage_makes_the_link_repeat_ticks() {
    let slow = "--set robot.model='kobuki' --set controller.speed_m_s=0.03 --timeout 8000";
    in_own_process(|| {
        let (_, undisturbed) = run("laser-calm", "open-room", slow);
        let mut run = Run::start("laser-slow", "open-room", slow);
        let planner = pid(&run.wait_until_under_way(1.0), "planner");
        // The bus reports a repeated tick at once. A planner frozen for long would be replaced, and
        // its successor's map differs.
        let bus = Bus::join(&domain("laser-slow"), "watcher").unwrap();
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
            signal_process(planner, Signal::STOP);
            while repeated_ticks() <= before {}
            signal_process(planner, Signal::CONT);
        }
        let (_, disturbed) = run.finish();
        assert_eq!(disturbed["restarts"]["planner"], 0, "{disturbed}");
        assert_eq!(numbers(disturbed), numbers(undisturbed));
        assert_nothing_left("laser-slow");
    });
}
