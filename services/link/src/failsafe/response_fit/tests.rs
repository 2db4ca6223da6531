use common::mission::ModelledSpeed;

use super::*;

const PERIOD_S: f64 = 0.1;
const AXLE: Axle = Axle { counts_per_m: 1000.0, track_m: Some(0.3) };

type Encoders = fn([f64; 2]) -> [f64; 2];
const HONEST: Encoders = |turned| turned;
const SLIPS: Encoders = |turned| turned.map(|counts| 0.8 * counts);
const ONE_DEAD: Encoders = |[_, right]| [0.0, right];
const SWAPPED: Encoders = |[left, right]| [right, left];
const REVERSED: Encoders = |[left, right]| [-left, right];
const DEAD: Encoders = |_| [0.0; 2];

/// Returns the fit of wheels that reach `gain` of `commands(tick)`; `encoders` alters the
/// counts.
fn driven(
    [delay_s, acceleration]: [f64; 2],
    gain: f64,
    ticks: usize,
    encoders: Encoders,
    commands: impl Fn(usize) -> [f64; 2],
) -> ResponseFit {
    let mut fit = ResponseFit::new(AXLE);
    let mut wheels = [(); 2].map(|()| ModelledSpeed::new(delay_s, acceleration * 1000.0));
    for tick in 0..ticks {
        let now = tick as f64 * PERIOD_S;
        let time = MissionTime::from_seconds(now);
        let turned = wheels.each_mut().map(|wheel| wheel.go_on(now));
        fit.turned((tick > 0).then(|| encoders(turned)), time);
        let command = commands(tick);
        fit.commanded(command, time);
        for (wheel, speed) in wheels.iter_mut().zip(command) {
            wheel.command(now, gain * speed);
        }
    }
    fit
}

/// Commands to drive ahead, left, ahead, right.
fn winding(tick: usize) -> [f64; 2] {
    [[300.0, 300.0], [100.0, 300.0], [300.0, 300.0], [300.0, 50.0]][tick / 8 % 4]
}

fn explained(response: [f64; 2], encoders: Encoders) -> Option<Response> {
    let suspected = Suspected { channel: 0, from_s: 3.0 };
    driven(response, 1.0, 45, encoders, winding).explain(Response::X80, suspected)
}

/// Returns the slowest response that fits wheels at 0.78 of their commands.
fn slowest(response: [f64; 2], ticks: usize, encoders: Encoders) -> Option<Response> {
    let found = driven(response, 0.78, ticks, encoders, winding).alike(None, 0.5);
    found.filter(|found| found.are_told_apart).map(|found| found.slowest)
}

#[test]
fn delay_and_acceleration_of_a_base_of_which_nobody_stated_them_are_found_together_and_on_the_slow_side()
 {
    let stops_m = |[delay_s, acceleration]: [f64; 2]| 0.5 * delay_s + 0.125 / acceleration;
    for response in [[0.4, 0.3], [0.25, 0.6], [0.1, 0.3], [0.4, 3.0], [0.1, f64::INFINITY]] {
        let found = slowest(response, 45, HONEST).unwrap();
        let found_m = stops_m([found.dead_time_s(), found.acceleration_m_s2]);
        let share = found_m / (stops_m(response) + 0.02);
        assert!((0.9..1.7).contains(&share), "{response:?} {found:?}: {share}");
    }
    let ramp = slowest([0.4, 0.3], 8, HONEST);
    assert!(ramp.is_none_or(|found| found.acceleration_m_s2 <= 0.3));
    let dead = [DEAD, ONE_DEAD].map(|encoders| slowest([0.1, 0.6], 45, encoders));
    assert_eq!(dead, [None; 2]);
}

#[test]
fn a_base_that_stops_later_than_stated_contradicts_that_and_one_that_is_as_stated_does_not() {
    let stated = Response { acceleration_m_s2: 1.0, ..Response::X80 };
    for (base, contradicts) in
        [([0.25, 0.3], true), ([stated.dead_time_s(), 1.0], false), ([0.1, f64::INFINITY], false)]
    {
        let found = driven(base, 0.78, 45, HONEST, winding).alike(Some(stated), 0.5);
        let later = found.is_some_and(|found| found.stops_within_m > 0.4);
        assert_eq!(later, contradicts, "{base:?}");
    }
}

#[test]
fn a_slow_and_a_late_base_are_found_out_and_no_response_explains_dead_swapped_and_reversed_wheels()
{
    for (delay_s, acceleration) in [(0.1, 0.3), (0.4, 0.6), (0.3, f64::INFINITY), (0.1, 5.0)] {
        let found = explained([delay_s, acceleration], HONEST).unwrap();
        let dead = found.dead_time_s();
        assert!((dead - delay_s).abs() < 0.06, "{delay_s} {acceleration}: {found:?}");
        if acceleration < 1.0 {
            // A rim of the turning robot is 0.15 m from its middle.
            for rim in [found.acceleration_m_s2, 0.15 * found.turn_acceleration_rad_s2] {
                let share = rim / acceleration;
                assert!((0.7..=1.4).contains(&share), "{delay_s} {acceleration}: {found:?}");
            }
        }
    }
    assert!(explained([0.2, 0.6], SLIPS).is_some());
    let faulty = [ONE_DEAD, SWAPPED, REVERSED, DEAD];
    assert_eq!(faulty.map(|encoders| explained([0.1, 0.6], encoders)), [None; 4]);
}

#[test]
fn wheels_that_still_slow_down_from_an_older_command_turn_as_told_and_faster_ones_do_not() {
    let mut fit = ResponseFit::new(AXLE);
    for (speed, at_s) in [(500.0, 1.0), (0.0, 1.25), (100.0, 2.9)] {
        fit.commanded([speed; 2], MissionTime::from_seconds(at_s));
    }
    // At 3 s, judged from 2 s on, slowing by 0.3 m/s^2.
    for (speed, most, expected) in
        [(240.0, 300.0, false), (420.0, 300.0, true), (260.0, f64::INFINITY, true)]
    {
        let limits = Limits { are_apart: false, most: [most; 2] };
        assert_eq!(fit.is_untold([speed; 2], (2.0, limits), 100.0), expected, "{speed}");
    }
}

#[test]
fn frames_that_are_half_a_second_late_are_found_out_while_the_robot_drives_on_and_no_fault_of_wheels_is()
 {
    for (late_s, encoders, is_found) in [
        (0.5, SLIPS, true),
        (1.0, SLIPS, true),
        (0.1, SLIPS, false),
        (0.0, SWAPPED, false),
        (0.0, ONE_DEAD, false),
        (0.0, REVERSED, false),
    ] {
        let base = [Response::X80.dead_time_s() + late_s, f64::INFINITY];
        let curves = |tick| match tick % 32 {
            0..16 => [300.0, 300.0],
            16..20 => [100.0, 300.0],
            _ => [300.0, 150.0],
        };
        let found = driven(base, 1.0, 70, encoders, curves).later(Response::X80);
        let found = found.map(|found| found.delay_s - Response::X80.delay_s);
        let is_right = |found: f64| is_found && (found - late_s).abs() < 0.11;
        assert!(found.map_or(!is_found, is_right), "{late_s}: {found:?}");
    }
}

#[test]
fn frames_of_one_time_add_up() {
    let mut fit = ResponseFit::new(AXLE);
    for _ in 0..2 {
        fit.turned(Some([3.0, 5.0]), MissionTime::default());
    }
    assert_eq!(fit.turned, [(0.0, Some([6.0, 10.0]))]);
}

#[test]
fn a_motion_that_repeats_itself_makes_no_prompt_base_a_whole_round_later() {
    // Looks to both sides, drives, stands: 2 s per round.
    let rounds = |tick| match tick % 20 {
        0..6 => [-180.0, 180.0],
        6..11 => [180.0, -180.0],
        11..17 => [300.0, 300.0],
        _ => [0.0, 0.0],
    };
    for ticks in 1..=90 {
        let fit = driven([0.02, f64::INFINITY], 1.0, ticks, HONEST, rounds);
        assert!(fit.later(Response::X80).is_none(), "after {ticks} ticks");
    }
}
