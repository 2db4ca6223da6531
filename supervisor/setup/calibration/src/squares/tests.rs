use common::{mission::Procedure, samples::GuidanceStatus};

use super::*;
use crate::{
    script::Script,
    wall::tests::{body, counts_of, obeyed},
};

/// Drives a square with wheels of this ratio and track, without slip.
fn drive(ratio: f64, track: f64, to_the_left: bool) -> Driven {
    let wheels = Wheels { e: (ratio - 1.0) / (ratio + 1.0), track };
    let side = if to_the_left { Procedure::LeftSquare } else { Procedure::RightSquare };
    let mut square = Script::new(side, 2.0, 7.0);
    let mut pose = Pose2::default();
    let (mut nominal, mut ways) = ([0.0; 2], Vec::new());
    for _ in 0..2000 {
        let order = square.step(counts_of(nominal), None, &body());
        if order.status == GuidanceStatus::AtTarget {
            break;
        }
        let [left, right] = obeyed(&order);
        nominal = [nominal[0] + left, nominal[1] + right];
        ways.push([left, right]);
        let turned = wheels.turned(left, right, body().track_m);
        pose = pose.along_arc(f64::midpoint(left, right), turned);
    }
    let last = square.step(counts_of(nominal), None, &body());
    assert_eq!(last.status, GuidanceStatus::AtTarget);
    Driven { ways, end: pose.position }
}

fn squares(ratio: f64, track: f64) -> Vec<Driven> {
    (0..8).map(|index| drive(ratio, track, index % 2 == 0)).collect()
}

#[test]
fn nominal_wheels_come_back_to_their_mark() {
    for to_the_left in [true, false] {
        assert!(drive(1.0, 1.0, to_the_left).end.length() < 0.15);
    }
}

#[test]
fn ratio_and_track_are_found_from_the_ends_of_squares() {
    for (ratio, track) in [(1.006, 1.02), (0.994, 0.98)] {
        let estimate = checked(&squares(ratio, track), body().track_m).unwrap();
        assert!((estimate.ratio() - ratio).abs() < 0.0005, "{ratio}: {estimate:?}");
        assert!((estimate.track() - track).abs() < 0.002, "{track}: {estimate:?}");
    }
}

#[test]
fn an_end_that_was_typed_wrongly_is_refused() {
    let mut squares = squares(1.002, 1.0);
    squares[7].end += DVec2::new(1.0, 0.0);
    let refusal = checked(&squares, body().track_m);
    assert!(matches!(refusal, Err(Refusal::Contradicted { .. })), "{refusal:?}");
    assert_eq!(checked(&squares[..4], body().track_m), Err(Refusal::TooFewSquares { found: 4 }));
}
