use std::cell::RefCell;

use common::{
    address::Address,
    bus::{encode_sample, encode_slice},
    clock::MissionClock,
    domain::Domain,
    mission::Mission,
    roster,
    run::Run,
    samples::*,
    topics,
};
use mission_control::{
    Refused,
    operator::{self, OperatorError},
};
use proptest::prelude::*;

use crate::{
    session::endpoint,
    show::{Mirror, checked},
    wire::{Clock, Hello, Sent},
};

fn run() -> Run {
    Run {
        robot: "x80".parse().unwrap(),
        address: Address::Udp("127.0.0.1:9".parse().unwrap()),
        clock: MissionClock::Ticks { period_ns: 1 },
        mission: Mission::parse("target = [3.0, 0.0]", "test").unwrap(),
    }
}

fn mirror(name: &str) -> (Domain, Mirror) {
    let domain = Domain::of(format!("{name}-{}", std::process::id()).parse().unwrap());
    let mirror = Mirror::open(&domain, run(), 7, "tls/far:7447").unwrap();
    (domain, mirror)
}

const SENT: Sent = Sent { id: 7, sent_ns: 1_000 };

fn roster_message(stages: usize) -> Vec<u8> {
    let entry = RosterEntry { pid: 1, ..RosterEntry::default() };
    let header = RosterHeader { supervisor_pid: 1, ..RosterHeader::default() };
    let mut message = Vec::new();
    encode_slice(&header, &vec![entry; stages], &mut message);
    message
}

#[test]
fn a_consumer_reads_a_mirror_as_a_robot_and_its_processes_are_none_of_this_machine() {
    let (domain, mut mirror) = mirror("reads");
    let bus = roster::join(&domain, "test").unwrap();
    let mut poses = bus.reader(&topics::POSE).unwrap();
    let mut rosters = bus.reader(&topics::ROSTER).unwrap();
    let mut ages = bus.reader(&topics::MIRROR).unwrap();
    let mut message = Vec::new();
    encode_sample(&PoseSample { x_m: 1.5, ..PoseSample::default() }, &mut message);
    mirror.take("roster", SENT, &roster_message(2)).unwrap();
    mirror.take("pose", SENT, &message).unwrap();
    assert_eq!(poses.next_sample().unwrap().unwrap().x_m, 1.5);
    let entries = rosters.next_slice().unwrap().unwrap();
    assert_eq!(entries.header().supervisor_pid, std::process::id());
    assert!(entries.iter().all(|entry| entry.pid == 0) && entries.len() == 2);
    let mut clock = Clock::default();
    clock.on_answer(0, &Hello { id: 7, clock_ns: 0, ..Hello::default() });
    mirror.tell(&clock).unwrap();
    assert!(ages.next_sample().unwrap().unwrap().age_ns > 1_000_000);
    assert!(poses.next_sample().unwrap().is_some(), "who joins later gets the newest samples");
    drop((poses, rosters, entries, ages, bus, mirror));
    assert!(!domain.directory().exists());
}

#[test]
fn orders_to_a_mirror_are_refused_with_the_place_of_the_robot() {
    let (domain, _mirror) = mirror("orders");
    let robot = &domain.robot;
    for error in [
        operator::stand(robot).unwrap_err(),
        operator::resume(robot).unwrap_err(),
        operator::send_to(robot, &[], false).unwrap_err(),
        operator::restart(robot, "mapper").unwrap_err(),
    ] {
        assert!(error.to_string().contains("tls/far:7447"), "{error}");
        assert!(matches!(error, OperatorError::Refused(Refused { code: "mirror", .. })));
    }
}

#[test]
fn samples_of_another_run_or_topic_or_too_long_are_left_out_and_the_next_is_shown() {
    let (domain, mut mirror) = mirror("left-out");
    let bus = roster::join(&domain, "test").unwrap();
    let mut rosters = bus.reader(&topics::ROSTER).unwrap();
    let mut requests = bus.reader(&topics::REQUESTS).unwrap();
    let mut grid = Vec::new();
    encode_slice(&GridHeader::default(), &vec![0_u8; 1 << 20], &mut grid);
    mirror.take("roster", Sent { id: 8, ..SENT }, &roster_message(2)).unwrap();
    mirror.take("roster", SENT, &roster_message(1000)).unwrap();
    for topic in ["grid", "requests", "nothing"] {
        mirror.take(topic, SENT, &grid).unwrap();
    }
    assert!(rosters.next_slice().unwrap().is_none() && requests.next_sample().unwrap().is_none());
    mirror.take("roster", SENT, &roster_message(2)).unwrap();
    assert!(rosters.next_slice().unwrap().is_some());
}

#[test]
fn hostile_bytes_are_refused_in_every_place_where_bytes_come_in() {
    let (_domain, mirror) = mirror("hostile");
    let mirror = RefCell::new(mirror);
    let take = |topic, message: &[u8]| mirror.borrow_mut().take(topic, SENT, message).unwrap();
    let whole = roster_message(2);
    take("roster", &whole[..9]);
    for at in whole.len() - 4 - 2 * 80..whole.len() - 4 {
        let mut lie = whole.clone();
        lie[at..at + 4].copy_from_slice(&u32::MAX.to_le_bytes());
        take("roster", &lie);
    }
    proptest!(|(bytes: Vec<u8>, topic in 0..topics::TABLE.len())| {
        let name = topics::TABLE[topic].spec().name;
        let framed = [&common::bus::cdr::HEADER[..], &bytes].concat();
        take(name, &framed);
        prop_assert_eq!(Sent::decoded(&bytes).is_some(), bytes.len() == 16);
        prop_assert_eq!(Hello::decoded(&bytes), None);
        prop_assert!(checked(&String::from_utf8_lossy(&bytes)).is_none());
    });
    assert_eq!(Hello::decoded(&vec![b' '; 5000]), None);
    let sane = toml::to_string(&run()).unwrap();
    assert!(checked(&sane).is_some());
    let huge = sane.replace("width_m = 12.0", "width_m = 12.0\ncells = 4000000000");
    assert_ne!(huge, sane);
    assert!(checked(&huge).is_none());
}

#[test]
fn an_age_is_never_told_too_low_whatever_the_clocks_and_the_link() {
    proptest!(|(theirs in 0..u64::MAX / 4, ours in 0..u64::MAX / 4,
        links in prop::collection::vec((0_u64..1 << 32, 0_u64..1 << 32), 1..20), age in 0_u64..1 << 32)| {
        let mut clock = Clock::default();
        let mut passed = 0;
        for (there, back) in links {
            let hello = Hello { clock_ns: theirs + passed + there, ..Hello::default() };
            clock.on_answer(ours + passed, &hello);
            passed += there + back;
        }
        prop_assert!(clock.age_ns(ours + passed + age, theirs + passed) >= Some(age));
        let exact = Hello { clock_ns: theirs + passed, ..Hello::default() };
        clock.on_answer(ours + passed, &exact);
        prop_assert_eq!(clock.age_ns(ours + passed + age, theirs + passed), Some(age));
    });
    assert_eq!(Clock::default().age_ns(1, 0), None);
}

#[test]
fn a_machine_is_named_with_or_without_protocol_and_port() {
    assert_eq!(endpoint("far", true), "tls/far:7447");
    assert_eq!(endpoint("10.0.0.1:80", false), "tcp/10.0.0.1:80");
    assert_eq!(endpoint("tls/[::1]:7000", false), "tls/[::1]:7000");
    assert_eq!(endpoint("[::1]", false), "tcp/[::1]:7447");
}
