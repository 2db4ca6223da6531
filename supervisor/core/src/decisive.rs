//! Which of the things that end a mission came first, and at which tick. Pure.
//!
//! The stages go on until the supervisor has seen one of them and stopped the robot. How far they get by then depends on
//! the machine; what came first does not.

use common::{ground_truth::GroundTruthTick, samples::PoseSample};

use crate::{
    judge::{reached, timed_out, touched},
    observer::Record,
    outcome::{Ending, Outcome},
};

/// The first tick of the simulated robot at which its body had touched something.
pub(crate) fn first_contact(truth: &[GroundTruthTick]) -> Option<&GroundTruthTick> {
    truth.get(truth.partition_point(|tick| tick.contacts == 0))
}

/// The ending of a run that was seen to end with `ending`, and the tick that decided it; none where no tick did. `stall`
/// is the tick of the newest stall.
pub(crate) fn first(
    ending: Ending,
    record: &Record,
    truth: &[GroundTruthTick],
    timeout_s: f64,
    stall: Option<u64>,
) -> (Ending, Option<u64>) {
    if ending.outcome == Outcome::Aborted {
        return (ending, None);
    }
    let contact = first_contact(truth).map(|contact| {
        let tick = tick_of(contact, &record.poses);
        (tick, touched([contact.x, contact.y]))
    });
    let arrival = record
        .arrival
        .map(|command| (command.stamp.tick, reached(command.distance_m)));
    let late = record
        .poses
        .partition_point(|pose| pose.stamp.time().seconds() < timeout_s);
    let timeout = record
        .poses
        .get(late)
        .map(|pose| (pose.stamp.tick, timed_out(timeout_s)));
    let stall = stall.filter(|_| ending.outcome == Outcome::Unreachable);
    let stall = stall.map(|tick| (tick, ending.clone()));
    // Of two at one tick the one named first.
    [contact, arrival, timeout, stall]
        .into_iter()
        .flatten()
        .min_by_key(|&(tick, _)| tick)
        .map_or((ending, None), |(tick, first)| (first, Some(tick)))
}

/// The tick of the pose that was computed from what the robot measured at `truth`. A robot at rest measures the same for
/// many ticks, and the two number theirs alike where nothing was lost on the way.
fn tick_of(truth: &GroundTruthTick, poses: &[PoseSample]) -> u64 {
    poses
        .iter()
        .filter(|pose| truth.is_of(pose))
        .map(|pose| pose.stamp.tick)
        .min_by_key(|tick| tick.abs_diff(truth.tick))
        .unwrap_or(truth.tick)
}

#[cfg(test)]
mod tests {
    use common::samples::{CommandSample, Stamp};

    use super::*;

    const TIMEOUT_S: f64 = 20.0;

    fn truth(tick: u64, contacts: u64) -> GroundTruthTick {
        GroundTruthTick {
            tick,
            time_s: tick as f64,
            x: 0.0,
            y: 0.0,
            heading: 0.0,
            v: 0.0,
            omega: 0.0,
            clearance_m: 1.0,
            contacts,
            left_counts: tick as u16,
            right_counts: tick as u16,
            sonar_cm: 255,
            stopping_time_s: 0.0,
            radio: None,
        }
    }

    /// A run of `ticks` ticks of a second, in which the robot arrived and touched something at given ones.
    fn run(
        ticks: u64,
        arrival: Option<u64>,
        contact: Option<u64>,
    ) -> (Record, Vec<GroundTruthTick>) {
        let stamp = |tick| Stamp {
            tick,
            stamp_ns: tick * 1_000_000_000,
            ..Stamp::default()
        };
        let pose = |tick| PoseSample {
            stamp: stamp(tick),
            left_counts: tick as u16,
            right_counts: tick as u16,
            ..PoseSample::default()
        };
        let mut record = Record::default();
        record.poses = (0..ticks).map(pose).collect();
        record.arrival = arrival.map(|tick| CommandSample {
            stamp: stamp(tick),
            ..CommandSample::default()
        });
        let touched = |tick| u64::from(contact.is_some_and(|contact| tick >= contact));
        let truth = (0..ticks).map(|tick| truth(tick, touched(tick))).collect();
        (record, truth)
    }

    #[test]
    fn what_came_first_ends_a_run_however_late_it_was_seen() {
        use Outcome::{Aborted, Collision, Reached, Timeout, Unreachable};
        #[rustfmt::skip]
        let rows = [
            ("the arrival", 10, Some(8), None, Reached, (Reached, Some(8))),
            ("a touch before the arrival, which was read first", 12, Some(8), Some(6), Reached, (Collision, Some(6))),
            ("an arrival before a touch, which was read first", 12, Some(8), Some(9), Collision, (Reached, Some(8))),
            ("a touch at the tick of the arrival", 12, Some(8), Some(8), Reached, (Collision, Some(8))),
            ("a touch seen some ticks later", 15, None, Some(6), Collision, (Collision, Some(6))),
            ("the timeout seen some ticks later", 25, None, None, Timeout, (Timeout, Some(20))),
            ("a stall", 18, None, None, Unreachable, (Unreachable, Some(15))),
            ("a touch before a stall", 18, None, Some(3), Unreachable, (Collision, Some(3))),
            ("what no tick decided", 18, None, Some(3), Aborted, (Aborted, None)),
        ];
        for (what, ticks, arrival, contact, seen, want) in rows {
            let (record, truth) = run(ticks, arrival, contact);
            let (ending, tick) = first(
                Ending::failed(seen, ""),
                &record,
                &truth,
                TIMEOUT_S,
                Some(15),
            );
            assert_eq!((ending.outcome, tick), want, "{what}");
        }
    }
}
