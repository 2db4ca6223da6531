use super::*;
use common::samples::{ContactSample, HoldReason};
use std::path::Path;

/// Frame period at 7 Hz, seconds.
const PERIOD: f64 = 1.0 / 7.0;
/// One wheel turn per second, 0.53 m/s.
const TURN: i16 = 1200;

fn odometry() -> Odometry {
    // 1 m/s is 2247 counts/s.
    Odometry::new(&Mission::parse("target = [3, 0]", Path::new("test.toml")).unwrap())
}

fn suspicion(odometry: &Odometry) -> Option<Suspicion> {
    odometry.suspicion.map(|(suspicion, _)| suspicion)
}

/// Measured wheels: 0.07 s delay, 0.08 s lag, 0.78 of the speed, a dead band of 20 counts/s.
#[derive(Default)]
struct Wheels {
    speed: [f64; 2],
    rolled: [f64; 2],
    told: Vec<(f64, [i16; 2])>,
    now: f64,
}

impl Wheels {
    fn tell(&mut self, counts: [i16; 2]) {
        self.told.push((self.now, counts));
    }

    fn roll_to(&mut self, end: f64) {
        const STEP: f64 = 0.005;
        while self.now < end - STEP / 2.0 {
            let heard = |&&(at, _): &&(f64, [i16; 2])| at + 0.07 <= self.now;
            let target = self.told.iter().rev().find(heard);
            for wheel in [0, 1] {
                // A command lasts 0.25 s.
                let asked = target
                    .filter(|(at, _)| at + 0.07 + 0.25 > self.now)
                    .map_or(0.0, |(_, counts)| 0.78 * f64::from(counts[wheel]));
                let asked = if asked.abs() < 20.0 { 0.0 } else { asked };
                self.speed[wheel] += (asked - self.speed[wheel]) * STEP / 0.08;
                self.rolled[wheel] += self.speed[wheel] * STEP;
            }
            self.now += STEP;
        }
    }

    fn counts(&self) -> [u16; 2] {
        self.rolled.map(|rolled| rolled.rem_euclid(f64::from(COUNTS)) as u16)
    }
}

const COUNTS: u16 = common::wire::COUNT_CYCLE;

/// Runs a robot with commands `tells(tick)`, out of reach where `out`; `says` maps wheel counts to
/// frames. Returns the first suspicion, in seconds after the first command.
fn drive(
    ticks: u32,
    tells: impl Fn(u32) -> [i16; 2],
    mut out: impl FnMut(u32) -> bool,
    mut says: impl FnMut(u32, [u16; 2]) -> [u16; 2],
) -> Option<(f64, Suspicion)> {
    let mut odometry = odometry();
    let mut wheels = Wheels::default();
    for tick in 0..ticks {
        let time = f64::from(tick) * PERIOD;
        wheels.roll_to(time);
        if out(tick) {
            continue;
        }
        let now = MissionTime::from_seconds(time);
        odometry.plausible(says(tick, wheels.counts()), now);
        if let Some(suspicion) = suspicion(&odometry) {
            return Some((time, suspicion));
        }
        odometry.commanded(tells(tick), now);
        wheels.tell(tells(tick));
    }
    None
}

fn never(_: u32) -> bool {
    false
}

fn honest(_: u32, counts: [u16; 2]) -> [u16; 2] {
    counts
}

/// Asserts rest within 1.5 s of the first motion, including 0.2 s to stop and a frame's jitter.
fn in_time(suspected: Option<(f64, Suspicion)>, why: Suspicion) {
    let (after, suspicion) = suspected.unwrap();
    assert!(after <= 1.15 && suspicion == why, "{suspicion:?} after {after} s");
}

#[test]
fn an_honest_robot_is_not_suspected_whatever_it_is_told() {
    let straight = |_| [TURN, TURN];
    let turning = |_| [-TURN / 2, TURN / 2];
    let slow = |_| [70, 70];
    let reversing = |tick: u32| {
        if (tick / 2).is_multiple_of(2) { [TURN, -TURN] } else { [-TURN, TURN] }
    };
    let curves = |tick: u32| [900 + 300 * (tick % 3) as i16, 1200 - 300 * (tick % 4) as i16];
    let stop_and_go = |tick: u32| if tick % 7 < 3 { [0, 0] } else { [TURN, 80] };
    for tells in
        [&straight as &dyn Fn(u32) -> [i16; 2], &turning, &slow, &reversing, &curves, &stop_and_go]
    {
        assert_eq!(drive(400, tells, never, honest), None);
    }
}

#[test]
fn an_honest_robot_is_not_suspected_with_its_radio_out_a_fifth_or_half_of_the_time() {
    // Radio outages of 1 to 8 frames.
    for share in [5, 2] {
        for seed in 1..60_u32 {
            let mut state = seed;
            let mut left = 0_i32;
            let out = |_| {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                let drawn = (state >> 16) as i32;
                if left == 0 {
                    let burst = 1 + drawn % 8;
                    let goes_out = drawn / 8 % share == 0;
                    left = if goes_out { burst } else { -burst };
                }
                let is_out = left > 0;
                left -= left.signum();
                is_out
            };
            assert_eq!(drive(200, |_| [TURN, TURN / 2], out, honest), None, "{seed}");
        }
    }
}

#[test]
fn wheels_held_for_half_a_second_are_not_suspected() {
    // The frames repeat, and then continue from the same counts.
    let mut held = 0;
    let says = |tick: u32, counts: [u16; 2]| {
        if tick == 21 {
            held = counts[0];
        }
        match tick {
            21..=24 => [held; 2],
            _ => counts,
        }
    };
    assert_eq!(drive(60, |_| [TURN, TURN], never, says), None);
}

#[test]
fn the_same_frame_for_ever_is_suspected_in_time() {
    let same = |_, _| [32_767; 2];
    in_time(drive(40, |_| [TURN, TURN], never, same), Suspicion::Left);
    in_time(drive(40, |_| [-80, 80], never, same), Suspicion::Left);
}

#[test]
fn one_dead_encoder_is_suspected_in_time_and_named() {
    let dead = |_, [left, _]: [u16; 2]| [left, 0];
    in_time(drive(40, |_| [TURN, TURN], never, dead), Suspicion::Right);
}

#[test]
fn a_dead_encoder_is_suspected_though_the_direction_changes_with_every_tick_and_a_live_one_is_not()
{
    let to_and_fro = |tick: u32| {
        if tick.is_multiple_of(2) { [400, -400] } else { [-400, 400] }
    };
    let dead = drive(40, to_and_fro, never, |_, [left, _]| [left, 0]);
    assert!(matches!(dead, Some((after_s, Suspicion::Right)) if after_s < 1.5), "{dead:?}");
    assert_eq!(drive(200, to_and_fro, never, honest), None);
}

#[test]
fn wheels_that_are_reversed_or_swapped_are_suspected_in_time() {
    let reversed = |_, counts: [u16; 2]| counts.map(|count| (COUNTS - count) % COUNTS);
    in_time(drive(40, |_| [TURN, TURN], never, reversed), Suspicion::Left);
    // Commands for a robot that turns away from the target.
    let chatter = |tick: u32| [if (tick / 2).is_multiple_of(2) { 584 } else { -584 }; 2];
    in_time(drive(40, chatter, never, reversed), Suspicion::Left);
    let swapped = |_, [left, right]: [u16; 2]| [right, left];
    in_time(drive(40, |_| [-TURN, TURN], never, swapped), Suspicion::Left);
    // In a curve both wheels roll forward, but the robot turns the other way.
    let curve = drive(40, |_| [TURN / 2, TURN], never, swapped);
    in_time(curve, Suspicion::Turn);
}

#[test]
fn frames_that_are_two_seconds_late_are_suspected_in_time() {
    let mut said = VecDeque::from([[0; 2]; 14]);
    let late = move |_, counts| {
        said.push_back(counts);
        said.pop_front().unwrap()
    };
    in_time(drive(40, |_| [TURN, TURN], never, late), Suspicion::Left);
}

#[test]
fn a_robot_that_is_suspected_is_given_up_after_10_s_or_plausible_again_when_an_operator_has_looked()
{
    let at = MissionTime::from_seconds;
    let mut odometry = odometry();
    for tick in 0..8 {
        let now = at(f64::from(tick) * PERIOD);
        odometry.plausible([5, 5], now);
        odometry.commanded([TURN, TURN], now);
    }
    let given_up = |odometry: &Odometry, seconds| {
        let now = Moment { time: at(seconds), machine_ns: 0 };
        odometry.condition(Cause::OdometryGivenUp, now) == Condition::Holds
    };
    assert!(suspicion(&odometry).is_some());
    for tick in 8..80 {
        odometry.plausible([5, 5], at(f64::from(tick) * PERIOD));
    }
    assert!(!given_up(&odometry, 10.8));
    assert!(!given_up(&odometry, 11.0), "no stage waits for it");
    let drive = Observation::Directive(Order::Drive, HoldReason::None);
    odometry.observe(&drive, Moment::default());
    assert!(!given_up(&odometry, 10.8));
    assert!(given_up(&odometry, 11.0));
    odometry.observe(&Observation::Resumed, Moment::default());
    assert!(suspicion(&odometry).is_none() && !given_up(&odometry, 11.0));
}

#[test]
fn three_jumps_within_two_seconds_are_suspected_until_two_seconds_without_twice_at_most() {
    let at = MissionTime::from_seconds;
    let mut odometry = odometry();
    for round in 0..3 {
        let start = 10.0 * f64::from(round);
        for jump in 0..3 {
            assert_eq!(suspicion(&odometry), None);
            odometry.implausible(at(start + 0.143 * f64::from(jump)));
        }
        assert_eq!(suspicion(&odometry), Some(Suspicion::Jumps));
        odometry.plausible([5, 5], at(start + 2.2));
        assert_eq!(suspicion(&odometry), Some(Suspicion::Jumps));
        odometry.plausible([5, 5], at(start + 2.3));
    }
    assert_eq!(suspicion(&odometry), Some(Suspicion::Jumps), "the third time");
}

#[test]
fn an_old_frame_now_and_then_is_not_suspected() {
    let mut odometry = odometry();
    for frame in 0..20 {
        odometry.implausible(MissionTime::from_seconds(2.0 * f64::from(frame)));
        assert_eq!(suspicion(&odometry), None);
    }
}

type Suspected = Option<(f64, Suspicion)>;
/// Current of a rolling and of a held wheel.
const ROLLS_AD: u16 = 260;
const HELD_AD: u16 = 1520;

/// Drives a robot whose wheels are always held and draw `current(told to stand)`. The robot stands
/// while they are known to be held. Returns the contacts, and the suspicion with its seconds.
fn held(current: impl Fn(bool) -> [u16; 2]) -> (Vec<(f64, ContactSample)>, Suspected) {
    let mut odometry = odometry();
    let (mut contacts, mut told_to_stand) = (Vec::new(), true);
    for tick in 0..40 {
        let time = f64::from(tick) * PERIOD;
        let now = MissionTime::from_seconds(time);
        odometry.contacts.take_currents(current(told_to_stand));
        odometry.plausible([7, 7], now);
        contacts.extend(odometry.contacts.new.take().map(|contact| (time, contact)));
        if let Some(suspicion) = suspicion(&odometry) {
            return (contacts, Some((time, suspicion)));
        }
        let moment = Moment { time: now, machine_ns: 0 };
        told_to_stand = odometry.condition(Cause::WheelsHeld, moment) == Condition::Holds;
        odometry.commanded(if told_to_stand { [0, 0] } else { [TURN, TURN] }, now);
    }
    (contacts, None)
}

#[test]
fn wheels_that_draw_the_current_of_held_ones_are_a_contact_ahead_and_no_suspicion() {
    let (contacts, suspicion) = held(|stands| [if stands { 20 } else { HELD_AD }; 2]);
    assert_eq!(suspicion, None);
    let (first_s, first) = contacts[0];
    assert!(first_s < 1.0, "{first_s}");
    assert_eq!((first.left, first.right, first.bearing_rad), (1, 1, 0.0));
    assert!(first.half_width_rad > 0.0);
    assert!(contacts.len() > 2, "a robot that stays held is noticed again");
}

#[test]
fn a_dead_encoder_is_suspected_in_time_by_a_current_that_is_no_sign() {
    let repeated = |_: bool| [HELD_AD; 2];
    let beyond_the_range = |_: bool| [u16::MAX; 2];
    let rolls = |_: bool| [ROLLS_AD; 2];
    for current in [&repeated as &dyn Fn(bool) -> [u16; 2], &beyond_the_range, &rolls] {
        let (_, suspicion) = held(current);
        in_time(suspicion, Suspicion::Left);
    }
}

#[test]
fn a_current_that_is_high_on_rolling_wheels_is_no_sign_of_held_ones() {
    let mut odometry = odometry();
    let mut wheels = Wheels::default();
    let mut suspected = None;
    for tick in 0..60 {
        let time = f64::from(tick) * PERIOD;
        wheels.roll_to(time);
        let now = MissionTime::from_seconds(time);
        odometry.contacts.take_currents([HELD_AD; 2]);
        // The encoders die after 5 s.
        if tick <= 35 {
            odometry.plausible(wheels.counts(), now);
        } else {
            odometry.plausible([0; 2], now);
        }
        assert_eq!(odometry.contacts.new.take().map(|contact| contact.left), None);
        if suspicion(&odometry).is_some() {
            suspected.get_or_insert(time);
        }
        odometry.commanded([TURN, TURN], now);
        wheels.tell([TURN, TURN]);
    }
    assert!(suspected.unwrap() < 6.2, "{suspected:?}");
}

#[test]
fn one_held_wheel_is_a_contact_at_its_side_and_behind_a_robot_that_backs() {
    use std::f64::consts::{FRAC_PI_2, PI};
    let at = |held: [bool; 2], told: [i16; 2]| {
        let mut odometry = odometry();
        let mut turned = [0_u16; 2];
        for tick in 0..12 {
            let now = MissionTime::from_seconds(f64::from(tick) * PERIOD);
            let current = held.map(|held| if held { HELD_AD } else { ROLLS_AD });
            odometry.contacts.take_currents(current);
            odometry.plausible(turned, now);
            if let Some(contact) = odometry.contacts.new.take() {
                return contact;
            }
            odometry.commanded(told, now);
            for wheel in [0, 1] {
                let counts = f64::from(told[wheel]) * PERIOD;
                let rolled = if held[wheel] { 0.0 } else { counts };
                turned[wheel] =
                    (f64::from(turned[wheel]) + rolled).rem_euclid(f64::from(COUNTS)) as u16;
            }
        }
        panic!("no contact");
    };
    let left = at([true, false], [TURN, TURN]);
    assert!(left.bearing_rad > 0.0 && left.bearing_rad < FRAC_PI_2, "{left:?}");
    let right = at([false, true], [TURN, TURN]);
    assert_eq!((right.left, right.right, right.bearing_rad), (0, 1, -left.bearing_rad));
    let behind = at([true, true], [-TURN, -TURN]);
    assert!((behind.bearing_rad - PI).abs() < 1e-9, "{behind:?}");
    // A turn on the spot may touch anywhere.
    assert_eq!(at([true, true], [-TURN, TURN]).half_width_rad, 0.0);
}

fn beside_another(tells: [i16; 2], other: [i16; 2], hertz: f64) -> Option<(f64, Suspicion)> {
    let mut odometry = odometry();
    let mut wheels = Wheels::default();
    let mut told_s = 0.0;
    for tick in 0..140 {
        let time = f64::from(tick) * PERIOD;
        while told_s < time {
            wheels.roll_to(told_s);
            wheels.tell(other);
            told_s += 1.0 / hertz;
        }
        wheels.roll_to(time);
        let now = MissionTime::from_seconds(time);
        odometry.plausible(wheels.counts(), now);
        if let Some(suspicion) = suspicion(&odometry) {
            return Some((time, suspicion));
        }
        odometry.commanded(tells, now);
        wheels.tell(tells);
    }
    None
}

#[test]
fn a_robot_that_another_host_turns_or_speeds_is_suspected_and_the_words_name_that() {
    for (other, hertz) in [
        ([-TURN / 2, TURN / 2], 20.0),
        ([TURN / 2, -TURN / 2], 10.0),
        ([TURN, TURN], 20.0),
        ([-TURN / 2, -TURN / 2], 20.0),
    ] {
        let suspected = beside_another([TURN / 3, TURN / 3], other, hertz);
        assert!(suspected.is_some_and(|(after_s, _)| after_s < 5.0), "{other:?}: {suspected:?}");
    }
    let pushed = beside_another([TURN / 3, TURN / 3], [TURN, TURN], 20.0);
    assert!(matches!(pushed, Some((_, Suspicion::Untold))), "{pushed:?}");
    assert!(Suspicion::Untold.words().contains("another host commands"));
}
