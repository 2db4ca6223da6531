//! Facts in `/proc/PID`; `None` if the process has ended.

use std::{fs, time::Duration};

use rustix::param::clock_ticks_per_second;

/// `file` is its path below `/proc`.
pub fn field(file: &str, field: &str) -> Option<String> {
    let fields = fs::read_to_string(format!("/proc/{file}")).ok()?;
    let mut lines = fields.lines().filter_map(|line| line.split_once(':'));
    let (_, value) = lines.find(|(name, _)| *name == field)?;
    Some(value.trim().to_owned())
}

/// For example `VmRSS`.
pub fn kibibytes(file: &str, field: &str) -> Option<u64> {
    self::field(file, field)?.strip_suffix(" kB")?.trim().parse().ok()
}

/// Returns the times for which a thread ran and was runnable but waited. `task` is its path below
/// `/proc`.
pub fn scheduled(task: &str) -> Option<[Duration; 2]> {
    let counts = fs::read_to_string(format!("/proc/{task}/schedstat")).ok()?;
    let mut times = counts.split(' ').map_while(|time| time.parse().ok().map(Duration::from_nanos));
    Some([times.next()?, times.next()?])
}

/// Returns the state of a thread: `R` runs or is runnable, `D` waits for a disk. `task` is its path
/// below `/proc`.
pub fn state(task: &str) -> Option<char> {
    stat(task)?.chars().next()
}

/// Returns the fields after the name, from the state on.
fn stat(task: &str) -> Option<String> {
    let stat = fs::read_to_string(format!("/proc/{task}/stat")).ok()?;
    // The name in parentheses may contain any characters.
    Some(stat.rsplit_once(") ")?.1.to_owned())
}

pub fn processor_time(process: u32) -> Option<Duration> {
    let fields = stat(&process.to_string())?;
    let mut times = fields.split_ascii_whitespace().skip(11);
    let mut time = || times.next()?.parse::<u64>().ok();
    let ticks = time()?.saturating_add(time()?);
    Some(Duration::from_secs_f64(ticks as f64 / clock_ticks_per_second() as f64))
}
