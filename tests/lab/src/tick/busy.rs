//! Threads that take the processor from a mission whose ticks are measured.

use thread_priority::{
    NormalThreadSchedulePolicy as Normal, ThreadPriority, ThreadPriorityValue,
    ThreadSchedulePolicy, set_thread_priority_and_policy, thread_native_id,
};

/// Niceness 0 on the scale of [`ThreadPriority::Crossplatform`], which 99 gives the most.
const NICENESS_0: u8 = 48;

/// Compute without end, with the ordinary priority, whatever this process has.
pub fn run() {
    if let Ok(value) = ThreadPriorityValue::try_from(NICENESS_0) {
        let policy = ThreadSchedulePolicy::Normal(Normal::Other);
        let priority = ThreadPriority::Crossplatform(value);
        // A thread that may not take a priority has the ordinary one.
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
