//! Tests of the failsafe with a robot that speaks ROS 2.

use ::ros2::{
    messages::{self, COVARIANCE},
    msg::Header,
};
use ros2_driver::{
    messages::write_twist,
    topics::{Content, Topics},
};

use super::*;

const FRAME_MS: u64 = 50;

fn burger() -> Mission {
    mission(
        "robot = { model = 'turtlebot3-burger', protocol = 'ros2', address = 'ros2', rate_hz = 10 }",
    )
}

/// Robot that obeys its newest command, its link and clock.
struct Scene {
    link: Link,
    topics: Topics,
    ms: u64,
    /// Odometry: x, y and heading.
    pose: [f64; 3],
    told: [f64; 2],
    tick: u64,
    odometry: bool,
    /// Odometry follows the motion.
    counts: bool,
    scans: bool,
    /// Beams change.
    sees: bool,
    clock_rate: f64,
    wheels: WheelSample,
    endless: [f64; 2],
    effects: Vec<Effect>,
}

impl Scene {
    /// Drives straight ahead at 0.15 m/s.
    fn driving() -> Self {
        let mut scene = Self {
            link: in_time(&burger()),
            topics: Topics::of(&burger()),
            ms: 0,
            pose: [0.0; 3],
            told: [0.0; 2],
            tick: 0,
            odometry: true,
            counts: true,
            scans: true,
            sees: true,
            clock_rate: 1.0,
            wheels: WheelSample::default(),
            endless: [0.0; 2],
            effects: Vec::new(),
        };
        scene.run(2000);
        assert_eq!(scene.link.decision, Decision::GO);
        assert!(scene.told[0] > 0.1 && scene.pose[0] > 0.1);
        scene.effects.clear();
        scene
    }

    fn say(&mut self, content: Content, payload: &[u8]) {
        let row = self.topics.heard.iter().position(|(has, _)| *has == content).unwrap();
        self.event(Event::Datagram(&[&[row as u8], payload].concat()));
    }

    fn event(&mut self, event: Event<'_>) {
        let effects = self.link.at(event, self.ms);
        for effect in &effects {
            match effect {
                Effect::Send(bytes) if !bytes.is_empty() => {
                    self.told =
                        [4, 44].map(|at| f64::from_le_bytes(*bytes[at..].first_chunk().unwrap()));
                }
                Effect::Tick { tick, wheels, endless: Some(endless), .. } => {
                    self.endless = [endless.left_counts, endless.right_counts];
                    (self.tick, self.wheels) = (*tick, *wheels);
                }
                _ => {}
            }
        }
        self.effects.extend(effects);
    }

    fn odometry(&self) -> Vec<u8> {
        let header = Header::at((self.ms as f64 * self.clock_rate) as u64 * MS, "odom");
        let none = [0.0; COVARIANCE];
        messages::odometry(header, "base_footprint", (self.pose, none), (self.told, none))
    }

    fn scan(&self) -> Vec<u8> {
        let noise = if self.sees { self.ms as f32 * 1e-6 } else { 0.0 };
        // Too few beams to contradict the motion, which they do.
        let range = |beam| if beam % 30 == 0 { 2.0 + noise } else { f32::INFINITY };
        let (header, ranges) = (Header::at(self.ms * MS, "scan"), (0..360).map(range).collect());
        messages::scan(header, [0.0, TAU / 360.0], [0.12, 3.5], [0.0, 0.1], ranges)
    }

    /// Advances time with odometry at 20 Hz and scans at 10 Hz; ticks are answered.
    fn run(&mut self, for_ms: u64) {
        for _ in 0..for_ms / FRAME_MS {
            self.ms += FRAME_MS;
            if self.ms.is_multiple_of(200) {
                self.event(Event::Order(Order::Drive, HoldReason::None));
            }
            if self.counts {
                self.pose[0] += self.told[0] * FRAME_MS as f64 / 1000.0;
            }
            if self.scans && self.ms.is_multiple_of(100) {
                self.say(Content::Scan(0), &self.scan());
            }
            if self.odometry {
                self.say(Content::Odometry, &self.odometry());
            }
            self.event(Event::Command(command(self.tick, self.ms * MS, [0.15 / 0.033; 2])));
            self.event(Event::Quiet);
        }
    }

    fn commanded(&mut self, ahead: f64) {
        self.say(Content::Command, &[&[9; 16][..], &write_twist(ahead, 0.0, false)].concat());
    }

    fn is_silent(&mut self, is_silent: bool) {
        (self.odometry, self.scans) = (!is_silent, !is_silent);
    }

    fn holds(&self, cause: Cause) {
        let stop = Decision { action: Action::Stop, cause };
        assert_eq!(
            (self.link.decision, self.told),
            (stop, [0.0; 2]),
            "{:?}",
            decided(&self.effects)
        );
    }
}

#[test]
fn beside_another_commander_the_robot_is_told_to_stand_after_each_of_its_commands_and_drives_on_when_it_has_gone()
 {
    let mut scene = Scene::driving();
    for _ in 0..20 {
        // It obeys the other commander until a stop arrives.
        scene.told = [0.1, 0.0];
        scene.commanded(0.1);
        scene.holds(Cause::AnotherCommander);
        scene.run(100);
    }
    scene.run(1000);
    assert_eq!(scene.link.decision, Decision::GO);
    scene.run(100);
    assert!(scene.told[0] > 0.1);
}

#[test]
fn a_robot_that_freezes_is_lost_whatever_others_tell_it_and_drives_on_when_it_is_back() {
    let mut scene = Scene::driving();
    scene.is_silent(true);
    for _ in 0..10 {
        scene.commanded(0.0);
        scene.run(100);
    }
    scene.holds(Cause::RobotLost);
    scene.is_silent(false);
    scene.run(2000);
    assert_eq!(scene.link.decision, Decision::GO);
}

#[test]
fn odometry_and_scans_that_end_or_stay_the_same_while_the_robot_drives_stop_it() {
    let cases: [(fn(&mut Scene), _, _); 4] = [
        (|it| it.odometry = false, 800, Cause::FramesSilent),
        (|it| it.counts = false, 1500, Cause::OdometryImplausible),
        (|it| it.scans = false, 900, Cause::RangeSilent),
        (|it| it.sees = false, 1500, Cause::RangeSilent),
    ];
    for (fails, ms, cause) in cases {
        let mut scene = Scene::driving();
        fails(&mut scene);
        scene.run(ms);
        scene.holds(cause);
    }
}

#[test]
fn what_a_robot_drove_while_the_network_was_down_is_its_motion_as_far_as_it_can_drive_in_that_time()
{
    // Half a cycle of the counts is 0.94 m. What is too far to drive in that time is unknown.
    for (silent_ms, way, is_known) in [
        (5000, 1.1, true),
        (5000, -1.1, true),
        (20_000, 4.4, true),
        (5000, 0.3, true),
        (5000, 1.9, false),
    ] {
        let mut scene = Scene::driving();
        scene.run(100);
        let (before, restarts, from) = (scene.endless, scene.wheels.restarts, scene.pose[0]);
        scene.is_silent(true);
        scene.run(silent_ms);
        scene.holds(Cause::RobotLost);
        scene.pose[0] += way;
        scene.is_silent(false);
        scene.run(FRAME_MS);
        let ahead = scene.pose[0] - from;
        let per_count = burger().body().metres_per_count();
        for (after, before) in scene.endless.into_iter().zip(before) {
            let driven = (after - before) * per_count;
            let is_right = if is_known { (driven - ahead).abs() < 0.02 } else { driven < 0.13 };
            assert!(is_right, "{driven} instead of {ahead}");
        }
        assert_eq!(scene.wheels.restarts == restarts, is_known, "{way}");
    }
}

#[test]
fn while_odometry_jumps_again_and_again_the_robot_stands_and_two_nodes_that_publish_it_are_named() {
    for are_two in [false, true] {
        let mut scene = Scene::driving();
        for jump in 1..20 {
            scene.pose[1] = f64::from(jump % 2);
            if are_two {
                let two = [&[u8::MAX][..], &[0xa1; 16], &[0xb2; 16]].concat();
                scene.event(Event::Datagram(&two));
            }
            scene.run(100);
            assert!(jump < 4 || scene.told == [0.0; 2], "{jump}");
        }
        scene.holds(Cause::OdometryImplausible);
        assert!(scene.wheels.restarts >= 19);
        let words = scene.link.explain(Cause::OdometryImplausible, scene.ms * MS).unwrap();
        let names = words.starts_with("two nodes publish /odom, with the GIDs a1.a1.")
            && words.contains("b2.b2; end one");
        let is_refused =
            |effect: &Effect| matches!(effect, Effect::Refused(why) if why.to_string() == words);
        assert_eq!([names, scene.effects.iter().any(is_refused)], [are_two; 2], "{words}");
        scene.run(4000);
        assert_eq!(scene.link.decision, Decision::GO);
    }
}

#[test]
fn a_simulator_whose_clock_goes_slower_than_mission_time_is_told_with_its_rate() {
    let mut scene = Scene::driving();
    scene.clock_rate = 0.5;
    scene.run(17_000);
    scene.effects.retain(|effect| matches!(effect, Effect::ClockRate(_)));
    let [Effect::ClockRate(rate)] = scene.effects[..] else { panic!("{:?}", scene.effects) };
    near(rate, 0.5, 0.01);
}
