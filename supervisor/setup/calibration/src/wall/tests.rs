//! Tests of the procedure on a minimal robot and world.

use common::{checkpoint::Checkpoint, kinematics::Pose2};

use super::*;

const DT: f64 = 1.0 / 7.0;
const WALL_M: f64 = 1.0;

pub(crate) fn body() -> Body {
    common::mission::RobotConfig::default().body()
}

pub(crate) fn counts_of(ways: [f64; 2]) -> [u16; 2] {
    ways.map(|way| ((way / body().metres_per_count()).round() as i64).rem_euclid(32_768) as u16)
}

/// Returns the nominal wheel distances in the next tick of an obedient robot.
pub(crate) fn obeyed(order: &Order) -> [f64; 2] {
    let aside = order.aside_rad;
    let (v, omega) = match order.status {
        GuidanceStatus::Look => (0.0, (3.0 * aside.abs()).clamp(0.25, 1.5) * aside.signum()),
        GuidanceStatus::Along => (order.speed_limit_m_s.min(0.35), 0.2 * aside.sin()),
        _ => (0.0, 0.0),
    };
    [-1.0, 1.0].map(|side| (v + side * omega * body().track_m / 2.0) * DT)
}

/// Obedient robot before a wall that answers within 22 degrees of its normal.
struct Robot {
    pose: Pose2,
    ratio: f64,
    track: f64,
    ways: [f64; 2],
}

impl Robot {
    fn new(ratio: f64, track: f64) -> Self {
        let pose = Pose2 { heading: 0.1, ..Pose2::default() };
        Self { pose, ratio, track, ways: [0.0; 2] }
    }

    fn echo(&self) -> Option<f64> {
        let aside = (self.pose.heading + PI).rem_euclid(TAU) - PI;
        let range = WALL_M - self.pose.position.x - 0.19 * aside.cos();
        (aside.abs() < 0.384 && range < 2.55).then_some((range * 100.0).round() / 100.0)
    }

    fn obey(&mut self, order: &Order) {
        let step = obeyed(order);
        self.ways = [0, 1].map(|side| self.ways[side] + step[side]);
        let both = 2.0 / (1.0 + self.ratio);
        let (left, right) = (step[0] * both, step[1] * both * self.ratio);
        let turn = (right - left) / (body().track_m * self.track);
        self.pose = self.pose.along_arc(f64::midpoint(left, right), turn);
    }
}

fn run(robot: &mut Robot, plan: CalibrationPlan) -> Wall {
    let mut wall = Wall::new(plan);
    for _ in 0..20_000 {
        let order = wall.step(counts_of(robot.ways), robot.echo(), &body());
        robot.obey(&order);
        assert!(robot.pose.position.x < WALL_M - 0.25, "{:?}", wall.phase);
        if wall.ended().is_some() {
            break;
        }
    }
    wall
}

#[test]
fn a_robot_that_does_not_slip_is_calibrated_to_a_thousandth_and_stands_where_it_began() {
    for (ratio, track) in [(1.008, 1.025), (0.992, 0.975), (1.0, 1.0)] {
        let mut robot = Robot::new(ratio, track);
        let wall = run(&mut robot, CalibrationPlan::default());
        assert_eq!(wall.ended(), Some(Ok(())));
        assert!(wall.loops.len() >= FEWEST_LOOPS);
        let estimate =
            crate::loops::checked(&wall.loops, wall.normal_sd(), body().track_m).unwrap();
        assert!((estimate.ratio() - ratio).abs() < 0.001, "{ratio}: {}", estimate.ratio());
        assert!((estimate.track() - track).abs() < 0.002, "{track}: {}", estimate.track());
        assert!(robot.pose.position.y.abs() < 1.0, "it drifted along the wall");
    }
}

#[test]
fn loops_go_to_either_side_in_turn_and_end_after_the_most_if_the_values_are_not_good_enough() {
    let plan = CalibrationPlan { ratio_sd: 0.0, loops: 7, ..CalibrationPlan::default() };
    let wall = run(&mut Robot::new(1.0, 1.0), plan);
    assert_eq!((wall.ended(), wall.loops.len()), (Some(Ok(())), 7));
    let turns: Vec<f64> = wall.loops.iter().map(|it| it.turns).collect();
    assert_eq!(turns[..4], [1.0, -1.0, 4.0, -4.0]);
}

#[test]
fn the_state_of_a_whole_calibration_fits_into_its_checkpoint_and_comes_back() {
    let plan = CalibrationPlan { ratio_sd: 0.0, loops: 40, ..CalibrationPlan::default() };
    let mut wall = run(&mut Robot::new(1.004, 1.01), plan);
    // The longest sweep is under way.
    for _ in 0..1000 {
        wall.legs.iter_mut().for_each(|leg| leg.push(1.0, Some(0.42)));
    }
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("planner.checkpoint");
    let open = || Checkpoint::open::<Wall>(&file, crate::shell::STATE_BYTES).unwrap();
    open().0.save(&wall).unwrap();
    assert_eq!(format!("{:?}", open().1), format!("{:?}", Some(wall)));
}
