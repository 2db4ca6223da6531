//! The end of a run whose supervisor hangs. The middleware may wait for ever for a file that another process truncated, and the
//! supervisor's loop does not react to signals then.
//!
//! A separate thread receives the signals too. If the loop makes no iteration for [`STUCK`] after a signal, the thread ends the
//! stages and the process. The robot stands by then: its link stops it when the supervisor is silent, and a command expires if no
//! other follows.

use std::{
    fs,
    os::fd::AsFd as _,
    sync::{
        Arc,
        atomic::{AtomicBool, AtomicU64, Ordering},
    },
    thread,
    time::{Duration, Instant},
};

use common::{
    poll,
    signals::{Signals, exit_at_once},
};
use rustix::process::{Pid, Signal, kill_process};

/// The time without an iteration after which the loop hangs; a healthy one turns five times a second.
const STUCK: Duration = Duration::from_secs(2);
const GRACE: Duration = Duration::from_millis(300);
/// The exit code of a run that ends like this, which is that of any run that failed.
const FAILED: u8 = 1;

const LOOK_EVERY: Duration = Duration::from_millis(100);

/// The number of turns of the supervisor's loop, and whether it has ended.
#[derive(Clone, Default)]
pub struct Turns {
    count: Arc<AtomicU64>,
    ended: Arc<AtomicBool>,
}

impl Turns {
    pub fn count(&self) {
        self.count.fetch_add(1, Ordering::Relaxed);
    }

    /// Note that the stages have ended in order. The rest may take longer.
    pub fn end(&self) {
        self.ended.store(true, Ordering::Relaxed);
    }

    /// Wait until the loop has not turned for [`STUCK`]. Returns false when it has ended.
    fn are_stuck(&self) -> bool {
        let (mut seen, mut stuck) = (0, Duration::ZERO);
        while !self.ended.load(Ordering::Relaxed) {
            let now = self.count.load(Ordering::Relaxed);
            if now != seen {
                (seen, stuck) = (now, Duration::ZERO);
            }
            if stuck >= STUCK {
                return true;
            }
            let began = Instant::now();
            thread::park_timeout(LOOK_EVERY);
            // A machine on which this thread has to wait delays the loop, too.
            stuck += began.elapsed().min(2 * LOOK_EVERY);
        }
        false
    }
}

/// Watch `turns` from the first of `signals` on.
pub fn watch(mut signals: Signals, turns: Turns) {
    thread::spawn(move || {
        while !signals.came() {
            if poll::readable(&[signals.as_fd()], None).is_err() {
                return;
            }
        }
        if !turns.are_stuck() {
            return;
        }
        tracing::error!(
            "the supervisor hangs, perhaps in a file of the bus that was changed; the stages and the run are ended"
        );
        end_children(Signal::TERM);
        thread::park_timeout(GRACE);
        end_children(Signal::KILL);
        exit_at_once(FAILED);
    });
}

/// Signal all children of this process. Nobody reaps them, so their ids are not reused.
fn end_children(signal: Signal) {
    let Ok(threads) = fs::read_dir("/proc/self/task") else {
        return;
    };
    for thread in threads.flatten() {
        let children = fs::read_to_string(thread.path().join("children")).unwrap_or_default();
        let pids = children.split_ascii_whitespace();
        for pid in pids.filter_map(|pid| Pid::from_raw(pid.parse().ok()?)) {
            let _ = kill_process(pid, signal);
        }
    }
}
