use std::{
    fs,
    io::Write as _,
    path::{Path, PathBuf},
    process::Command,
    sync::atomic::{AtomicUsize, Ordering},
};

use rustix::process::{getegid, geteuid};

use super::commands::with_parent;

/// Variable that names the test of a process.
const OWN_PROCESS: &str = "FIRSTHAND_TEST";

/// Isolates `test`, so that its bus connections end with it.
pub fn in_own_process<T: FnOnce()>(test: T) {
    in_process_under(&[], name_of::<T>(), test);
}

/// [`in_own_process`] for a test that acts as another user, which only root can.
pub fn in_own_process_of_root<T: FnOnce()>(test: T) {
    if !geteuid().is_root() {
        return not_run(name_of::<T>(), "only root can act as another user");
    }
    in_own_process(test);
}

/// Runs `test` in its own process with a file system of `mebibytes` MiB.
///
/// An ordinary user mounts it in a user namespace. If the system forbids that, the test is skipped
/// with a message.
pub fn on_small_disk<T: FnOnce(SmallDisk)>(mebibytes: u32, test: T) {
    let directory = tempfile::tempdir().unwrap();
    on_small_file_system(directory.path(), mebibytes, test);
}

/// [`on_small_disk`] for shared memory of this size.
pub fn on_small_shared_memory<T: FnOnce(SmallDisk)>(mebibytes: u32, test: T) {
    on_small_file_system(Path::new("/dev/shm"), mebibytes, test);
}

fn on_small_file_system<T: FnOnce(SmallDisk)>(mount: &Path, mebibytes: u32, test: T) {
    let namespaces = ["unshare", "--user", "--map-root-user", "--mount"];
    let probe = Command::new(namespaces[0]).args(&namespaces[1..]).arg("true").output();
    if !probe.is_ok_and(|output| output.status.success()) {
        return not_run(name_of::<T>(), "no user namespace with mounts can be had here");
    }
    // The inner namespace restores the test's user, whose number is part of the robot's file names.
    let script = format!(
        "mount -t tmpfs -o size={mebibytes}m tmpfs {disk} && exec unshare --user --map-user={user} --map-group={group} \
         -- env {DISK}={disk} \"$@\"",
        disk = mount.display(),
        user = geteuid().as_raw(),
        group = getegid().as_raw(),
    );
    let wrapper = [&namespaces[..], &["sh", "-c", &script, "sh"]].concat();
    in_process_under(&wrapper, name_of::<T>(), || {
        test(SmallDisk(std::env::var_os(DISK).unwrap().into()));
    });
}

/// Variable that names the mount directory of a test's small disk.
const DISK: &str = "FIRSTHAND_TEST_DISK";

/// Small file system, which exists until the process of its test ends.
pub struct SmallDisk(PathBuf);

impl SmallDisk {
    pub fn path(&self) -> &Path {
        &self.0
    }

    /// Frees the space that [`SmallDisk::fill`] used up.
    pub fn empty(&self) {
        fs::remove_file(self.0.join("filler")).unwrap();
    }

    pub fn fill(&self) {
        let mut file = fs::File::create(self.0.join("filler")).unwrap();
        let refused = std::iter::repeat_with(|| file.write_all(&[1; 4096])).find_map(Result::err);
        assert_eq!(refused.unwrap().kind(), std::io::ErrorKind::StorageFull);
    }
}

/// Number of skipped tests of this executable.
static NOT_RUN: AtomicUsize = AtomicUsize::new(0);

/// Reports and counts a skipped `test`. Writes past the harness, which hides the output of passing
/// tests.
pub fn not_run(test: &str, why: &str) {
    let count = NOT_RUN.fetch_add(1, Ordering::Relaxed) + 1;
    let said = format!("\nNOT RUN ({count}): {test}: {why}\n");
    std::io::stderr().write_all(said.as_bytes()).unwrap();
}

/// Returns the name of the test with the closure type `T`, which is named
/// CRATE::MODULE::TEST::{{closure}}.
fn name_of<T>() -> &'static str {
    let (_, name) = std::any::type_name::<T>().split_once("::").unwrap();
    name.split("::{{closure}}").next().unwrap()
}

fn in_process_under(wrapper: &[&str], name: &str, test: impl FnOnce()) {
    if std::env::var_os(OWN_PROCESS).is_some_and(|chosen| chosen == name) {
        return test();
    }
    let executable = std::env::current_exe().unwrap();
    let output = with_parent(wrapper)
        .arg(executable)
        .args([name, "--exact", "--nocapture"])
        .env(OWN_PROCESS, name)
        .output()
        .unwrap();
    let (printed, said) =
        (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    let passed = output.status.success() && printed.contains("1 passed");
    assert!(passed, "{printed}\n{said}");
}
