//! Tests of the byte ports against the middleware's typed API.
//!
//! `unsafe` maps a file, because only a mapping shows which of its pages have memory. Only the
//! kernel touches the mapped pages.

use std::{
    ffi::{c_int, c_long, c_void},
    fs,
    os::{
        fd::AsRawFd as _,
        unix::{
            fs::{DirBuilderExt as _, MetadataExt as _},
            net::UnixDatagram,
        },
    },
    time::Duration,
};

use iceoryx2::prelude::{ServiceName, ZeroCopySend};

use super::*;
use crate::{
    AnyTopic, Bus, BusError, Logged, Rate, Stamp, Stamped, Topic,
    bus_instance::{BusInstance, VERSION},
    clock::MissionTime,
    domain::{Domain, SHARED_MEMORY},
    layout::{Kind, Layout as _},
    layouts,
    reserve::Places,
    spec::Limits,
    waiter::Waiter,
};

#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend)]
#[type_name("firsthand.Test")]
#[repr(C)]
pub(super) struct Test {
    pub(super) stamp: Stamp,
    pub(super) number: f64,
    pub(super) small: u32,
    pub(super) rest: u32,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend)]
#[type_name("firsthand.TestCell")]
#[repr(C)]
struct Cell {
    first: f32,
    second: u32,
    third: f32,
}

layouts! {
    Test { stamp number small rest }
    Cell { first second third }
}

impl Stamped for Test {
    fn stamp(&self) -> &Stamp {
        &self.stamp
    }
    fn stamp_mut(&mut self) -> &mut Stamp {
        &mut self.stamp
    }
}

const fn spec(name: &'static str) -> Spec {
    Spec {
        name,
        writer: "test",
        rate: Rate::EachTick,
        logged: Logged::Yes,
        limits: Limits::SMALL,
        meaning: "",
    }
}

pub(super) static STRUCTS: Topic<Test> = Topic::new(&spec("structs"));
static SLICES: Topic<Test, Cell> = Topic::new(&spec("slices"));
static BYTES: Topic<Test, u8> = Topic::new(&spec("bytes"));

fn with_bus(robot: &str, test: impl FnOnce(&Bus)) {
    let domain = Domain::of(format!("{robot}-{}", std::process::id()).parse().unwrap());
    fs::DirBuilder::new().recursive(true).mode(0o700).create(domain.directory()).unwrap();
    let table: [&dyn AnyTopic; 3] = [&STRUCTS, &SLICES, &BYTES];
    let (bus, services) = Bus::make(&domain, robot, &table).unwrap();
    test(&bus);
    drop((services, bus));
    fs::remove_dir_all(BusInstance::current(&domain).unwrap().root()).unwrap();
    for file in fs::read_dir(SHARED_MEMORY).unwrap().flatten() {
        if file.file_name().to_string_lossy().starts_with(&domain.shared_memory_prefix()) {
            fs::remove_file(file.path()).unwrap();
        }
    }
    fs::remove_dir_all(domain.directory()).unwrap();
}

const TIME: MissionTime = MissionTime(7);

#[test]
fn what_the_bus_writes_is_read_with_the_middlewares_own_types_and_the_reverse() {
    with_bus("typed", |bus| {
        let name = |name: &str| ServiceName::new(name).unwrap();
        let Medium::Shared { node, .. } = &bus.medium else { unreachable!() };
        let structs = node.service_builder(&name("structs"));
        let structs = structs.publish_subscribe::<Test>().open().unwrap();
        let typed = structs.subscriber_builder().create().unwrap();
        let mut reader = bus.reader(&STRUCTS).unwrap();
        let mut sent = Test { number: 0.5, rest: 9, ..Test::default() };
        let mut writer = bus.writer(&STRUCTS, 3).unwrap();
        writer.publish(5, TIME, sent).unwrap();
        (sent.stamp.tick, sent.stamp.stamp_ns, sent.stamp.generation) = (5, 7, 3);
        assert_eq!(*typed.receive().unwrap().unwrap(), sent);
        assert_eq!(reader.next_sample().unwrap(), Some(sent));
        sent.small = 4;
        let publisher = structs.publisher_builder().create().unwrap();
        publisher.send_copy(sent).unwrap();
        let taken = reader.next_slice().unwrap().unwrap();
        assert_eq!((taken.author().process, *taken.header()), (std::process::id(), sent));

        let slices = node.service_builder(&name("slices"));
        let slices = slices.publish_subscribe::<[Cell]>().user_header::<Test>().open().unwrap();
        let typed = slices.subscriber_builder().create().unwrap();
        let mut reader = bus.reader(&SLICES).unwrap();
        let cells = [1.0, 2.0, 3.0].map(|first| Cell { first, second: 8, third: -first });
        let mut writer = bus.slice_writer(&SLICES, 3, 4).unwrap();
        writer.publish_slice(5, TIME, sent, &cells).unwrap();
        let sample = typed.receive().unwrap().unwrap();
        assert_eq!((sample.payload(), sample.user_header().rest), (&cells[..], 9));
        let slice = reader.next_slice().unwrap().unwrap();
        assert_eq!((&*slice, slice.header().number), (&cells[..], 0.5));
        let publisher = slices.publisher_builder().initial_max_slice_len(2);
        let publisher = publisher.create().unwrap();
        let mut loan = publisher.loan_slice_uninit(2).unwrap();
        *loan.user_header_mut() = sent;
        loan.write_from_slice(&cells[1..]).send().unwrap();
        let slice = reader.next_slice().unwrap().unwrap();
        assert_eq!((&*slice, *slice.header()), (&cells[1..], sent));
    });
}

#[test]
fn slices_of_any_length_up_to_the_longest_arrive_and_longer_ones_are_refused() {
    with_bus("slices", |bus| {
        let mut reader = bus.reader(&BYTES).unwrap();
        let mut writer = bus.slice_writer(&BYTES, 1, 3).unwrap();
        for sent in [&[][..], &[1], &[1, 2, 3]] {
            writer.publish_quietly(1, TIME, Test::default(), sent).unwrap();
            assert_eq!(&*reader.next_slice().unwrap().unwrap(), sent);
        }
        let long = [0; 4];
        let refused = writer.publish_quietly(1, TIME, Test::default(), &long);
        assert!(matches!(refused, Err(BusError::Refused { topic: "bytes", .. })));
    });
}

unsafe extern "C" {
    fn mmap(
        address: *mut c_void,
        length: usize,
        protection: c_int,
        flags: c_int,
        descriptor: c_int,
        offset: c_long,
    ) -> *mut c_void;
}

/// A page beyond the end of a file raises SIGBUS, like one in a full file system.
#[test]
fn a_place_is_used_only_if_the_one_behind_it_has_memory() {
    const READ_WRITE: c_int = 3;
    const SHARED: c_int = 1;
    let page = rustix::param::page_size();
    let file = tempfile::tempfile_in(SHARED_MEMORY).unwrap();
    file.set_len(4 * page as u64).unwrap();
    // SAFETY: only the kernel uses the memory.
    let start = unsafe { mmap(ptr::null_mut(), 8 * page, READ_WRITE, SHARED, file.as_raw_fd(), 0) };
    let start = start.expose_provenance();
    let places = Places::of_segment([start, start + page]);
    let is_usable = |place: usize| places.reserve_behind(start + place * page);
    assert_eq!([0, 1, 2, 3, 1].map(is_usable), [true, true, true, false, true]);
    assert_eq!(file.metadata().unwrap().blocks() * 512, 4 * page as u64);
    file.set_len(8 * page as u64).unwrap();
    // Memory was freed.
    assert!(is_usable(3));
}

#[test]
fn a_reader_gets_what_the_most_writers_published_that_ended_at_once() {
    with_bus("ended", |bus| {
        let mut reader = STRUCTS.recorder_reader(bus).unwrap();
        let writers = 0..Limits::WRITERS as u32;
        let mut writers: Vec<_> =
            writers.map(|generation| bus.writer(&STRUCTS, generation).unwrap()).collect();
        let mut message = Vec::new();
        assert_eq!(reader.next_message(&mut message).unwrap(), None);
        for writer in &mut writers {
            writer.publish_quietly(1, TIME, Test::default(), &[]).unwrap();
        }
        drop(writers);
        let taken = std::iter::from_fn(|| reader.next_message(&mut message).unwrap());
        let mut generations: Vec<_> = taken.map(|stamp| stamp.generation).collect();
        generations.sort_unstable();
        assert_eq!(generations, (0..Limits::WRITERS as u32).collect::<Vec<_>>());
    });
}

#[test]
fn a_topic_is_not_opened_as_another_payload_another_shape_or_other_fields_of_the_same_bytes() {
    #[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend)]
    #[type_name("firsthand.TestCell")]
    #[repr(C)]
    struct Swapped {
        third: f32,
        second: u32,
        first: f32,
    }
    layouts! { Swapped { third second first } }
    let Kind::Struct(mut swapped) = Swapped::kind() else { panic!("it is a struct") };
    let text = format!("{swapped:?}");
    swapped.fields[0].doc = "A comment changes no layout.";
    assert_eq!(format!("{swapped:?}"), text);
    with_bus("foreign", |bus| {
        for error in [
            bus.reader(&Topic::<Test, Cell>::new(BYTES.spec())).unwrap_err(),
            bus.reader(&Topic::<Test, Test>::new(STRUCTS.spec())).unwrap_err(),
            bus.reader(&Topic::<Test>::new(SLICES.spec())).unwrap_err(),
            bus.reader(&Topic::<Test, Swapped>::new(SLICES.spec())).unwrap_err(),
        ] {
            assert!(matches!(error, BusError::Incompatible { .. }), "{error}");
        }
        bus.reader(&SLICES).unwrap();
    });
}

#[test]
fn a_bus_of_another_version_is_not_joined_and_its_version_is_named() {
    with_bus("version", |_| {
        let domain = &Domain::of(format!("version-{}", std::process::id()).parse().unwrap());
        fs::write(domain.joining_lock_file(), "").unwrap();
        let file = BusInstance::current(domain).unwrap().config();
        let config = fs::read_to_string(&file).unwrap();
        let made_by = |version: &str| {
            fs::write(&file, config.replacen(VERSION, version, 1)).unwrap();
            Bus::join(domain, "late").map(drop)
        };
        let (series, _) = VERSION.rsplit_once('.').unwrap();
        made_by(&format!("{series}.77")).unwrap();
        for other in ["99.0.0", "of a later kind"] {
            let error = made_by(other).unwrap_err();
            assert!(matches!(error, BusError::OtherVersion { .. }), "{error}");
            let said = error.to_string();
            assert!(said.contains(other) && said.contains(VERSION), "{said}");
        }
        fs::write(&file, config.split_once('\n').unwrap().1).unwrap();
        let error = Bus::join(domain, "late").unwrap_err();
        assert!(matches!(error, BusError::OtherVersion { .. }), "{error}");
        made_by(VERSION).unwrap();
    });
}

/// Loses the second publication's datagram, like a drain that empties the socket after it marked
/// the listener as not notified.
#[test]
fn a_waiter_is_woken_again_after_a_publication_in_the_middle_of_a_drain() {
    with_bus("woken", |bus| {
        let mut writer = bus.writer(&STRUCTS, 1).unwrap();
        let wakeup = bus.wakeup(&STRUCTS).unwrap();
        let socket = UnixDatagram::from(wakeup.descriptor().unwrap().try_clone_to_owned().unwrap());
        let mut waiter = Waiter::default();
        waiter.on(wakeup);
        let mut publish = || writer.publish(1, TIME, Test::default()).unwrap();
        publish();
        assert!(waiter.wait(Duration::from_secs(5)).unwrap());
        publish();
        socket.recv(&mut [0]).unwrap();
        for _ in 0..2 {
            assert!(waiter.wait(Duration::from_secs(5)).unwrap());
            publish();
        }
    });
}

#[test]
fn a_reader_that_sleeps_is_woken_before_samples_that_wake_nobody_overrun_a_recorders_buffer() {
    with_bus("quiet", |bus| {
        let mut writer = bus.writer(&STRUCTS, 1).unwrap();
        let mut waiter = Waiter::default();
        waiter.on(bus.wakeup(&STRUCTS).unwrap());
        for _ in 0..Limits::SMALL.recorder_buffer / 4 {
            writer.publish_quietly(1, TIME, Test::default(), &[]).unwrap();
        }
        assert!(waiter.wait(Duration::ZERO).unwrap());
    });
}
