//! Notifications to systemd: ready, status, watchdog, stopping. Without `NOTIFY_SOCKET` the
//! functions do nothing.

use std::time::Duration;

use common::clock::Instant;
use sd_notify::NotifyState;

const STATUS_EVERY: Duration = Duration::from_secs(1);

pub struct ServiceManager {
    /// Silence after which systemd kills the process.
    watchdog: Option<Duration>,
    fed: Option<Instant>,
    shown: Option<Instant>,
    ready: bool,
}

impl ServiceManager {
    pub fn of_environment() -> Self {
        Self { watchdog: sd_notify::watchdog_enabled(), fed: None, shown: None, ready: false }
    }

    pub fn ready(&mut self) {
        if !self.ready {
            self.ready = true;
            notify(&[NotifyState::Ready]);
        }
    }

    pub fn stopping(&self) {
        notify(&[NotifyState::Stopping, NotifyState::Status("stopping")]);
    }

    pub fn show(&mut self, status: impl FnOnce() -> String) {
        if self.shown.is_none_or(|shown| shown.elapsed() >= STATUS_EVERY) {
            self.shown = Some(Instant::now());
            notify(&[NotifyState::Status(&status())]);
        }
    }

    /// Feeds the watchdog if due. Only the loop may call this, so that a hung loop is noticed.
    pub fn feed(&mut self) {
        if self.time_to_feed().is_some_and(|left| left.is_zero()) {
            self.fed = Some(Instant::now());
            notify(&[NotifyState::Watchdog]);
        }
    }

    /// Returns the time until the next feed: half of the limit, as systemd recommends.
    pub fn time_to_feed(&self) -> Option<Duration> {
        let every = self.watchdog? / 2;
        let since = self.fed.map(|fed| fed.elapsed());
        Some(since.map_or(Duration::ZERO, |since| every.saturating_sub(since)))
    }
}

/// Failures never stop the robot.
fn notify(states: &[NotifyState<'_>]) {
    if let Err(error) = sd_notify::notify(states) {
        tracing::debug!(%error, "systemd does not listen");
    }
}
