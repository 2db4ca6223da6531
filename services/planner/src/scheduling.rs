//! When a thread of the process gets the processor.

use thread_priority::{
    NormalThreadSchedulePolicy, ThreadPriority, ThreadSchedulePolicy,
    set_thread_priority_and_policy, thread_native_id,
};

/// Let this thread run only while a processor has nothing else to do, or hardly anything: Linux's SCHED_IDLE. A stage that
/// becomes ready to run takes the processor from it at once.
pub(crate) fn idle_time_only() {
    let policy = ThreadSchedulePolicy::Normal(NormalThreadSchedulePolicy::Idle);
    // Where that is refused they share the processor.
    let _ = set_thread_priority_and_policy(thread_native_id(), ThreadPriority::Min, policy);
}
