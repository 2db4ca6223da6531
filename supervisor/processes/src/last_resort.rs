//! End of a run whose supervisor hangs: the middleware may wait forever for a truncated file.
//!
//! A separate thread also receives the signals. If the loop hangs without an iteration after a
//! signal, the thread ends the stages and the process, and removes their files. The robot stands
//! by then: its link stops it when the supervisor is silent, and an unrenewed command expires.

use std::{
    fs,
    io::Write as _,
    sync::{
        Arc,
        atomic::{AtomicBool, AtomicU64, Ordering},
    },
    thread,
    time::{Duration, Instant},
};

use common::{
    domain::Domain,
    signals::{Signals, exit_at_once},
};
use rustix::process::{Pid, Signal, kill_process};

use crate::{activity::Times, domain, policy::STOP_GRACE};

/// Deadline of an iteration; a healthy loop turns five times a second.
const STUCK: Duration = Duration::from_secs(2);
const FAILED: u8 = 1;

const HANGS: &str =
    "the supervisor hangs, perhaps in a changed file of the bus; the run and its stages are ended";

const LOOK_EVERY: Duration = Duration::from_millis(100);

/// Iterations of the supervisor's loop, and whether it may pause.
#[derive(Clone, Default)]
pub struct Turns {
    count: Arc<AtomicU64>,
    rests: Arc<AtomicBool>,
}

impl Turns {
    pub fn count(&self) {
        self.count.fetch_add(1, Ordering::Relaxed);
    }

    /// Sets whether the loop may pause, in a timed wait or after the stages' end.
    pub fn rest(&self, rests: bool) {
        self.rests.store(rests, Ordering::Relaxed);
    }

    /// Waits until the leading thread, which runs the loop, hangs by the rule for stages.
    fn await_stuck(&self) {
        const { assert!(2 * LOOK_EVERY.as_millis() < STUCK.as_millis()) };
        let pid = std::process::id();
        let (mut seen, mut age, mut since) = (0, Duration::ZERO, Times::of(pid));
        loop {
            let began = Instant::now();
            thread::park_timeout(LOOK_EVERY);
            // If this thread has to wait, so does the loop.
            age += began.elapsed().min(2 * LOOK_EVERY);
            let now = self.count.load(Ordering::Relaxed);
            if std::mem::replace(&mut seen, now) != now || self.rests.load(Ordering::Relaxed) {
                (age, since) = (Duration::ZERO, Times::of(pid));
            }
            let activity = || since.and_then(|since| since.activity(pid));
            if age >= STUCK && activity().is_none_or(|activity| activity.is_hung(age, STUCK)) {
                return;
            }
        }
    }
}

pub fn watch(mut signals: Signals, turns: Turns, domain: Domain) {
    thread::spawn(move || {
        if signals.wait().is_err() {
            return;
        }
        turns.await_stuck();
        tracing::error!("{HANGS}");
        let _ = writeln!(std::io::stderr(), "firsthand: {HANGS}");
        end_children(Signal::TERM);
        thread::park_timeout(STOP_GRACE);
        end_children(Signal::KILL);
        domain::remove_all(&domain);
        exit_at_once(FAILED);
    });
}

/// Signals all children. Unreaped, their ids are not reused.
fn end_children(signal: Signal) {
    let Ok(threads) = fs::read_dir("/proc/self/task") else {
        return;
    };
    for thread in threads.flatten() {
        let children = fs::read_to_string(thread.path().join("children")).unwrap_or_default();
        for pid in
            children.split_ascii_whitespace().filter_map(|pid| Pid::from_raw(pid.parse().ok()?))
        {
            let _ = kill_process(pid, signal);
        }
    }
}
