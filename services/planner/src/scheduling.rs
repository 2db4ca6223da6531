//! The priority of threads beside the tick. Only the tick's own thread keeps a real-time priority that the process was given.

use thread_priority::{
    NormalThreadSchedulePolicy as Normal, ThreadPriority, ThreadPriorityValue,
    ThreadSchedulePolicy, set_thread_priority_and_policy, thread_native_id,
};

/// Niceness 10 on the scale of [`ThreadPriority::Crossplatform`], which 99 gives the most.
const NICENESS_10: u8 = 22;

/// Give this thread a tenth of the share that a stage gets of a processor that both want.
///
/// It gets no less, though nobody waits for it: a killed process ends only once each of its threads has run, and other
/// threads wait for what it holds in the kernel. With SCHED_IDLE both took seconds on a busy machine.
pub(crate) fn behind_stages() {
    let Ok(value) = ThreadPriorityValue::try_from(NICENESS_10) else {
        return;
    };
    let policy = ThreadSchedulePolicy::Normal(Normal::Other);
    let priority = ThreadPriority::Crossplatform(value);
    // Where the system refuses, they share the processor equally.
    let _ = set_thread_priority_and_policy(thread_native_id(), priority, policy);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn niceness_10_is_10() {
        let value = ThreadPriorityValue::try_from(NICENESS_10).unwrap();
        let policy = ThreadSchedulePolicy::Normal(Normal::Other);
        assert_eq!(
            ThreadPriority::Crossplatform(value)
                .to_posix(policy)
                .unwrap(),
            10
        );
    }
}
