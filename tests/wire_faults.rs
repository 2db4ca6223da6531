//! Tests of robots with implausible or missing frames, through a fault injector.

use std::{
    fs,
    sync::{Arc, Mutex},
    time::{Duration, Instant},
};

use crate::support::{
    Run, assert_ended, assert_nothing_left, operate, refused, wait_until,
    wire::{Proxy, Robot},
};
use common::wire::{Addressing, Command, Decoder, Motion, MotorSensors, Quantity, Report};
use rustix::process::Signal;
use serde_json::Value;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Fault {
    None,
    NoFrame,
    Random,
    /// The right encoder rolls on by 560 counts/s.
    RollsOn,
    /// The front sonar reports nothing in range.
    DeafSonar,
    /// An infrared ranger that looks into the front sonar's cone reports the invalid value 0.
    DeadRanger,
}

/// State of a fault injector: its fault, and observed traffic.
#[derive(Debug)]
struct Shared {
    fault: Fault,
    frames: u16,
    first_motion: Option<Instant>,
}

struct FaultInjector {
    proxy: Proxy,
    shared: Arc<Mutex<Shared>>,
}

impl FaultInjector {
    fn before(robot: &Robot, fault: Fault) -> Self {
        let shared = Arc::new(Mutex::new(Shared { fault, frames: 0, first_motion: None }));
        let pass = |decode: fn(&mut Shared, &mut Decoder) -> Vec<u8>| {
            let (shared, mut decoder) = (Arc::clone(&shared), Decoder::default());
            Box::new(move |bytes: &[u8]| {
                decoder.push(bytes);
                decode(&mut shared.lock().unwrap(), &mut decoder)
            })
        };
        let (to_robot, to_link) = (pass(Shared::pass_to_robot), pass(Shared::pass_to_link));
        let proxy = Proxy::before(robot, to_robot, to_link);
        Self { proxy, shared }
    }

    fn set(&self, fault: Fault) {
        self.shared.lock().unwrap().fault = fault;
    }

    /// Waits until half a second after the first moving command.
    fn wait_until_moving(&self, run: &mut Run) {
        run.wait_until("it moves", |_| {
            let first = self.shared.lock().unwrap().first_motion;
            first.is_some_and(|first| first.elapsed() > Duration::from_millis(500))
        });
    }
}

impl Shared {
    fn pass_to_robot(&mut self, decoder: &mut Decoder) -> Vec<u8> {
        let mut bytes = Vec::new();
        while let Some(frame) = decoder.next_frame() {
            let Ok(command) = Command::parse(&frame) else {
                continue;
            };
            if matches!(&command, Command::Motion(motion) if moves(motion)) {
                self.first_motion.get_or_insert_with(Instant::now);
            }
            command.encode(Addressing::default(), &mut bytes);
        }
        bytes
    }

    fn pass_to_link(&mut self, decoder: &mut Decoder) -> Vec<u8> {
        let mut bytes = Vec::new();
        while let Some(frame) = decoder.next_frame() {
            let Ok(mut report) = Report::parse(&frame) else {
                continue;
            };
            match &mut report {
                Report::Motor(_) if self.fault == Fault::NoFrame => continue,
                Report::Motor(MotorSensors { encoders: [left, right], .. }) => {
                    self.frames = self.frames.wrapping_add(1);
                    match self.fault {
                        Fault::Random => {
                            left.position = self.frames.wrapping_mul(9973) % 32_768;
                            right.position = self.frames.wrapping_mul(20_011) % 32_768;
                        }
                        Fault::RollsOn => right.position = self.frames.wrapping_mul(80) % 32_768,
                        _ => {}
                    }
                }
                Report::Standard(sensors) if self.fault == Fault::DeafSonar => {
                    sensors.ultrasonic[1] = 255;
                }
                // Channels 2 to 7 are infrared-1 to infrared-6.
                Report::Custom(sensors) if self.fault == Fault::DeadRanger => sensors.ad[2] = 0,
                _ => {}
            }
            report.encode(Addressing::default(), &mut bytes);
        }
        bytes
    }
}

fn moves(motion: &Motion) -> bool {
    let turns = |channel| motion.targets.of(channel).is_some_and(|speed| speed != 0);
    motion.quantity == Quantity::Velocity && (turns(0) || turns(1))
}

/// Starts the default mission on the wall clock with this fault from the beginning.
fn faulty(robot: &str, fault: Fault) -> (Robot, FaultInjector, Run) {
    let body = Robot::on_the_course();
    let faults = FaultInjector::before(&body, fault);
    let address = faults.proxy.as_robot();
    let run = Run::start(robot, "obstacle-course", &["--set", &address]);
    (body, faults, run)
}

fn cause_is(cause: &'static str) -> impl Fn(&Value) -> bool {
    move |status| status["link"]["cause"] == cause
}

#[test]
fn an_operators_stop_fails_until_the_encoders_say_that_the_robot_rests() {
    let (_body, faults, mut run) = faulty("fi-stop", Fault::None);
    faults.wait_until_moving(&mut run);
    faults.set(Fault::RollsOn);
    refused(&["stop", "--robot", "fi-stop"], "not-at-rest", &["fi-stop"]);
    let status = run.wait_until("status says so", cause_is("robot does not obey"));
    assert_eq!(status["link"]["at_rest"], false, "{status}");
    faults.set(Fault::None);
    run.wait_until("it rests", |status| status["link"]["at_rest"] == true);
    operate("fi-stop", &["stop"]);
    run.stop();
}

/// Longest time from a signal to the end of a run without wheel reports, including machine load.
const ENDS_WITHIN: Duration = Duration::from_secs(15);

#[test]
fn a_robot_without_usable_motor_frames_is_said_to_be_unknown_and_the_first_signal_ends_its_run() {
    let ends = |robot: &str, before: Fault, fault: Fault| {
        let (_body, faults, mut run) = faulty(robot, before);
        if before == Fault::None {
            faults.wait_until_moving(&mut run);
            faults.set(fault);
        }
        run.wait_until("the link stands", |status| {
            let link = &status["link"];
            link["connected"] == true && link["stopped"] == true && link["at_rest"] == false
        });
        // The operator gets the same message.
        refused(&["stop", "--robot", robot], "not-at-rest", &["whether it rests is unknown"]);
        run.signal(Signal::INT);
        let began = Instant::now();
        let (code, summary) = run.finish();
        println!("{robot}: the run ended after {:.1} s", began.elapsed().as_secs_f64());
        assert!(began.elapsed() < ENDS_WITHIN, "{:?}", began.elapsed());
        assert_ended(code, &summary, 0, "aborted");
        let reason = summary["reason"].as_str().unwrap();
        assert!(reason.contains("whether it rests is unknown: no usable motor fr"), "{reason}");
        assert_nothing_left(robot);
    };
    std::thread::scope(|scope| {
        scope.spawn(|| ends("fi-unheard", Fault::NoFrame, Fault::NoFrame));
        scope.spawn(|| ends("fi-lost", Fault::None, Fault::NoFrame));
        scope.spawn(|| ends("fi-useless", Fault::None, Fault::Random));
    });
}

#[test]
fn with_one_dead_infrared_ranger_before_a_sonar_the_robot_says_so_and_arrives() {
    let body = Robot::start("open-room", "udp", "127.0.0.1:0");
    let faults = FaultInjector::before(&body, Fault::DeadRanger);
    let address = faults.proxy.as_robot();
    let quick = ["--set", "controller.speed_m_s=0.6", "--set", &address];
    let mut run = Run::start("fi-ranger", "open-room", &quick);
    let status = run.wait_until("it is told", cause_is("infrared ranger silent"));
    assert_eq!(status["order"], "driving", "{status}");
    wait_until("the log names it", || run.link_logged(&["infrared-1"]));
    run.arrives();
}

#[test]
fn before_a_wall_that_the_front_sonar_does_not_hear_the_robot_stands_until_it_hears_it() {
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("wall.toml");
    // The robot turns so slowly that the wall stays square ahead for seconds.
    let wall = "target = [-3, 0]\nworld.wall = [{ points = [[0.5, -1], [0.5, 1]] }]\n\
        controller = { look_rad_s = 0.02, turn_rad_s = 0.02 }";
    fs::write(&file, wall).unwrap();
    let mission = file.to_str().unwrap();
    let body = Robot::start(mission, "udp", "127.0.0.1:0");
    let faults = FaultInjector::before(&body, Fault::DeafSonar);
    let mut run = Run::start("fi-deaf", mission, &["--set", &faults.proxy.as_robot()]);
    run.wait_until("it stands", cause_is("ranging sensor implausible"));
    assert!(run.link_logged(&["front has heard nothing", "infrared-1 and infrared-2"]));
    faults.set(Fault::None);
    run.wait_until("it goes on", |status| status["link"]["cause"].is_null());
    run.stop();
}
