//! What a process asks of its machine besides the bus: the time, its number, files, wires.
//!
//! A real process asks the system. A simulation runs many processes in one thread: its [`Machine`]
//! answers for the process that runs at the moment, so the same code runs in both.

use std::{
    cell::RefCell,
    collections::BTreeMap,
    path::{Path, PathBuf},
    rc::Rc,
    time::Duration,
};

/// A simulated machine.
pub trait Machine {
    /// Nanoseconds.
    fn monotonic_ns(&self) -> u64;

    fn process(&self) -> u32;

    /// Runs the other processes until `is_ready`, or until `timeout` has passed. Returns the last
    /// answer of `is_ready`.
    fn wait(&self, timeout: Duration, is_ready: &dyn Fn() -> bool) -> bool;

    /// Returns whether the running process has been killed. Asked before each publication and each
    /// write to a file, which fail from then on.
    fn is_killed(&self) -> bool;

    fn files(&self) -> &Files;

    fn wire(&self, address: &str) -> Box<dyn MachineWire>;
}

/// Wire of datagrams to a simulated device.
pub trait MachineWire: std::fmt::Debug {
    fn receive(&mut self) -> Option<Vec<u8>>;

    fn send(&mut self, bytes: &[u8]);
}

pub type Content = Rc<RefCell<Vec<u8>>>;

/// Files of a simulated machine, by path. There are no directories.
#[derive(Debug, Default)]
pub struct Files(RefCell<BTreeMap<PathBuf, Content>>);

impl Files {
    /// Creates a missing file, empty.
    pub fn open(&self, path: &Path) -> Content {
        Rc::clone(self.0.borrow_mut().entry(path.to_path_buf()).or_default())
    }

    pub fn exists(&self, path: &Path) -> bool {
        self.0.borrow().contains_key(path)
    }

    pub fn remove(&self, path: &Path) {
        self.0.borrow_mut().remove(path);
    }
}

thread_local! {
    static SIMULATED: RefCell<Option<Rc<dyn Machine>>> = const { RefCell::new(None) };
}

pub fn simulate<T>(machine: Rc<dyn Machine>, work: impl FnOnce() -> T) -> T {
    let before = SIMULATED.replace(Some(machine));
    let done = work();
    SIMULATED.set(before);
    done
}

/// Returns `None` in a real process.
pub fn simulated() -> Option<Rc<dyn Machine>> {
    SIMULATED.with_borrow(Clone::clone)
}

pub fn is_simulated() -> bool {
    SIMULATED.with_borrow(Option::is_some)
}

pub fn process() -> u32 {
    simulated().map_or_else(std::process::id, |machine| machine.process())
}

/// Returns whether this process must not go on, because a simulation has killed it.
pub fn is_killed() -> bool {
    simulated().is_some_and(|machine| machine.is_killed())
}
