//! Files, shared memory and processes that outlived a mission.

use std::{fs, path::Path};

use common::domain::{Domain, RobotName, SHARED_MEMORY};

/// Files and shared memory of `robot`, and processes with files in `directory`, that still exist: paths and command lines.
pub(crate) fn find(robot: &RobotName, directory: &Path) -> Vec<String> {
    let domain = Domain::of(robot.clone());
    let prefix = domain.shared_memory_prefix();
    let shared = names(Path::new(SHARED_MEMORY)).filter(|name| name.starts_with(&prefix));
    let mut found: Vec<String> = shared
        .map(|name| format!("{SHARED_MEMORY}/{name}"))
        .collect();
    let directory = directory.to_string_lossy();
    let own = std::process::id().to_string();
    let of_mission = |pid: String| {
        let is_other = pid.bytes().all(|byte| byte.is_ascii_digit()) && pid != own;
        let line = is_other.then(|| fs::read(format!("/proc/{pid}/cmdline")).ok());
        let line = String::from_utf8_lossy(&line.flatten()?).replace('\0', " ");
        line.contains(&*directory)
            .then(|| format!("process {pid}: {}", line.trim_end()))
    };
    found.extend(names(Path::new("/proc")).filter_map(of_mission));
    let own_directory = domain.directory();
    if own_directory.exists() {
        found.push(own_directory.display().to_string());
    }
    found
}

fn names(directory: &Path) -> impl Iterator<Item = String> {
    let entries = fs::read_dir(directory).into_iter().flatten().flatten();
    entries.map(|entry| entry.file_name().to_string_lossy().into_owned())
}
