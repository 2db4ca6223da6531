//! Runs under a service manager: this test in the place of systemd.
#![allow(clippy::unwrap_used, clippy::panic)]

mod support;

use std::{
    os::{
        fd::AsFd,
        unix::{fs::MetadataExt, net::UnixDatagram},
    },
    process::{Command, Stdio},
    time::{Duration, Instant},
};

use rustix::process::Signal;
use support::{PATIENCE, assert_nothing_left, find, firsthand, signal_process};
use tempfile::TempDir;

/// What a unit would give as WatchdogSec.
const WATCHDOG: Duration = Duration::from_millis(600);

/// A place where a service says how it goes.
struct Manager {
    socket: UnixDatagram,
    directory: TempDir,
}

impl Manager {
    fn new() -> Self {
        let directory = tempfile::tempdir().unwrap();
        let socket = UnixDatagram::bind(directory.path().join("notify")).unwrap();
        socket.set_read_timeout(Some(PATIENCE)).unwrap();
        Self { socket, directory }
    }

    /// `command` as systemd would start it.
    fn adopt(&self, command: &mut Command) {
        command
            .env("NOTIFY_SOCKET", self.directory.path().join("notify"))
            .env("WATCHDOG_USEC", WATCHDOG.as_micros().to_string());
    }

    /// The lines of what is said next.
    fn hear(&self) -> Vec<String> {
        let mut message = [0; 4096];
        let length = self.socket.recv(&mut message).unwrap();
        let text = String::from_utf8(message[..length].to_vec()).unwrap();
        text.lines().map(str::to_owned).collect()
    }

    /// Everything up to the message with `line`.
    fn hear_until(&self, line: &str) -> Vec<String> {
        let began = Instant::now();
        let mut heard = Vec::new();
        loop {
            let lines = self.hear();
            let done = lines.iter().any(|said| said == line);
            heard.extend(lines);
            if done {
                return heard;
            }
            assert!(began.elapsed() < PATIENCE, "no {line} in {heard:?}");
        }
    }
}

fn mission(robot: &str, directory: &TempDir) -> Command {
    let mut command = firsthand(&["run", "open-room", "--robot", robot, "--pace", "1", "--out"]);
    command
        .arg(directory.path().join("run"))
        .stdout(Stdio::null())
        .stderr(Stdio::null());
    command
}

#[test]
fn systemd_hears_ready_a_status_the_watchdog_at_half_its_time_and_stopping() {
    let manager = Manager::new();
    let directory = support::directory_of("notify");
    let mut command = mission("notify", &directory);
    manager.adopt(&mut command);
    let mut run = command.spawn().unwrap();
    manager.hear_until("READY=1");
    // A loop that is late by a whole half would be killed; so much is left of what is allowed.
    let mut fed = Instant::now();
    for _ in 0..6 {
        manager.hear_until("WATCHDOG=1");
        assert!(fed.elapsed() < WATCHDOG, "{:?}", fed.elapsed());
        fed = Instant::now();
    }
    let heard = manager.hear_until_status();
    assert!(heard.contains("5/5 stages alive"), "{heard}");
    signal_process(run.id(), Signal::TERM);
    manager.hear_until("STOPPING=1");
    assert_eq!(run.wait().unwrap().code(), Some(0));
    assert_nothing_left("notify");
}

impl Manager {
    /// The status line of a robot that drives.
    fn hear_until_status(&self) -> String {
        let began = Instant::now();
        loop {
            let lines = self.hear();
            let mut statuses = lines.iter().filter_map(|line| line.strip_prefix("STATUS="));
            if let Some(status) = statuses.find(|status| status.contains("to go")) {
                return status.to_owned();
            }
            assert!(began.elapsed() < PATIENCE, "no status");
        }
    }
}

#[test]
fn a_frozen_supervisor_does_not_feed_the_watchdog() {
    let manager = Manager::new();
    let directory = support::directory_of("hang");
    let mut command = mission("hang", &directory);
    manager.adopt(&mut command);
    let mut run = command.spawn().unwrap();
    manager.hear_until("READY=1");
    signal_process(run.id(), Signal::STOP);
    // What was said before it froze.
    manager.socket.set_nonblocking(true).unwrap();
    let mut message = [0; 4096];
    while manager.socket.recv(&mut message).is_ok() {}
    manager.socket.set_nonblocking(false).unwrap();
    manager.socket.set_read_timeout(Some(WATCHDOG)).unwrap();
    assert!(manager.socket.recv(&mut message).is_err(), "it speaks");
    // As systemd would, after which the stages go with it.
    signal_process(run.id(), Signal::KILL);
    run.wait().unwrap();
}

#[test]
fn in_a_journal_a_stages_death_has_its_priority() {
    let directory = support::directory_of("journal");
    let journal = std::fs::File::create(directory.path().join("journal")).unwrap();
    let found = journal
        .as_fd()
        .try_clone_to_owned()
        .map(std::fs::File::from);
    let found = found.unwrap().metadata().unwrap();
    let mut run = mission("journal", &directory)
        .env("JOURNAL_STREAM", format!("{}:{}", found.dev(), found.ino()))
        .stderr(journal)
        .spawn()
        .unwrap();
    let status = support::wait_for_status("journal", |status| status["order"] == "driving");
    let mapper = find(&status, "mapper")["pid"].as_u64().unwrap();
    signal_process(mapper as u32, Signal::KILL);
    support::wait_for_status("journal", |status| {
        find(status, "mapper")["generation"] == 2
    });
    signal_process(run.id(), Signal::TERM);
    run.wait().unwrap();
    let text = std::fs::read_to_string(directory.path().join("journal")).unwrap();
    let death = text
        .lines()
        .find(|line| line.contains("stage ended"))
        .unwrap();
    assert!(
        death.starts_with("<4>") && death.contains("mapper"),
        "{text}"
    );
    let said: Vec<_> = text.lines().filter(|line| !line.starts_with('<')).collect();
    assert_eq!(
        said.len(),
        1,
        "only the mission's title has no priority: {said:?}"
    );
    // The same is in the run directory, and stages, whose words go to files, put no priorities there.
    let log =
        |name: &str| std::fs::read_to_string(directory.path().join("run").join(name)).unwrap();
    assert!(log("supervisor.log").contains("stage ended"));
    assert!(!log("mapper.log").contains("<6>"));
}
