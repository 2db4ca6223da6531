//! Wires between hosts and robot: datagrams on their way, and what becomes of them.

use std::{
    cell::RefCell,
    collections::{BTreeMap, VecDeque},
    rc::{Rc, Weak},
    time::Duration,
};

use common::machine::MachineWire;

use crate::{machine::SimulatedMachine, random::Random};

/// Direction of a datagram.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    ToRobot,
    ToHost,
}

/// What the wire does to the datagrams of one direction.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Quality {
    /// Shares of datagrams.
    pub lost: f64,
    pub doubled: f64,
    pub reordered: f64,
    /// Mean delay besides the least one.
    pub delay: Duration,
}

/// Port of a host's end. Each opened wire has another.
pub type Port = u16;

#[derive(Debug)]
struct Datagram {
    due_ns: u64,
    port: Port,
    bytes: Vec<u8>,
}

/// Datagrams of one direction.
#[derive(Debug, Default)]
pub struct Lane {
    pub quality: Quality,
    /// Arrival of the last datagram that kept its order.
    in_order_ns: u64,
    under_way: VecDeque<Datagram>,
    random: Random,
}

/// Least delay of a datagram.
const LEAST_NS: u64 = 100_000;
/// Time by which a reordered datagram is late.
const LATE: Duration = Duration::from_millis(150);

impl Lane {
    pub fn send(&mut self, port: Port, bytes: &[u8], now_ns: u64) {
        let Quality { lost, doubled, reordered, delay } = self.quality;
        if lost > 0.0 && self.random.chance(lost) {
            return;
        }
        let copies = 1 + u32::from(doubled > 0.0 && self.random.chance(doubled));
        for _ in 0..copies {
            let mut due_ns = now_ns + LEAST_NS;
            if !delay.is_zero() {
                due_ns += self.random.exponential(delay).as_nanos() as u64;
            }
            if reordered > 0.0 && self.random.chance(reordered) {
                due_ns += LATE.as_nanos() as u64;
            } else {
                self.in_order_ns = self.in_order_ns.max(due_ns);
                due_ns = self.in_order_ns;
            }
            let at = self.under_way.partition_point(|datagram| datagram.due_ns <= due_ns);
            self.under_way.insert(at, Datagram { due_ns, port, bytes: bytes.to_vec() });
        }
    }
}

#[derive(Debug, Default)]
pub struct Wires {
    /// By [`Way`].
    lanes: [Lane; 2],
    /// What has come for each open end.
    inboxes: BTreeMap<Port, VecDeque<Vec<u8>>>,
    opened: Port,
}

const FIRST_PORT: Port = 40_000;

impl Wires {
    pub fn new(seed: u64) -> Self {
        let lane = |stream| Lane { random: Random::new(seed, stream), ..Lane::default() };
        Self { lanes: [1, 2].map(lane), ..Self::default() }
    }

    pub fn lane(&mut self, way: Way) -> &mut Lane {
        &mut self.lanes[way as usize]
    }

    pub fn next_ns(&self, way: Way) -> Option<u64> {
        self.lanes[way as usize].under_way.front().map(|datagram| datagram.due_ns)
    }

    /// Takes a datagram that has come, with the port of its host's end.
    pub fn take(&mut self, way: Way) -> Option<(Port, Vec<u8>)> {
        let Datagram { port, bytes, .. } = self.lane(way).under_way.pop_front()?;
        Some((port, bytes))
    }

    /// Puts a datagram that has come to its host's end, unless that is closed.
    pub fn deliver_to_host(&mut self) {
        if let Some((port, bytes)) = self.take(Way::ToHost)
            && let Some(inbox) = self.inboxes.get_mut(&port)
        {
            inbox.push_back(bytes);
        }
    }

    pub fn has_mail(&self) -> bool {
        self.inboxes.values().any(|inbox| !inbox.is_empty())
    }
}

#[derive(Debug)]
pub struct HostEnd {
    wires: Rc<RefCell<Wires>>,
    port: Port,
    machine: Weak<SimulatedMachine>,
}

impl HostEnd {
    pub fn open(wires: &Rc<RefCell<Wires>>, machine: Weak<SimulatedMachine>) -> Self {
        let mut opened = wires.borrow_mut();
        opened.opened = opened.opened.wrapping_add(1);
        let port = FIRST_PORT.wrapping_add(opened.opened);
        opened.inboxes.insert(port, VecDeque::new());
        Self { wires: Rc::clone(wires), port, machine }
    }
}

impl Drop for HostEnd {
    fn drop(&mut self) {
        self.wires.borrow_mut().inboxes.remove(&self.port);
    }
}

impl MachineWire for HostEnd {
    fn receive(&mut self) -> Option<Vec<u8>> {
        self.wires.borrow_mut().inboxes.get_mut(&self.port)?.pop_front()
    }

    fn send(&mut self, bytes: &[u8]) {
        if let Some(machine) = self.machine.upgrade() {
            machine.send_to_robot(self.port, bytes);
        }
    }
}
