use super::*;
use common::samples::{FixSample, Stamp, TurnSample};
use glam::DVec4;
use std::f64::consts::PI;

fn reckoning(extra: &str) -> DeadReckoning {
    // r = 0.1 m, W = 0.4 m, 1000 counts per turn: a count is 0.2 pi mm of rim.
    let text = format!(
        "target = [3, 0]\n[robot]\nwheel_radius_m = 0.1\ntrack_m = 0.4\ncounts_per_turn = 1000\n{extra}"
    );
    reckoning_of(&text)
}

pub(super) fn reckoning_of(mission: &str) -> DeadReckoning {
    DeadReckoning::new(&Mission::parse(mission, "test.toml").unwrap())
}

fn wheels(tick: u64, left: u16, right: u16) -> WheelSample {
    WheelSample {
        stamp: Stamp { tick, stamp_ns: tick * 500_000_000, ..Stamp::default() },
        left_counts: left,
        right_counts: right,
        ..WheelSample::default()
    }
}

impl DeadReckoning {
    pub(super) fn given(
        &mut self,
        wheels: &WheelSample,
        fixes: &[FixSample],
        turns: &[TurnSample],
    ) -> Reckoned {
        let (fixes, turns) = (fixes.to_vec(), turns.to_vec());
        let sources = Sources { fixes, turns, ..Sources::default() };
        self.reckon(wheels, &sources, wheels.stamp.time())
    }

    fn alone(&mut self, wheels: &WheelSample) -> Reckoned {
        self.given(wheels, &[], &[])
    }

    fn take(&mut self, tick: u64, left: u16, right: u16) -> PoseSample {
        self.alone(&wheels(tick, left, right)).pose
    }
}

fn begun(extra: &str, left: u16, right: u16) -> DeadReckoning {
    let mut reckoning = reckoning(extra);
    reckoning.take(0, left, right);
    reckoning
}

fn close(got: f64, want: f64) {
    assert!((got - want).abs() < 1e-12, "got {got}, want {want}");
}

fn by(generation: u32, mut sample: WheelSample) -> WheelSample {
    sample.stamp.generation = generation;
    sample
}

#[test]
fn the_pose_after_a_tick_is_that_of_equations_20_and_3_and_the_calibration_by_hand() {
    let on = |method: &str| format!("[dead_reckoning]\nintegration = '{method}'");
    let (arc, euler) = (on("arc"), on("euler"));
    // L = 0.5 m; 45 degrees of steering are 450 of 3600 counts.
    let car = "model = 'car'\nwheelbase_m = 0.5\nsteering_limit_deg = 60";
    let calibrated =
        "odometry = { diameter_ratio = 1.02, distance_scale = 0.98, track_scale = 1.1 }";
    // Half a wheel turn is 0.1 pi metres.
    let (half, left) = (0.1 * PI, 0.1 * PI * 0.98 / 1.01);
    let turn = half / 0.5;
    for (keys, from, to, want) in [
        ("", [100, 200], [600, 700], [half, 0.0, 0.0, half]),
        // +-1000 counts are 2 pi 0.1 m a side over a track of 0.4 m: pi radians left on the spot.
        ("", [0, 0], [COUNT_CYCLE - 1000, 1000], [0.0, 0.0, PI, 0.0]),
        // Right wheel alone, 1000 counts: turn pi/2, radius 0.2.
        (&arc, [0, 0], [0, 1000], [0.2, 0.2, PI / 2.0, half]),
        (&euler, [0, 0], [0, 1000], [half, 0.0, PI / 2.0, half]),
        // On a circle of 0.5 m radius to the left.
        (car, [100, 450], [600, 450], [0.5 * turn.sin(), 0.5 * (1.0 - turn.cos()), turn, half]),
        // From 45 degrees left to 45 right the mean is straight.
        (car, [100, 450], [600, COUNT_CYCLE - 450], [half, 0.0, 0.0, half]),
    ] {
        let pose = begun(keys, from[0], from[1]).take(1, to[0], to[1]);
        let got = [pose.x_m, pose.y_m, pose.heading_rad, pose.travelled_m];
        let off = DVec4::from(got) - DVec4::from(want);
        assert!(off.abs().max_element() < 1e-12, "{keys} {to:?}: {got:?}");
    }
    let pose = begun(calibrated, 0, 0).take(1, 500, 500);
    // The right wheel rolls 1.02 times as far as the left.
    close(pose.travelled_m, left * 1.01);
    close(pose.heading_rad, left * 0.02 / (0.4 * 1.1));
}

/// As [`wheels`], without a counter.
fn endless(tick: u64, counts: f64) -> (WheelSample, Sources) {
    let [left_counts, right_counts] = [counts; 2];
    let [left, right] = WheelCounts::Endless([left_counts, right_counts]).cyclic();
    let wheels = wheels(tick, left, right);
    let counts = CountsSample { stamp: wheels.stamp, left_counts, right_counts };
    (wheels, Sources { counts: vec![counts], ..Sources::default() })
}

#[test]
fn a_way_longer_than_the_cycle_of_a_counter_is_in_the_pose_of_a_robot_that_has_none() {
    // 5 s at 2.5 m/s in one tick, and a restart that ends at a whole cycle.
    for way in [15.0, -15.0, 20.588_741_6, 3.0] {
        let mut reckoning = reckoning("top_speed_m_s = 2.5");
        let mut at = |tick: u64, counts: f64| {
            let (wheels, sources) = endless(tick, counts);
            reckoning.reckon(&wheels, &sources, wheels.stamp.time())
        };
        at(0, 77.0);
        let counts = (way / (0.2e-3 * PI)).round();
        let after = at(10, 77.0 + counts);
        assert!(!after.rejected && (after.pose.x_m - way).abs() < 0.001, "{after:?}");
        let on = at(11, 78.0 + counts);
        assert!(!on.rejected && (on.pose.x_m - way).abs() < 0.002, "{on:?}");
        // Wheels cannot turn this far in half a second.
        let jump = at(12, 78.0 + 2.0 * counts + 32_768.0);
        assert!(jump.rejected && jump.pose.covariance[0] > on.pose.covariance[0] + 0.1);
    }
}

#[test]
fn a_robot_without_a_counter_restarts_at_0_alone_and_goes_on_by_the_cycle_where_a_sample_lacks() {
    let mut reckoning = reckoning("");
    let mut at = |tick: u64, generation: u32, counts: f64, lacks: bool| {
        let (mut wheels, mut sources) = endless(tick, counts);
        wheels.stamp.generation = generation;
        sources.counts.retain(|_| !lacks);
        reckoning.reckon(&wheels, &sources, wheels.stamp.time())
    };
    at(0, 1, 30_000.0, false);
    assert!(!at(10, 2, 32_768.0, false).rejected, "a whole cycle is no start");
    assert!((at(11, 2, 32_868.0, true).pose.x_m - 2.868 * 0.2 * PI).abs() < 1e-9);
    assert!((at(12, 2, 32_968.0, false).pose.x_m - 2.968 * 0.2 * PI).abs() < 1e-9);
    assert!(at(22, 3, 1.0, false).rejected);
}

#[test]
fn a_recorded_state_and_entry_of_an_earlier_version_are_read_without_counts() {
    let (wheels, sources) = endless(3, 5.0);
    let entry = postcard::to_allocvec(&sources).unwrap();
    let earlier = postcard::to_allocvec(&(sources.fixes, sources.turns)).unwrap();
    assert_eq!(postcard::from_bytes::<Sources>(&earlier).unwrap().counts, []);
    assert_eq!(postcard::from_bytes::<Sources>(&entry).unwrap().counts, sources.counts);
    let mut reckoning = reckoning("");
    reckoning.alone(&wheels);
    let state = postcard::to_allocvec(reckoning.state()).unwrap();
    // The last byte says: no counts.
    let earlier = postcard::from_bytes::<State>(&state[..state.len() - 1]).unwrap();
    assert_eq!(&earlier, reckoning.state());
}

#[test]
fn counts_wrap_around_both_ways_and_a_tick_given_twice_moves_once() {
    let mut reckoning = begun("", COUNT_CYCLE - 200, COUNT_CYCLE - 200);
    for _ in 0..2 {
        close(reckoning.take(1, 300, 300).x_m, 0.1 * PI);
    }
    close(reckoning.take(2, COUNT_CYCLE - 200, COUNT_CYCLE - 200).x_m, 0.0);
}

#[test]
fn no_speed_is_more_than_the_body_can_do_however_the_frames_come() {
    // A rim of at most 1 m/s is 5 rad/s on the spot.
    let mut reckoning = begun("", 0, 0);
    let mut tick = 0;
    let mut at = |stamp_ns: u64, left, right| {
        tick += 1;
        let stamp = Stamp { tick, stamp_ns, ..Stamp::default() };
        reckoning.alone(&WheelSample { stamp, ..wheels(tick, left, right) }).pose
    };
    for (second, after_ns) in [(1, 0), (2, 1), (3, 100_000), (4, 20_000_000)] {
        let now_ns = second * 1_000_000_000;
        at(now_ns, 0, 0);
        close(at(now_ns + after_ns, 400, 400).v_m_s, 1.0);
        at(now_ns + 400_000_000, 400, 400);
        close(at(now_ns + 400_000_000 + after_ns, 0, 800).omega_rad_s, 5.0);
        at(now_ns + 900_000_000, 0, 0);
    }
    // Two 7 Hz ticks at once are not too fast a motion.
    at(9_000_000_000, 0, 0);
    close(at(9_001_000_000, 50, 50).v_m_s, 50.0 * 2e-4 * PI / (0.5 / 7.0));
}

#[test]
fn a_motion_that_nobody_measured_is_in_the_covariance() {
    let mut reckoning = begun("", 600, 700);
    let before = reckoning.take(1, 600, 700);
    let after = reckoning.alone(&WheelSample { restarts: 1, ..wheels(2, 0, 1) }).pose;
    // 0.5 s at top speed are up to 0.5 m per wheel; uniformly distributed the variance is 0.25 / 3.
    let wheel = 0.25 / 3.0;
    for (entry, more) in [(0, wheel / 2.0), (3, wheel / 2.0), (5, 2.0 * wheel / 0.16)] {
        close(after.covariance[entry] - before.covariance[entry], more);
    }
    // However long the absence, the last command was over after 1 / 7 + 0.25 + 0.2 s.
    let much_later = reckoning.alone(&WheelSample { restarts: 2, ..wheels(200, 5, 6) }).pose;
    let lost = (1.0 / 7.0 + 0.45_f64).powi(2) / 3.0;
    close(much_later.covariance[5] - after.covariance[5], 2.0 * lost / 0.16);
    // So is a step that is left out although its frames came at once.
    let mut reckoning = begun("", 600, 600);
    let before = reckoning.take(1, 600, 600);
    let mut late = WheelSample { restarts: 1, ..wheels(2, 1600, 1600) };
    late.stamp.stamp_ns = before.stamp.stamp_ns;
    let after = reckoning.alone(&late);
    assert!(after.rejected);
    // A wheel turn is 0.2 pi metres, more than the 0.594 m in which the wheels rest.
    close(after.pose.covariance[0] - before.covariance[0], lost / 2.0);
}

#[test]
fn counts_that_may_have_wrapped_while_the_robot_kept_its_speed_are_lost() {
    // A count is 0.63 mm, so half a cycle takes 10.3 s at 1 m/s.
    for (speed, ticks, is_lost) in [(1592, 19, false), (1592, 22, true), (0, 22, false)] {
        let mut reckoning = begun("", 0, 0);
        let then = WheelSample { left_counts_per_s: speed, ..wheels(ticks, 100, 100) };
        let Reckoned { pose, rejected, .. } = reckoning.alone(&then);
        assert_eq!(rejected, is_lost, "{speed} {ticks}");
        assert_eq!(pose.position_rms_m() > 5.0, is_lost, "{speed} {ticks}");
    }
}

#[test]
fn counters_that_restart_do_not_move_the_robot() {
    // At once, while the robot was away, or while the link was killed. Wheels could have turned this
    // far in 5 s.
    for (from, tick, restarts, generation) in [(16_000, 1, 0, 0), (600, 10, 1, 0), (600, 9, 0, 1)] {
        let mut reckoning = begun("", from, from);
        let sample =
            |tick, counts| WheelSample { restarts, ..by(generation, wheels(tick, counts, counts)) };
        assert!(reckoning.alone(&sample(tick, 0)).rejected, "{tick}");
        close(reckoning.alone(&sample(tick, 0)).pose.x_m, 0.0);
        close(reckoning.alone(&sample(tick + 1, 500)).pose.x_m, 0.1 * PI);
    }
}

#[test]
fn a_robot_that_turns_back_through_its_start_while_the_link_is_killed_loses_no_turn() {
    let mut reckoning = begun("", 0, 0);
    // The wheels roll a tenth of a turn oppositely, and back.
    reckoning.take(1, COUNT_CYCLE - 100, 100);
    let back = reckoning.alone(&by(1, wheels(2, COUNT_CYCLE - 3, 2)));
    assert!(!back.rejected);
    close(back.pose.heading_rad, 5.0 * 2e-4 * PI / 0.4);
}

#[test]
fn a_successor_of_one_killed_between_publishing_and_saving_goes_on_with_its_pose() {
    let mut killed = begun("", 0, 0);
    killed.take(1, 90, 110);
    let saved = killed.state().clone();
    let published = killed.take(2, 190, 200);
    let successor = || {
        let mut successor = reckoning("");
        successor.restore(saved.clone()).unwrap();
        successor
    };
    // The link's last sample is still the tick's.
    let mut again = successor();
    assert_eq!(again.take(2, 190, 200), published);
    assert_eq!(again.state(), killed.state());
    // The next tick has come: no distance is lost, but 127 mm are one arc instead of two.
    let (got, want) = (successor().take(3, 280, 310), killed.take(3, 280, 310));
    close(got.heading_rad, want.heading_rad);
    close(got.travelled_m, want.travelled_m);
    assert!((got.x_m - want.x_m).hypot(got.y_m - want.y_m) < 2e-3);
}
