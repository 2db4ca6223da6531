//! Tests in processes of their own.

use std::{
    fs,
    io::Write as _,
    path::{Path, PathBuf},
    process::Command,
    sync::atomic::{AtomicUsize, Ordering},
};

use rustix::process::{getegid, geteuid};

use super::commands::with_parent;

/// The environment variable that names the test which a process runs.
const OWN_PROCESS: &str = "FIRSTHAND_TEST";

/// Run `test` in a process of its own, so that its connections to buses end with it.
pub fn in_own_process<T: FnOnce()>(test: T) {
    in_process_under(&[], name_of::<T>(), test);
}

/// Run `test` in a process of its own with a file system of `mebibytes` MiB. An ordinary user may mount it in a user namespace with
/// mounts of its own. If the system allows no such namespace, the test does not run and says so.
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
    if !can_run(&namespaces) {
        return not_run(name_of::<T>(), "no user namespace with mounts can be had here");
    }
    // The inner namespace gives the test its own user back, because files of the robot have that user's number in their names.
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

/// The environment variable that names the directory where the small disk of a test is mounted.
const DISK: &str = "FIRSTHAND_TEST_DISK";

/// A small file system, which exists until the process of its test ends.
pub struct SmallDisk(PathBuf);

impl SmallDisk {
    pub fn path(&self) -> &Path {
        &self.0
    }

    /// Free the space that [`SmallDisk::fill`] used up.
    pub fn empty(&self) {
        fs::remove_file(self.0.join("filler")).unwrap();
    }

    /// Use up the free space.
    pub fn fill(&self) {
        let mut file = fs::File::create(self.0.join("filler")).unwrap();
        let refused = std::iter::repeat_with(|| file.write_all(&[1; 4096])).find_map(Result::err);
        assert_eq!(refused.unwrap().kind(), std::io::ErrorKind::StorageFull);
    }
}

/// Whether this user may start a process by way of the command line `wrapper`.
pub fn can_run(wrapper: &[&str]) -> bool {
    let mut command = Command::new(wrapper[0]);
    let output = command.args(&wrapper[1..]).arg("true").output();
    output.is_ok_and(|output| output.status.success())
}

/// The number of tests of this executable that did not run.
static NOT_RUN: AtomicUsize = AtomicUsize::new(0);

/// Print that `test` did not run, and count it. The message bypasses the harness, which hides the output of tests that pass.
pub fn not_run(test: &str, why: &str) {
    let count = NOT_RUN.fetch_add(1, Ordering::Relaxed) + 1;
    let said = format!("\nNOT RUN ({count}): {test}: {why}\n");
    std::io::stderr().write_all(said.as_bytes()).unwrap();
}

/// The name of the test that contains the closure type `T`, whose own name is CRATE::MODULE::TEST::{{closure}}.
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
