//! Decision whether the robot may drive, and the hold reason. Pure.

use common::samples::{HoldReason, Order};

pub(crate) struct Snapshot {
    /// Whether the robot was ever ready on this bus.
    pub was_ready: bool,
    pub all_running: bool,
    /// Whether the link receives data from the robot.
    pub robot_answers: bool,
    /// Whether the planner has published a field, so that the first tick has one.
    pub field_known: bool,
    pub operator_stop: bool,
    pub stage_held: bool,
    pub waits: bool,
    pub lost: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Decision {
    /// Whether the robot was ever ready; since then the link stops it when a stage is down.
    pub ready: bool,
    pub reason: HoldReason,
}

impl Decision {
    pub(crate) const STARTING: Self = Self { ready: false, reason: HoldReason::Starting };
    pub(crate) const ENDING: Self = Self { ready: false, reason: HoldReason::Ending };

    pub(crate) const fn order(self) -> Order {
        match self.reason {
            HoldReason::None => Order::Drive,
            HoldReason::Ending => Order::Stop,
            HoldReason::Starting
            | HoldReason::Operator
            | HoldReason::StageHeld
            | HoldReason::Waiting
            | HoldReason::Lost => Order::Hold,
        }
    }
}

pub(crate) const fn decide(snapshot: &Snapshot) -> Decision {
    let can_start = snapshot.all_running && snapshot.robot_answers && snapshot.field_known;
    let ready = snapshot.was_ready || can_start;
    let reason = if !ready {
        HoldReason::Starting
    } else if snapshot.operator_stop {
        HoldReason::Operator
    } else if snapshot.stage_held {
        HoldReason::StageHeld
    } else if snapshot.lost {
        HoldReason::Lost
    } else if snapshot.waits {
        HoldReason::Waiting
    } else {
        HoldReason::None
    };
    Decision { ready, reason }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CAN_START: Snapshot = Snapshot {
        was_ready: false,
        all_running: true,
        robot_answers: true,
        field_known: true,
        operator_stop: false,
        stage_held: false,
        waits: false,
        lost: false,
    };
    const ALL_LOST: Snapshot = Snapshot {
        was_ready: true,
        all_running: false,
        robot_answers: false,
        field_known: false,
        ..CAN_START
    };

    #[test]
    fn every_rule_of_the_order_decides_its_row() {
        use HoldReason::{Ending, Lost, None, Operator, StageHeld, Starting, Waiting};
        #[rustfmt::skip]
        let rows = [
            ("drives once all is ready", CAN_START, None),
            ("waits for every stage", Snapshot { all_running: false, ..CAN_START }, Starting),
            ("waits for the robot", Snapshot { robot_answers: false, ..CAN_START }, Starting),
            ("waits for a field", Snapshot { field_known: false, ..CAN_START }, Starting),
            ("once ready stays ready", ALL_LOST, None),
            ("an operator's stop holds", Snapshot { operator_stop: true, ..CAN_START }, Operator),
            ("a robot without a target waits", Snapshot { waits: true, ..CAN_START }, Waiting),
            ("a robot that lost what it follows holds", Snapshot { lost: true, waits: true, ..CAN_START }, Lost),
            ("a held stage holds", Snapshot { stage_held: true, ..CAN_START }, StageHeld),
            ("starting comes before an operator's stop",
             Snapshot { field_known: false, operator_stop: true, ..CAN_START }, Starting),
            ("an operator's stop comes before a held stage",
             Snapshot { operator_stop: true, stage_held: true, ..CAN_START }, Operator),
        ];
        for (rule, snapshot, reason) in rows {
            let decision = Decision { ready: reason != Starting, reason };
            assert_eq!(decide(&snapshot), decision, "{rule}");
            let order = if reason == None { Order::Drive } else { Order::Hold };
            assert_eq!(decision.order(), order, "{rule}");
        }
        assert_eq!(Decision { ready: true, reason: Ending }.order(), Order::Stop);
    }
}
