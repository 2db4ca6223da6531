//! Event that ended a mission first, and the part of the run that counts. Pure.
//!
//! After an event, the stages run until the supervisor has stopped the robot. Their progress until
//! then depends on the machine; the order of events is deterministic.

use common::{ground_truth::GroundTruthTick, mission::Mission, samples::PoseSample};

use crate::{
    judge::{Deadline, arrived, touched},
    observer::Record,
    outcome::{Ending, Outcome},
};

pub(crate) fn first_contact<'a>(
    truth: &'a [GroundTruthTick],
    mission: &Mission,
) -> Option<&'a GroundTruthTick> {
    truth
        .get(truth.partition_point(|tick| tick.contacts == 0))
        .filter(|_| !mission.simulation.goes_on_after_contact)
}

pub(crate) struct Decided {
    pub ending: Ending,
    /// Last complete tick; `None` if no tick decided. The tick of an event may be incomplete.
    pub last_tick: Option<u64>,
    /// Ground-truth ticks that count, up to the contact or last tick.
    pub truth_ticks: usize,
}

#[derive(Clone, Copy)]
pub(crate) struct Timeout {
    pub deadline: Deadline,
    /// Whether the simulated robot's clock decides; it also counts lost ticks.
    pub by_robot: bool,
}

impl Timeout {
    fn tick(self, poses: &[PoseSample], truth: &[GroundTruthTick]) -> Option<u64> {
        let seconds = self.deadline.at_s();
        if self.by_robot {
            let late = truth.partition_point(|tick| tick.time_s < seconds);
            return truth.get(late).map(|tick| tick_of(tick, poses));
        }
        let late = poses.partition_point(|pose| pose.stamp.seconds() < seconds);
        poses.get(late).map(|pose| pose.stamp.tick)
    }
}

/// Returns the first event of a run that the supervisor saw end with `ending`.
///
/// `stall` holds the tick and ending of a stall without a remaining recovery step.
pub(crate) fn first(
    ending: Ending,
    record: &Record,
    truth: &[GroundTruthTick],
    mission: &Mission,
    timeout: Timeout,
    stall: Option<(u64, Ending)>,
) -> Decided {
    let undecided = |ending| Decided { ending, last_tick: None, truth_ticks: truth.len() };
    if ending.outcome == Outcome::Aborted {
        return undecided(ending);
    }
    let poses = &record.poses;
    let contact = first_contact(truth, mission)
        .map(|contact| (tick_of(contact, poses), touched([contact.x, contact.y])));
    let arrival = record.arrival.map(|it| {
        let beside = record.beside(&it, mission.arrival_tolerance_m);
        (it.stamp.tick, arrived(it.distance_m, beside))
    });
    let arrived_in = arrival.as_ref().map(|(tick, _)| *tick);
    let late = timeout.tick(poses, truth).map(|tick| (tick, timeout.deadline.timed_out()));
    // Of two events in one tick, the first in the list counts.
    let events = [contact, arrival, late, stall];
    let ticks_until = |pose: Option<&PoseSample>| {
        pose.and_then(|pose| truth_of(pose, truth)).map_or(truth.len(), |index| index + 1)
    };
    let Some((tick, ending)) = events.into_iter().flatten().min_by_key(|event| event.0) else {
        // The robot waits. How far it rolls after its newest tick depends on how its processes end.
        return Decided { truth_ticks: ticks_until(poses.last()), ..undecided(ending) };
    };
    let last_tick = match ending.outcome {
        // The arrival's command is the mission's last.
        Outcome::Reached | Outcome::Unreachable if arrived_in == Some(tick) => tick,
        _ => tick.saturating_sub(1),
    };
    let truth_ticks = match ending.outcome {
        Outcome::Collision => truth.partition_point(|tick| tick.contacts == 0) + 1,
        Outcome::Timeout if timeout.by_robot => {
            truth.partition_point(|tick| tick.time_s < timeout.deadline.at_s())
        }
        _ => ticks_until(record.pose_at(last_tick)),
    };
    assert!(truth_ticks <= truth.len());
    Decided { ending, last_tick: Some(last_tick), truth_ticks }
}

/// Returns the ground-truth index of `pose`: same counts, nearest number.
pub(crate) fn truth_of(pose: &PoseSample, truth: &[GroundTruthTick]) -> Option<usize> {
    truth
        .iter()
        .enumerate()
        .filter(|(_, it)| it.is_of(pose))
        .min_by_key(|(_, it)| it.heard_tick().abs_diff(pose.stamp.tick))
        .map(|(index, _)| index)
}

/// Returns the tick of the pose computed from `truth`, or the number it would have.
fn tick_of(truth: &GroundTruthTick, poses: &[PoseSample]) -> u64 {
    poses
        .iter()
        .filter(|pose| truth.is_of(pose))
        .map(|pose| pose.stamp.tick)
        .min_by_key(|tick| tick.abs_diff(truth.heard_tick()))
        .unwrap_or(truth.heard_tick())
}

#[cfg(test)]
mod tests {
    use common::samples::{CommandSample, Stamp};

    use super::*;
    use crate::testing;

    const TIMEOUT: Timeout = Timeout {
        deadline: Deadline { began_s: 0.0, timeout_s: 20.0, stopped_s: 0.0 },
        by_robot: true,
    };

    /// A run with ticks of one second.
    fn run(
        ticks: u64,
        arrival: Option<u64>,
        contact: Option<u64>,
    ) -> (Record, Vec<GroundTruthTick>) {
        let stamp = |tick| Stamp { tick, stamp_ns: tick * 1_000_000_000, ..Stamp::default() };
        let pose = |tick| PoseSample {
            stamp: stamp(tick),
            left_counts: tick as u16,
            right_counts: tick as u16,
            ..PoseSample::default()
        };
        let mut record = Record::default();
        record.poses = (0..ticks).map(pose).collect();
        record.arrival =
            arrival.map(|tick| CommandSample { stamp: stamp(tick), ..CommandSample::default() });
        let truth = |tick| GroundTruthTick {
            tick,
            time_s: tick as f64,
            contacts: u64::from(contact.is_some_and(|contact| tick >= contact)),
            left_counts: tick as u16,
            right_counts: tick as u16,
            ..GroundTruthTick::default()
        };
        let truth = (0..ticks).map(truth).collect();
        (record, truth)
    }

    #[test]
    fn what_came_first_ends_a_run_however_late_it_was_seen() {
        use Outcome::{Aborted, Collision, Reached, Timeout, Unreachable};
        #[rustfmt::skip]
        let rows = [
            ("the arrival", 10, Some(8), None, Reached, (Reached, Some(8), 9)),
            ("a touch before the arrival, which was read first", 12, Some(8), Some(6), Reached, (Collision, Some(5), 7)),
            ("an arrival before a touch, which was read first", 12, Some(8), Some(9), Collision, (Reached, Some(8), 9)),
            ("a touch at the tick of the arrival", 12, Some(8), Some(8), Reached, (Collision, Some(7), 9)),
            ("a touch seen some ticks later", 15, None, Some(6), Collision, (Collision, Some(5), 7)),
            ("the timeout seen some ticks later", 25, None, None, Timeout, (Timeout, Some(19), 20)),
            ("a stall", 18, None, None, Unreachable, (Unreachable, Some(14), 15)),
            ("a stall before a touch, which was read first", 18, None, Some(16), Collision, (Unreachable, Some(14), 15)),
            ("a touch before a stall", 18, None, Some(3), Unreachable, (Collision, Some(2), 4)),
            ("what no tick decided", 18, None, Some(3), Aborted, (Aborted, None, 18)),
        ];
        for (what, ticks, arrival, contact, seen, want) in rows {
            let (record, truth) = run(ticks, arrival, contact);
            let decided = first(
                Ending::failed(seen, ""),
                &record,
                &truth,
                &testing::mission("target = [3, 0]"),
                TIMEOUT,
                (ticks == 18).then(|| (15, Ending::failed(Unreachable, ""))),
            );
            let Decided { ending, last_tick, truth_ticks } = decided;
            assert_eq!((ending.outcome, last_tick, truth_ticks), want, "{what}");
        }
    }
}
