//! When a thread of the process gets the processor, whatever the process itself was granted: a real-time priority is for
//! ticks alone.

use thread_priority::{
    NormalThreadSchedulePolicy as Normal, ThreadPriority, ThreadPriorityValue,
    ThreadSchedulePolicy, set_thread_priority_and_policy, thread_native_id,
};

/// Niceness 10 on the scale of [`ThreadPriority::Crossplatform`], which 99 gives the most.
const NICENESS_10: u8 = 22;

/// Let this thread run with a tenth of what a stage gets of a processor that both want.
///
/// Not less, though nobody waits for it: a process that is killed ends only once each of its threads has run, and what a
/// thread holds in the kernel the others wait for. With SCHED_IDLE both took seconds on a busy machine.
pub(crate) fn behind_stages() {
    let Ok(value) = ThreadPriorityValue::try_from(NICENESS_10) else {
        return;
    };
    let policy = ThreadSchedulePolicy::Normal(Normal::Other);
    let priority = ThreadPriority::Crossplatform(value);
    // Where that is refused they share the processor.
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
