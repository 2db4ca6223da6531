//! Threads that compete with a measured mission for processors.

use thread_priority::{
    NormalThreadSchedulePolicy as Normal, ThreadPriority, ThreadPriorityValue,
    ThreadSchedulePolicy, set_thread_priority_and_policy, thread_native_id,
};

/// Niceness 0 on the scale of [`ThreadPriority::Crossplatform`], where 99 is the maximum priority.
const NICENESS_0: u8 = 48;

/// Computes endlessly with ordinary priority.
pub fn run() {
    if let Ok(value) = ThreadPriorityValue::try_from(NICENESS_0) {
        let policy = ThreadSchedulePolicy::Normal(Normal::Other);
        let priority = ThreadPriority::Crossplatform(value);
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
