//! Topics in the memory of one thread, for the processes of a simulated machine. They keep the
//! middleware's rules: the oldest sample of a full buffer is dropped, a new reader gets each
//! writer's last sample, and an event only wakes.
//!
//! Why `unsafe` is allowed here, and why it is sound: a sample's bytes are viewed as uninitialised
//! bytes, or as bytes. Both views are of a live allocation, as long as their borrow.
#![allow(unsafe_code)]

use std::{
    cell::{Cell, RefCell},
    collections::{BTreeMap, HashSet, VecDeque},
    mem::MaybeUninit,
    rc::{Rc, Weak},
    slice,
};

use iceoryx2::service::marker::{CustomHeaderMarker, CustomPayloadMarker};

use super::raw::{Carried, Loan};
use crate::{
    error::{BusError, Result},
    machine,
    spec::Spec,
};

/// All topics of a simulated machine.
#[derive(Debug, Default)]
pub struct Memory(RefCell<BTreeMap<&'static str, Rc<Topic>>>);

impl Memory {
    pub(super) fn topic(&self, spec: &Spec) -> Rc<Topic> {
        Rc::clone(self.0.borrow_mut().entry(spec.name).or_default())
    }
}

#[derive(Debug, Default)]
pub(crate) struct Topic {
    opened: Cell<u128>,
    writers: RefCell<Vec<Weak<Writer>>>,
    readers: RefCell<Vec<(u128, Weak<Queue>)>>,
    listeners: RefCell<Vec<Weak<Listener>>>,
}

/// Buffer of a reader.
#[derive(Debug)]
pub(super) struct Queue {
    buffer: usize,
    samples: RefCell<VecDeque<Rc<Sample>>>,
}

/// Last sample.
pub(super) type Writer = RefCell<Option<Rc<Sample>>>;

/// Whether notified.
pub(crate) type Listener = Cell<bool>;

/// Bytes aligned for every payload.
#[derive(Debug)]
struct Aligned(Vec<u128>);

impl Aligned {
    fn of(bytes: usize) -> Self {
        Self(vec![0; bytes.div_ceil(size_of::<u128>())])
    }
}

#[derive(Debug)]
pub(super) struct Sample {
    pub process: u32,
    header: Aligned,
    elements: Aligned,
    bytes: usize,
}

impl Sample {
    pub(super) fn header(&self) -> *const CustomHeaderMarker {
        let header = self.header.0.as_ptr();
        header.expose_provenance();
        header.cast()
    }

    pub(super) fn elements(&self) -> &[CustomPayloadMarker] {
        let elements = self.elements.0.as_ptr();
        elements.expose_provenance();
        // SAFETY: the allocation has at least these bytes, all initialised.
        unsafe { slice::from_raw_parts(elements.cast(), self.bytes) }
    }
}

/// Returns an error once the running process is killed.
pub(super) fn alive(topic: &'static str) -> Result {
    if machine::is_killed() {
        Err(BusError::Refused { action: "use", topic, detail: "killed".to_owned() })
    } else {
        Ok(())
    }
}

impl Topic {
    pub(super) fn write(&self) -> Rc<Writer> {
        let writer = Rc::default();
        self.writers.borrow_mut().push(Rc::downgrade(&writer));
        writer
    }

    pub(super) fn read(&self, buffer: usize) -> Rc<Queue> {
        let queue = Rc::new(Queue { buffer, samples: RefCell::default() });
        self.opened.set(self.opened.get() + 1);
        self.readers.borrow_mut().push((self.opened.get(), Rc::downgrade(&queue)));
        self.writers.borrow_mut().retain(|writer| writer.strong_count() > 0);
        for writer in self.writers.borrow().iter().filter_map(Weak::upgrade) {
            queue.samples.borrow_mut().extend(writer.borrow().clone());
        }
        queue
    }

    pub(super) fn listen(&self) -> Rc<Listener> {
        let listener = Rc::default();
        self.listeners.borrow_mut().push(Rc::downgrade(&listener));
        listener
    }

    pub(super) fn reader_numbers(&self) -> HashSet<u128> {
        let readers = self.readers.borrow();
        let live = readers.iter().filter(|(_, queue)| queue.strong_count() > 0);
        live.map(|(number, _)| *number).collect()
    }

    pub(super) fn wake(&self) {
        self.listeners.borrow_mut().retain(|listener| {
            let listener = listener.upgrade();
            listener.inspect(|listener| listener.set(true)).is_some()
        });
    }

    pub(super) fn send(
        &self,
        writer: &Writer,
        carried: &Carried,
        count: usize,
        fill: &mut dyn FnMut(Loan<'_>) -> bool,
    ) -> bool {
        let (header_bytes, bytes) = carried.sizes(count);
        let mut sample = Sample {
            process: machine::process(),
            header: Aligned::of(header_bytes),
            elements: Aligned::of(bytes),
            bytes,
        };
        let header = sample.header.0.as_mut_ptr();
        header.expose_provenance();
        // SAFETY: the allocation has at least these bytes, and is borrowed exclusively.
        let elements = unsafe {
            slice::from_raw_parts_mut(
                sample.elements.0.as_mut_ptr().cast::<MaybeUninit<CustomPayloadMarker>>(),
                bytes,
            )
        };
        if !fill(Loan { header: header.cast(), elements }) {
            return false;
        }
        debug_assert!(sample.elements.0.len() * size_of::<u128>() >= bytes);
        let sample = Rc::new(sample);
        self.readers.borrow_mut().retain(|(_, queue)| {
            let Some(queue) = queue.upgrade() else { return false };
            let mut samples = queue.samples.borrow_mut();
            if samples.len() == queue.buffer {
                samples.pop_front();
            }
            samples.push_back(Rc::clone(&sample));
            assert!(samples.len() <= queue.buffer);
            true
        });
        writer.replace(Some(sample));
        true
    }
}

impl Queue {
    pub(super) fn receive(&self) -> Option<Rc<Sample>> {
        self.samples.borrow_mut().pop_front()
    }
}

#[cfg(test)]
mod tests {

    use super::*;
    use crate::{
        Bus,
        clock::MissionTime,
        ports::tests::{STRUCTS, Test},
    };

    const TIME: MissionTime = MissionTime(7);

    #[test]
    fn a_topic_in_memory_keeps_the_rules_of_one_in_shared_memory() {
        let bus = Bus::in_memory(Rc::default(), None);
        let mut early = bus.reader(&STRUCTS).unwrap();
        let mut writer = bus.writer(&STRUCTS, 3).unwrap();
        assert!(writer.has_new_reader() && !writer.has_new_reader());
        let buffer = STRUCTS.spec().limits.buffer;
        for number in 0..buffer + 2 {
            writer.publish(0, TIME, Test { number: number as f64, ..Test::default() }).unwrap();
        }
        let read = std::iter::from_fn(|| early.next_sample().unwrap());
        let numbers: Vec<_> = read.map(|sample| sample.number).collect();
        // The oldest are dropped.
        assert_eq!((numbers.len(), numbers[0]), (buffer, 2.0));
        let late = bus.reader(&STRUCTS).unwrap().next_slice().unwrap().unwrap();
        // A new reader gets the last sample.
        assert_eq!(late.header().number, (buffer + 1) as f64);
        assert_eq!(
            (late.author().generation, late.header().stamp.sequence),
            (3, buffer as u32 + 1)
        );
    }
}
