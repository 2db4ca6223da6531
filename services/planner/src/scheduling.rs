//! When a thread of the process gets the processor, whatever the process itself was granted: a real-time priority is for
//! ticks alone.

use thread_priority::{
    NormalThreadSchedulePolicy as Normal, ThreadPriority, ThreadPriorityValue,
    ThreadSchedulePolicy, set_thread_priority_and_policy, thread_native_id,
};

/// Niceness 10 on the scale of [`ThreadPriority::Crossplatform`], which 99 gives the most.
const NICENESS_10: u8 = 22;

/// Let this thread run only while a processor has nothing else to do, or hardly anything: Linux's SCHED_IDLE. A stage that
/// becomes ready to run takes the processor from it at once.
pub(crate) fn idle_time_only() {
    take(ThreadPriority::Min, Normal::Idle);
}

/// Let this thread run when it must, and yet with a tenth of what a stage gets of a processor that both want.
pub(crate) fn behind_stages() {
    if let Ok(value) = ThreadPriorityValue::try_from(NICENESS_10) {
        take(ThreadPriority::Crossplatform(value), Normal::Other);
    }
}

fn take(priority: ThreadPriority, policy: Normal) {
    let policy = ThreadSchedulePolicy::Normal(policy);
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
