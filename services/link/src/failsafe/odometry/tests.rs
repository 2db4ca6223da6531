use super::*;
use crate::testing::*;
use common::{samples::ContactSample, wire::COUNT_CYCLE};
use std::collections::VecDeque;

/// One wheel turn per second, 0.53 m/s.
const TURN: i16 = 1200;

fn odometry() -> Odometry {
    // 1 m/s is 2247 counts/s.
    Odometry::new(&mission(""))
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
    fn roll_to(&mut self, end: f64) {
        const STEP: f64 = 0.005;
        while self.now < end - STEP / 2.0 {
            // A command lasts 0.25 s.
            let acts =
                |(at, _): &&(f64, [i16; 2])| (at + 0.07..at + 0.07 + 0.25).contains(&self.now);
            let asked = self.told.iter().rev().find(acts);
            for wheel in [0, 1] {
                let asked = asked.map_or(0.0, |(_, counts)| 0.78 * f64::from(counts[wheel]));
                let asked = if asked.abs() < 20.0 { 0.0 } else { asked };
                self.speed[wheel] += (asked - self.speed[wheel]) * STEP / 0.08;
                self.rolled[wheel] += self.speed[wheel] * STEP;
            }
            self.now += STEP;
        }
    }
}

type Suspected = Option<(f64, Suspicion)>;

/// Takes a frame that says `says` of the wheels' counts, and commands. Returns the suspicion.
fn turn(
    (odometry, wheels): &mut (Odometry, Wheels),
    time: f64,
    says: impl FnOnce([u16; 2]) -> [u16; 2],
    tells: [i16; 2],
) -> Suspected {
    wheels.roll_to(time);
    odometry.plausible(says(wheels.rolled.map(on_wire)), at(time));
    let suspicion = suspicion(odometry);
    if suspicion.is_none() {
        odometry.commanded(tells, at(time));
        wheels.told.push((wheels.now, tells));
    }
    suspicion.map(|suspicion| (time, suspicion))
}

/// Runs a robot that is in reach in these ticks, with commands `tells(tick)`; `says` maps wheel
/// counts to frames. Returns the first suspicion, in seconds after the first command.
fn drive(
    mut ticks: impl Iterator<Item = u32>,
    tells: impl Fn(u32) -> [i16; 2],
    mut says: impl FnMut(u32, [u16; 2]) -> [u16; 2],
) -> Suspected {
    let mut robot = (odometry(), Wheels::default());
    ticks.find_map(|tick| {
        let time = f64::from(tick) * PERIOD_S;
        turn(&mut robot, time, |counts| says(tick, counts), tells(tick))
    })
}

fn honest(_: u32, counts: [u16; 2]) -> [u16; 2] {
    counts
}

fn ahead(_: u32) -> [i16; 2] {
    [TURN; 2]
}

/// Asserts rest within 1.5 s of the first motion, including 0.2 s to stop and a frame's jitter.
#[track_caller]
fn in_time(suspected: Suspected, why: Suspicion, row: impl std::fmt::Debug) {
    let is_right = suspected.is_some_and(|(after_s, is)| after_s <= 1.15 && is == why);
    assert!(is_right, "{row:?}: {suspected:?}");
}

#[test]
fn an_honest_robot_is_not_suspected_whatever_it_is_told() {
    let reversing = |tick: u32| [[TURN, -TURN], [-TURN, TURN]][tick as usize / 2 % 2];
    let stop_and_go = |tick: u32| if tick % 7 < 3 { [0, 0] } else { [TURN, 80] };
    let tells: [&dyn Fn(u32) -> [i16; 2]; 4] =
        [&|_| [-TURN / 2, TURN / 2], &|_| [70, 70], &reversing, &stop_and_go];
    for (case, tells) in tells.into_iter().enumerate() {
        assert_eq!(drive(0..400, tells, honest), None, "{case}");
    }
}

#[test]
fn an_honest_robot_is_not_suspected_with_its_radio_out_a_fifth_or_half_of_the_time() {
    // Radio outages of 1 to 8 frames.
    for share in [5, 2] {
        for seed in 1..60_u32 {
            let mut state = seed;
            let mut left = 0_i32;
            let is_heard = |_: &u32| {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                let drawn = (state >> 16) as i32;
                if left == 0 {
                    let burst = 1 + drawn % 8;
                    let goes_out = drawn / 8 % share == 0;
                    left = if goes_out { burst } else { -burst };
                }
                let is_out = left > 0;
                left -= left.signum();
                !is_out
            };
            let heard = (0..200).filter(is_heard);
            assert_eq!(drive(heard, |_| [TURN, TURN / 2], honest), None, "{seed}");
        }
    }
}

#[test]
fn a_wheel_is_not_told_back_by_a_base_that_stops_driving_sooner_than_turning() {
    let mut odometry = Odometry::new(&mission("robot = { model = 'kobuki', rate_hz = 10 }"));
    let mut rolled = [0.0; 2];
    for tick in 0..30 {
        let now = at(f64::from(tick) / 10.0);
        odometry.plausible(rolled.map(on_wire), now);
        let (tells, rolls) = match tick {
            0..20 => ([0, 5000], [0.0, 500.0]),
            _ => ([0, 0], [60.0, 200.0]),
        };
        odometry.commanded(tells, now);
        for wheel in 0..2 {
            rolled[wheel] += rolls[wheel];
        }
        assert_eq!(suspicion(&odometry), None, "tick {tick}");
    }
}

#[test]
fn wheels_held_for_half_a_second_are_not_suspected() {
    // The frames repeat, and then continue from the same counts.
    let mut held = [0; 2];
    let says = |tick: u32, counts: [u16; 2]| {
        if !(22..=24).contains(&tick) {
            held = counts;
        }
        held
    };
    assert_eq!(drive(0..60, ahead, says), None);
}

#[test]
fn a_command_after_a_lapse_is_judged_anew() {
    let mut odometry = odometry();
    for told in [0.0, 0.2, 10.0] {
        odometry.commanded([TURN; 2], at(told));
    }
    assert_eq!(odometry.evidence[0].since, at(10.0));
}

#[test]
fn encoders_that_repeat_die_are_late_reversed_or_swapped_are_suspected_in_time_and_named() {
    use Suspicion::{Left, Right, Turn};
    type Says = fn([u16; 2]) -> [u16; 2];
    let same: Says = |_| [32_767; 2];
    let dead: Says = |[left, _]| [left, 0];
    let reversed: Says = |counts| counts.map(|count| (COUNT_CYCLE - count) % COUNT_CYCLE);
    let swapped: Says = |[left, right]| [right, left];
    let suspected = |tells: [[i16; 2]; 4], says: Says| {
        drive(0..40, |tick| tells[tick as usize % 4], |_, counts| says(counts))
    };
    for (tells, says, why) in [
        ([[TURN; 2]; 4], same, Left),
        ([[-80, 80]; 4], same, Left),
        ([[TURN; 2]; 4], dead, Right),
        ([[TURN; 2]; 4], reversed, Left),
        // Commands for a robot that turns away from the target.
        ([[584; 2], [584; 2], [-584; 2], [-584; 2]], reversed, Left),
        ([[-TURN, TURN]; 4], swapped, Left),
        // In a curve both wheels roll forward, but the robot turns the other way.
        ([[TURN / 2, TURN]; 4], swapped, Turn),
    ] {
        in_time(suspected(tells, says), why, (says([1, 2]), tells));
    }
    let mut said = VecDeque::from([[0; 2]; 14]);
    let late = |_, counts| {
        said.push_back(counts);
        said.pop_front().unwrap()
    };
    in_time(drive(0..40, ahead, late), Left, "late");
    // The direction changes with every tick.
    let to_and_fro = [[400, -400], [-400, 400]];
    let [to, fro] = to_and_fro;
    let dead = suspected([to, fro, to, fro], dead);
    assert!(matches!(dead, Some((after_s, Right)) if after_s < 1.5), "{dead:?}");
    assert_eq!(drive(0..200, |tick| to_and_fro[tick as usize % 2], honest), None);
}

#[test]
fn three_jumps_within_two_seconds_are_suspected_until_two_seconds_without_twice_at_most() {
    let mut odometry = odometry();
    for frame in 0..20 {
        odometry.implausible(at(2.0 * f64::from(frame)));
        assert_eq!(suspicion(&odometry), None);
    }
    for start in [50.0, 60.0, 70.0] {
        for jump in 0..3 {
            assert_eq!(suspicion(&odometry), None);
            odometry.implausible(at(start + PERIOD_S * f64::from(jump)));
        }
        assert_eq!(suspicion(&odometry), Some(Suspicion::Jumps));
        odometry.plausible([5, 5], at(start + 2.2));
        assert_eq!(suspicion(&odometry), Some(Suspicion::Jumps));
        odometry.plausible([5, 5], at(start + 2.3));
    }
    assert_eq!(suspicion(&odometry), Some(Suspicion::Jumps), "the third time");
}

/// Current of a rolling and of a held wheel.
const ROLLS_AD: u16 = 260;
const HELD_AD: u16 = 1520;

/// Drives a robot of which these wheels are held; wheels draw `current(held, ticks at rest)`. The
/// robot stands while they are known to be held. Returns the contacts, and the suspicion, with
/// seconds.
fn held(
    held: [bool; 2],
    tells: [i16; 2],
    current: impl Fn(bool, u32) -> u16,
) -> (Vec<(f64, ContactSample)>, Suspected) {
    let mut odometry = odometry();
    let (mut contacts, mut stood, mut rolled) = (Vec::new(), 1, [0.0; 2]);
    for tick in 0..40 {
        let time = f64::from(tick) * PERIOD_S;
        odometry.contacts.currents = held.map(|held| current(held, stood));
        odometry.plausible(rolled.map(on_wire), at(time));
        contacts.extend(odometry.contacts.new.take().map(|contact| (time, contact)));
        if let Some(suspicion) = suspicion(&odometry) {
            return (contacts, Some((time, suspicion)));
        }
        let moment = Moment { time: at(time), ..Moment::default() };
        let stands = odometry.condition(Cause::WheelsHeld, moment) == Condition::Holds;
        stood = if stands { stood + 1 } else { 0 };
        let told = if stands { [0, 0] } else { tells };
        odometry.commanded(told, at(time));
        for wheel in 0..2 {
            rolled[wheel] += if held[wheel] { 0.0 } else { f64::from(told[wheel]) * PERIOD_S };
        }
    }
    (contacts, None)
}

#[test]
fn wheels_that_draw_the_current_of_held_ones_are_a_contact_ahead_and_no_suspicion() {
    // The current falls within 0.35 s.
    let current = |_: bool, stood| if stood > 2 { 20 } else { HELD_AD };
    let (contacts, suspicion) = held([true; 2], [TURN; 2], current);
    assert_eq!(suspicion, None);
    let (first_s, first) = contacts[0];
    assert!(first_s < 1.0, "{first_s}");
    assert_eq!((first.left, first.right, first.bearing_rad), (1, 1, 0.0));
    assert!(first.half_width_rad > 0.0);
    assert!(contacts.len() > 2, "a robot that stays held is noticed again");
}

#[test]
fn a_current_that_repeats_is_beyond_the_range_low_or_high_on_rolling_wheels_is_no_sign_of_held_ones()
 {
    for current in [HELD_AD, u16::MAX, ROLLS_AD] {
        in_time(held([true; 2], [TURN; 2], |_, _| current).1, Suspicion::Left, current);
    }
    let mut robot = (odometry(), Wheels::default());
    let suspected = (0..60).find_map(|tick| {
        robot.0.contacts.currents = [HELD_AD; 2];
        // The encoders die after 5 s.
        let says = |counts: [u16; 2]| if tick <= 35 { counts } else { [0; 2] };
        let time = f64::from(tick) * PERIOD_S;
        let suspected = turn(&mut robot, time, says, [TURN; 2]);
        assert!(robot.0.contacts.new.is_none());
        suspected
    });
    assert!(suspected.unwrap().0 < 6.2, "{suspected:?}");
}

#[test]
fn one_held_wheel_is_a_contact_at_its_side_and_behind_a_robot_that_backs() {
    use std::f64::consts::{FRAC_PI_2, PI};
    let contact =
        |wheels, tells| held(wheels, tells, |held, _| if held { HELD_AD } else { ROLLS_AD }).0[0].1;
    let left = contact([true, false], [TURN; 2]);
    assert!(left.bearing_rad > 0.0 && left.bearing_rad < FRAC_PI_2, "{left:?}");
    let right = contact([false, true], [TURN; 2]);
    assert_eq!((right.left, right.right, right.bearing_rad), (0, 1, -left.bearing_rad));
    near(contact([true; 2], [-TURN; 2]).bearing_rad, PI, 1e-9);
    // A turn on the spot may touch anywhere.
    assert_eq!(contact([true; 2], [-TURN, TURN]).half_width_rad, 0.0);
}

#[test]
fn a_robot_that_another_host_turns_or_speeds_is_suspected_and_the_words_name_that() {
    for (other, hertz, is_named) in [
        ([-TURN / 2, TURN / 2], 20.0, false),
        ([TURN / 2, -TURN / 2], 10.0, false),
        ([TURN, TURN], 20.0, true),
        ([-TURN / 2, -TURN / 2], 20.0, false),
    ] {
        let mut robot = (odometry(), Wheels::default());
        let mut told_s = 0.0;
        let suspected = (0..140).find_map(|tick| {
            let time = f64::from(tick) * PERIOD_S;
            while told_s < time {
                robot.1.roll_to(told_s);
                robot.1.told.push((told_s, other));
                told_s += 1.0 / hertz;
            }
            turn(&mut robot, time, |counts| counts, [TURN / 3; 2])
        });
        let (after_s, suspicion) = suspected.unwrap();
        assert!(after_s < 5.0, "{other:?}: {suspected:?}");
        assert!(!is_named || suspicion == Suspicion::Untold, "{suspected:?}");
    }
    assert!(Suspicion::Untold.words().contains("another program commands"));
}
