//! What systemd is told, if it started this process: ready, how it goes, alive, stopping.
//!
//! Everything here does nothing where there is no `NOTIFY_SOCKET`.

use std::time::{Duration, Instant};

use sd_notify::NotifyState;

/// How often the line that `systemctl status` shows is said anew.
const STATUS_EVERY: Duration = Duration::from_secs(1);

/// The service manager, as far as one can tell it something.
pub(crate) struct ServiceManager {
    /// It kills a process that says nothing for so long.
    watchdog: Option<Duration>,
    fed: Option<Instant>,
    stated: Option<Instant>,
    ready: bool,
}

impl ServiceManager {
    /// The one named by the environment of this process.
    pub(crate) fn of_environment() -> Self {
        Self {
            watchdog: sd_notify::watchdog_enabled(),
            fed: None,
            stated: None,
            ready: false,
        }
    }

    /// The service is up. Said once.
    pub(crate) fn ready(&mut self) {
        if !self.ready {
            self.ready = true;
            tell(&[NotifyState::Ready]);
        }
    }

    /// The service is going down.
    pub(crate) fn stopping(&self) {
        tell(&[NotifyState::Stopping, NotifyState::Status("stopping")]);
    }

    /// Show how it goes, unless that was done a moment ago.
    pub(crate) fn show(&mut self, status: impl FnOnce() -> String) {
        let due = self
            .stated
            .is_none_or(|stated| stated.elapsed() >= STATUS_EVERY);
        if due {
            self.stated = Some(Instant::now());
            tell(&[NotifyState::Status(&status())]);
        }
    }

    /// Say that the loop goes round, when that is due. To be called from within the loop and nowhere else: a
    /// thread that fed the watchdog would feed it while the loop hangs.
    pub(crate) fn feed(&mut self) {
        if self.time_to_feed().is_some_and(|left| left.is_zero()) {
            self.fed = Some(Instant::now());
            tell(&[NotifyState::Watchdog]);
        }
    }

    /// Time until the watchdog is to be fed: at half of what it allows, as systemd recommends.
    pub(crate) fn time_to_feed(&self) -> Option<Duration> {
        let every = self.watchdog? / 2;
        let since = self.fed.map(|fed| fed.elapsed());
        Some(since.map_or(Duration::ZERO, |since| every.saturating_sub(since)))
    }
}

/// A service manager that does not listen is no reason to stop the robot.
fn tell(states: &[NotifyState<'_>]) {
    if let Err(error) = sd_notify::notify(states) {
        tracing::debug!(%error, "systemd does not listen");
    }
}
