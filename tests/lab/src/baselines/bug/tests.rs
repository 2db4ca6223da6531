use super::*;
use crate::baselines::{
    planner::Baseline,
    testing::{drawn, pose, sent},
};
use common::samples::{GridHeader, GuidanceSample, GuidanceStatus};

/// Draws a wall across the line whose ends are 0.5 m off; cells of 0.1 m, (0, 0) in the middle.
fn wall() -> Vec<String> {
    let row = |row: i32| {
        let column = |col: i32| {
            if col == 12 && (7..=17).contains(&row) { '#' } else { '.' }
        };
        (0..25).map(column).collect()
    };
    (0..25).map(row).collect()
}

fn ring() -> Vec<String> {
    let row = |row: i32| {
        let column = |col: i32| {
            let reach = (col - 6).abs().max((row - 12).abs());
            if reach == 4 { '#' } else { '.' }
        };
        (0..25).map(column).collect()
    };
    (0..25).map(row).collect()
}

const START: [f64; 2] = [-0.6, 0.0];
const TARGET: [f64; 2] = [0.8, 0.0];

struct Drive {
    bug: Baseline<Bug>,
    header: GridHeader,
    cells: Vec<u8>,
    at: DVec2,
}

impl Drive {
    fn on(rows: &[String]) -> Self {
        let rows: Vec<&str> = rows.iter().map(String::as_str).collect();
        let (header, cells) = drawn(&rows);
        let mut drive = Self { bug: sent(TARGET), header, cells, at: START.into() };
        drive.see();
        drive
    }

    fn see(&mut self) {
        assert!(self.bug.belief.follow(&self.header, &self.cells));
    }

    fn guidance(&mut self) -> GuidanceSample {
        self.bug.guidance(&pose(self.at.into()))
    }

    /// Drives along the guidance until its status changes or `is_over`. Returns that guidance.
    fn until(&mut self, is_over: impl Fn(&Self) -> bool) -> GuidanceSample {
        for _ in 0..1000 {
            let guidance = self.guidance();
            if is_over(self) || guidance.status != u8::from(GuidanceStatus::Along) {
                return guidance;
            }
            self.at += 0.02 * DVec2::new(guidance.ex, guidance.ey);
        }
        panic!("it does not end: {:?} at {}", self.bug.planner, self.at);
    }

    fn follows(&self) -> bool {
        self.bug.planner.following.is_some()
    }

    fn is_there(&self) -> bool {
        self.at.distance(TARGET.into()) < 0.03
    }
}

#[test]
fn a_hazard_is_gone_around_to_the_left_and_left_on_the_line_nearer_to_the_target() {
    let mut drive = Drive::on(&wall());
    drive.until(Drive::follows);
    assert!(drive.at.x < -0.2, "met from {}", drive.at);
    drive.until(|drive| drive.at.y.abs() > 0.3);
    assert!(drive.at.y > 0.0, "to the left, {}", drive.at);
    drive.until(|drive| !drive.follows());
    assert!(drive.at.x > 0.05 && drive.at.y.abs() < 0.08, "left at {}", drive.at);
    drive.until(Drive::is_there);
    assert!(drive.is_there(), "{:?} at {}", drive.bug.planner, drive.at);
}

#[test]
fn a_robot_that_comes_back_to_where_it_met_the_hazard_has_no_way_until_the_belief_is_forgotten() {
    let mut drive = Drive::on(&ring());
    let guidance = drive.until(Drive::is_there);
    assert_eq!(guidance.status, u8::from(GuidanceStatus::Unreachable));
    drive.header.epoch = 1;
    drive.cells.fill(0);
    drive.see();
    drive.until(Drive::is_there);
    assert!(drive.is_there());
}

#[test]
fn the_next_process_goes_on_around_the_hazard_where_the_last_one_was_killed() {
    let mut first = Drive::on(&wall());
    first.until(|drive| drive.at.y > 0.4);
    let mut second = Drive::on(&wall());
    second.at = first.at;
    second.bug.planner = first.bug.planner.clone();
    for _ in 0..40 {
        let guidance = first.guidance();
        assert_eq!(guidance, second.guidance());
        first.at += 0.02 * DVec2::new(guidance.ex, guidance.ey);
        second.at = first.at;
    }
    assert_eq!(first.bug.planner, second.bug.planner);
}

#[test]
fn a_hazard_that_vanishes_is_gone_around_no_longer() {
    let mut drive = Drive::on(&wall());
    drive.until(|drive| drive.at.y > 0.2);
    drive.cells.fill(0);
    drive.see();
    drive.until(|drive| !drive.follows());
    assert!(drive.at.y < 0.25, "{}", drive.at);
    drive.until(Drive::is_there);
    assert!(drive.is_there());
}

#[test]
fn a_robot_inside_hazard_leaves_it() {
    let mut drive = Drive::on(&wall());
    drive.at = DVec2::new(0.02, 0.1);
    assert_eq!(drive.guidance().status, u8::from(GuidanceStatus::WayOut));
}
