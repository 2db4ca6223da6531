//! Answers to what operators ask.

#![allow(clippy::unwrap_used)]

use std::{cell::RefCell, path::Path, rc::Rc, time::Duration};

use common::{
    bus::{Bus, Reader},
    mission::Mission,
    samples::{RequestAnswer, RequestKind, RequestSample},
    topics,
};
use simulation::{Disturbance, Observer, Request, RobotFault, Scenario, What};

#[derive(Default)]
struct Orders {
    reader: Option<Reader<RequestSample>>,
    answers: Vec<(RequestKind, RequestAnswer)>,
}

impl Observer for Orders {
    fn on_bus(&mut self, bus: &Bus) {
        self.reader = bus.reader(&topics::ORDERS).ok();
    }

    fn observe(&mut self) {
        while let Some(order) = self.reader.as_mut().and_then(|it| it.next_sample().unwrap()) {
            self.answers.push((order.kind(), order.answer()));
        }
    }
}

/// Returns the answers to these requests, each made at its time in seconds, in a mission to a
/// target 4 m ahead.
fn answers(keys: &str, asked: &[(f64, What)]) -> Vec<RequestAnswer> {
    let text = format!("target = [4, 0]\ntimeout_s = 120\nperimeter.width_m = 9\n{keys}");
    let mission = Mission::parse(&text, Path::new("asked.toml")).unwrap();
    let at = |&(seconds, ref what): &(f64, What)| Disturbance {
        at: Duration::from_secs_f64(seconds),
        what: what.clone(),
    };
    let disturbances = asked.iter().map(at).collect();
    let orders = Rc::new(RefCell::new(Orders::default()));
    let ran = Scenario { disturbances, ..Scenario::calm(&mission) }
        .run_before(Some(Box::new(Rc::clone(&orders))));
    assert!(ran.broken.is_none(), "{:?}", ran.broken);
    let answered = orders.take().answers.into_iter();
    answered.filter(|(kind, _)| *kind != RequestKind::Resume).map(|(_, answer)| answer).collect()
}

#[test]
fn a_robot_is_placed_only_at_rest_while_its_mission_waits() {
    use RequestAnswer::{Moves, Taken};
    let ask = What::Ask;
    let asked = [
        (2.5, ask(Request::Place)),
        // It rolls for a moment after the stop.
        (3.0, ask(Request::Stop)),
        (3.1, ask(Request::Place)),
        (5.0, ask(Request::Place)),
        (6.0, ask(Request::Resume)),
        // At rest for want of readings, it drives on by itself.
        (7.5, What::Fault(Some(RobotFault::RangeInvalid))),
        (10.0, ask(Request::Place)),
        (11.0, What::Fault(None)),
    ];
    assert_eq!(answers("", &asked), [Moves, Taken, Moves, Taken, Moves]);
}

#[test]
fn zones_are_added_and_removed_where_the_robot_is_not() {
    use RequestAnswer::{NotInZone, Taken, ZoneHere};
    let (here, ahead) = ([0.0, 0.0], [2.0, 0.6]);
    let asked = [
        (1.0, Request::AddZone(here)),
        (1.1, Request::AddZone(ahead)),
        (1.2, Request::RemoveZone(here)),
        (1.3, Request::RemoveZone(ahead)),
        (1.4, Request::RemoveZone(ahead)),
    ];
    let answers = answers("", &asked.map(|(at, what)| (at, What::Ask(what))));
    assert_eq!(answers, [ZoneHere, Taken, NotInZone, Taken, NotInZone]);
}

#[test]
fn hands_and_beacons_lead_only_a_robot_that_stays() {
    use RequestAnswer::{NotFollowing, NotStaying, Outside, Taken};
    let asked = [
        (1.0, Request::Hand([1.0, 0.0])),
        (1.1, Request::Goto([40.0, 0.0])),
        (1.2, Request::Append([3.0, 0.0])),
        (1.3, Request::Follow),
        (1.4, Request::EndFollow),
    ]
    .map(|(at, what)| (at, What::Ask(what)));
    assert_eq!(answers("", &asked), [NotStaying, Outside, Taken, NotStaying, NotFollowing]);
    assert_eq!(answers("stay = true", &asked), [Taken, Outside, Taken, Taken, Taken]);
}
