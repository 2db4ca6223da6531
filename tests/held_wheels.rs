//! A robot whose wheels are held by an obstacle that no sensor detects, on the wall clock.

use serde_json::Value;

use crate::support::{Run, assert_ended, assert_nothing_left, records, wire::Robot};

fn stalls(directory: &std::path::Path) -> Vec<(String, String)> {
    let text = |value: &Value| value.as_str().unwrap().to_owned();
    let stalls = records(&directory.join("run").join("stalls.jsonl"));
    stalls.iter().map(|stall| (text(&stall["cause"]), text(&stall["recovery"]))).collect()
}

#[test]
fn a_robot_that_is_held_by_a_thing_that_no_sensor_notices_maps_it_and_goes_another_way() {
    // The box is there from the start, or appears before the robot.
    let shape = "[{at=[2,0],size_m=[0.3,0.8],top_m=0.1,echo=0}]";
    let things = [
        ("unheard", format!("world.box={shape}")),
        ("appears", format!("simulation.thing=[{{from_s=3,shape={{box={shape}}}}}]")),
    ];
    let runs = things.map(|(name, thing)| {
        let set = ["--set", &thing, "--set", "simulation.wheels.contact_slip=0"];
        let robot = Robot::start_with("open-room", &set);
        let address = format!("robot.address=\"udp://{}\"", robot.listening);
        let quick = ["--set", "controller.speed_m_s=0.4", "--set", &address];
        (name, robot, Run::start(name, "open-room", &quick))
    });
    for (name, _robot, run) in runs {
        let (code, summary, directory) = run.finish_in();
        assert_ended(code, &summary, 0, "reached");
        assert!(summary["restarts"]["planner"].as_u64() > Some(0), "{summary}");
        let stalls = stalls(directory.path());
        assert_eq!(stalls[0], ("held".to_owned(), "replan".to_owned()), "{stalls:?}");
        assert_nothing_left(name);
    }
}
