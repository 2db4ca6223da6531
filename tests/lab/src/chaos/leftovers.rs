//! Files, shared memory and processes that outlived a mission.

use std::{
    path::Path,
    thread,
    time::{Duration, Instant},
};

use common::domain::{RobotName, SHARED_MEMORY};
use console::robots::entries;
use processes::STOP_GUARD;

use crate::robot::command_lines;

const GUARDS_END: Duration = Duration::from_secs(10);
const LOOK: Duration = Duration::from_millis(10);

pub fn find(robot: &RobotName, directory: &Path) -> Vec<String> {
    let domain = robot.domain();
    let own = format!("{SHARED_MEMORY}/{}", domain.shared_memory_prefix());
    let files = entries(SHARED_MEMORY.as_ref()).map(|entry| entry.path().display().to_string());
    let mut found: Vec<_> = files.filter(|file| file.starts_with(&own)).collect();
    let directory = directory.to_string_lossy();
    // A stop guard outlives its link until its robot rests.
    let began = Instant::now();
    while began.elapsed() < GUARDS_END && lines(&directory).any(|line| line.contains(STOP_GUARD)) {
        thread::park_timeout(LOOK);
    }
    found.extend(lines(&directory));
    let own_directory = domain.directory();
    found.extend(own_directory.exists().then(|| own_directory.display().to_string()));
    found
}

fn lines(directory: &str) -> impl Iterator<Item = String> {
    let its = command_lines().filter(move |(_, line)| line.contains(directory));
    its.map(|(process, line)| format!("process {process}: {}", line.trim_end()))
}
