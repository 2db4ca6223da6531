//! What outlived a mission.

use std::{fs, path::Path};

use common::domain::{Domain, RobotName, SHARED_MEMORY};

/// Files, shared memory of `robot` and processes with files in `directory` that are still there.
pub(crate) fn count(robot: &RobotName, directory: &Path) -> usize {
    let domain = Domain::of(robot.clone());
    let prefix = domain.shared_memory_prefix();
    let shared = names(Path::new(SHARED_MEMORY)).filter(|name| name.starts_with(&prefix));
    let directory = directory.to_string_lossy();
    let own = std::process::id().to_string();
    let of_mission = |pid: &String| {
        pid.bytes().all(|byte| byte.is_ascii_digit())
            && *pid != own
            && fs::read(format!("/proc/{pid}/cmdline"))
                .is_ok_and(|line| String::from_utf8_lossy(&line).contains(&*directory))
    };
    let processes = names(Path::new("/proc")).filter(of_mission);
    shared.count() + processes.count() + usize::from(domain.directory().exists())
}

/// Names of what is in a directory.
fn names(directory: &Path) -> impl Iterator<Item = String> {
    let entries = fs::read_dir(directory).into_iter().flatten().flatten();
    entries.map(|entry| entry.file_name().to_string_lossy().into_owned())
}
