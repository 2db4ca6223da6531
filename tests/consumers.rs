//! A consumer that comes late gets everything, and going away changes nothing.

use std::time::Instant;

use crate::support::{self, Run, assert_nothing_left, in_own_process};
use common::{
    bus::Bus,
    domain::Domain,
    grid::{CellState, Replica},
    samples::FieldCell,
    topics,
    waiter::Waiter,
};

/// What a consumer has heard, put together.
#[derive(Default)]
struct Heard {
    poses: Vec<(u64, f64)>,
    grid: Replica<u8>,
    grid_changes: usize,
    field: Replica<FieldCell>,
    field_changes: usize,
}

/// Listen until `enough`.
fn listen(robot: &str, enough: impl Fn(&Heard) -> bool) -> Heard {
    let bus = Bus::join(&Domain::of(robot.parse().unwrap()), "dashboard").unwrap();
    let mut pose = bus.reader(&topics::POSE).unwrap();
    let mut grid = bus.slice_reader(&topics::GRID).unwrap();
    let mut field = bus.slice_reader(&topics::FIELD).unwrap();
    let mut waiter = Waiter::default();
    waiter.on(bus.wakeup(&topics::POSE).unwrap());
    let mut heard = Heard::default();
    let began = Instant::now();
    while !enough(&heard) {
        assert!(
            began.elapsed() < support::PATIENCE,
            "heard {} poses",
            heard.poses.len()
        );
        waiter.wait(support::PATIENCE).unwrap();
        while let Some(sample) = pose.take().unwrap() {
            heard.poses.push((sample.stamp.tick, sample.x_m));
        }
        while let Some(sample) = grid.take().unwrap() {
            let before = heard.grid.version();
            heard.grid.apply(&sample.header().part.revision(), &sample);
            heard.grid_changes += usize::from(heard.grid.version() > before && before > 0);
        }
        while let Some(sample) = field.take().unwrap() {
            let before = heard.field.version();
            heard.field.apply(&sample.header().part.revision(), &sample);
            heard.field_changes += usize::from(heard.field.version() > before && before > 0);
        }
    }
    heard
}

#[test]
fn a_late_consumer_gets_pose_grid_and_field_whole_and_its_leaving_changes_nothing() {
    in_own_process(|| {
        let mut run = Run::start("consumed", "obstacle-course", &["--pace", "4"]);
        run.wait_until_under_way(6.0);
        let heard = listen("consumed", |heard| {
            heard.poses.len() >= 40 && heard.grid_changes >= 3 && heard.field_changes >= 3
        });
        let ticks: Vec<u64> = heard.poses.iter().map(|(tick, _)| *tick).collect();
        let in_order = ticks.windows(2).all(|pair| pair[1] == pair[0] + 1);
        assert!(in_order, "ticks missing: {ticks:?}");

        let frame = heard.grid.frame().expect("a keyframe came");
        assert_eq!(heard.grid.cells().len(), frame.area());
        let count = |state: CellState| {
            heard
                .grid
                .cells()
                .iter()
                .filter(|&&cell| cell == state as u8)
                .count()
        };
        assert_eq!(
            count(CellState::Perimeter),
            4 * (frame.cells as usize - 1),
            "the whole rim"
        );
        assert!(
            count(CellState::Sensed) > 0,
            "what was sensed before the consumer came"
        );

        assert_eq!(heard.field.frame(), Some(frame));
        let directed = heard
            .field
            .cells()
            .iter()
            .filter(|cell| cell.ex != 0.0 || cell.ey != 0.0)
            .count();
        assert!(
            directed > frame.area() / 2,
            "{directed} of {} cells have a direction",
            frame.area()
        );

        let (code, summary) = run.finish();
        assert_eq!(
            (code, &summary["outcome"]),
            (Some(0), &"reached".into()),
            "{summary}"
        );
        let restarts = summary["restarts"].as_object().unwrap();
        assert!(restarts.values().all(|times| times == 0), "{summary}");
        assert_nothing_left("consumed");
    });
}
