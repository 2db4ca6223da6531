//! Table of faults that can be injected into a running stage, to test the others.
//! `firsthand stage fault`, its help and the guide read it. A stage's shell refuses faults of a
//! real robot without confirmation.

use crate::samples::{FaultAnswer, FaultKind, FaultSample};

#[derive(Debug)]
pub struct Fault {
    pub kind: FaultKind,
    pub name: &'static str,
    /// `None` for a fault of every stage.
    pub stage: Option<&'static str>,
    pub meaning: &'static str,
    pub ends: &'static str,
}

pub static TABLE: [Fault; 6] = [
    Fault {
        kind: FaultKind::Spin,
        name: "spin",
        stage: None,
        meaning: "the work loop hangs, without outputs and heartbeats",
        ends: "the supervisor aborts the stage as hung and starts it again",
    },
    Fault {
        kind: FaultKind::Mute,
        name: "mute",
        stage: None,
        meaning: "the work loop only sends heartbeats: it reads no inputs and writes no outputs",
        ends: "the supervisor aborts a stage whose inputs continue and starts it again",
    },
    Fault {
        kind: FaultKind::HazardAroundRobot,
        name: "hazard-around-robot",
        stage: Some("mapper"),
        meaning: "the grid holds a hazard of 0.5 m around the robot wherever it goes; the robot stands where u = 0",
        ends: "the mapper forgets the sensed obstacles",
    },
    Fault {
        kind: FaultKind::CutOff,
        name: "cut-off",
        stage: Some("mapper"),
        meaning: "the grid holds a closed wall 0.5 m around the target, also after the mapper forgets the sensed obstacles",
        ends: "never: the mission ends unreachable",
    },
    Fault {
        kind: FaultKind::CorruptField,
        name: "corrupt-field",
        stage: Some("planner"),
        meaning: "the live field is overwritten: every path leads to the robot's position",
        ends: "the planner solves the field in full",
    },
    Fault {
        kind: FaultKind::Saddle,
        name: "saddle",
        stage: Some("planner"),
        meaning: "the planner gives no direction, as where the gradient is zero",
        ends: "a new process replaces the planner",
    },
];

pub fn find(stage: &str, name: &str) -> Option<&'static Fault> {
    of(stage).find(|fault| fault.name == name)
}

pub fn of(stage: &str) -> impl Iterator<Item = &'static Fault> {
    TABLE.iter().filter(move |fault| fault.stage.is_none_or(|its| its == stage))
}

/// Returns the fault to inject, or the answer that refuses it.
///
/// # Errors
/// If the stage has no such fault, or the robot is real and the request does not confirm that.
pub fn admit(
    request: &FaultSample,
    stage: &str,
    simulated: bool,
) -> Result<FaultKind, FaultAnswer> {
    let kind = request.kind();
    if !of(stage).any(|fault| fault.kind == kind) {
        Err(FaultAnswer::Impossible)
    } else if simulated || request.although_real == 1 {
        Ok(kind)
    } else {
        Err(FaultAnswer::Refused)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fault_in_a_real_robot_needs_a_request_that_says_so_and_a_stage_has_those_of_no_other() {
        let unspecific = FaultSample { kind: FaultKind::Saddle.into(), ..FaultSample::default() };
        assert_eq!(admit(&unspecific, "planner", false), Err(FaultAnswer::Refused));
        assert_eq!(admit(&unspecific, "planner", true), Ok(FaultKind::Saddle));
        let meant = FaultSample { although_real: 1, ..unspecific };
        assert_eq!(admit(&meant, "planner", false), Ok(FaultKind::Saddle));
        // A stage has neither the faults of others nor unknown ones.
        assert_eq!(admit(&meant, "mapper", true), Err(FaultAnswer::Impossible));
        let unknown = FaultSample { kind: 200, ..meant };
        assert_eq!(admit(&unknown, "planner", true), Err(FaultAnswer::Impossible));
    }

    #[test]
    fn no_two_faults_of_a_stage_share_a_name() {
        for fault in &TABLE {
            let stage = fault.stage.unwrap_or("any");
            let same = of(stage).filter(|other| other.name == fault.name);
            assert_eq!(same.count(), 1, "{}", fault.name);
        }
    }
}
