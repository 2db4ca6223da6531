//! Processes that take the processor from a mission whose ticks are measured.

use common::start::become_child;
use processes::process::{Process, firsthand};
use thread_priority::{
    NormalThreadSchedulePolicy as Normal, ThreadPriority, ThreadPriorityValue,
    ThreadSchedulePolicy, set_thread_priority_and_policy, thread_native_id,
};

use crate::error::{OrCannot as _, Result};

/// Niceness 0 on the scale of [`ThreadPriority::Crossplatform`], which 99 gives the most.
const NICENESS_0: u8 = 48;

/// Start `number` of them. They end when they are dropped.
pub fn start(number: u32) -> Result<Vec<Process>> {
    let own = std::process::id().to_string();
    let spinning = |_| {
        let command = firsthand(&["bench", "tick", "--spin", "--supervisor", &own]);
        Process::spawn(command).or_cannot("start a busy process")
    };
    (0..number).map(spinning).collect()
}

/// Compute without end, with the ordinary priority, whatever the parent has.
pub fn run(supervisor: u32) -> Result {
    become_child("busy", supervisor)?;
    if let Ok(value) = ThreadPriorityValue::try_from(NICENESS_0) {
        let policy = ThreadSchedulePolicy::Normal(Normal::Other);
        let priority = ThreadPriority::Crossplatform(value);
        // A process that may not take a priority has the ordinary one.
        let _ = set_thread_priority_and_policy(thread_native_id(), priority, policy);
    }
    loop {
        std::hint::spin_loop();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn niceness_0_is_0() {
        let value = ThreadPriorityValue::try_from(NICENESS_0).unwrap();
        let policy = ThreadSchedulePolicy::Normal(Normal::Other);
        assert_eq!(ThreadPriority::Crossplatform(value).to_posix(policy).unwrap(), 0);
    }
}
