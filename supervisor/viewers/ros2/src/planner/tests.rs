mod figures;

use std::{
    f64::consts::FRAC_PI_2,
    sync::Arc,
    time::{Duration, Instant},
};

use glam::{DAffine2, DVec2};
use harmonic::Cancellation;
use ros2::{
    cdr::Cdr as _,
    frames::Frames,
    msg::{Header, OccupancyGrid, OccupancyGridUpdate, Release},
    parts::Pose,
};

use self::figures::{Grid, RESOLUTION_M};
use super::{
    calls::{self, Outcome},
    costmap::{Body, Costmap},
    inscribed,
    planning::{Failure, Planner, Reason},
};

const BODY: Body = Body { radius_m: 0.22, occupied: 99, enters_unknown: true };

fn planner() -> Planner {
    Planner::new(BODY, 2.0)
}

fn at(x: f64, y: f64) -> DAffine2 {
    DAffine2::from_angle_translation(0.5, DVec2::new(x, y))
}

fn map(grid: &Grid) -> Arc<Costmap> {
    Arc::new(Costmap::read(&grid.message()).unwrap())
}

/// Plans from (1, 4) to (9, 1) by a new planner.
fn plan_across(map: &Arc<Costmap>) -> Vec<Pose> {
    plan_alone(map, at(1.0, 4.0), &[at(9.0, 1.0)]).unwrap()
}

/// Makes two rooms of 5 m x 5 m with a door of 1.5 m at the top, and a closed box in the left one.
fn rooms() -> Grid {
    let mut grid = Grid::new(200, 100);
    grid.fill([100, 0], [2, 100], true);
    grid.fill([100, 65], [2, 30], false);
    grid.fill([10, 10], [40, 40], true);
    grid.fill([14, 14], [32, 32], false);
    grid
}

fn plan(
    planner: &mut Planner,
    map: &Arc<Costmap>,
    from: DAffine2,
    to: &[DAffine2],
) -> Result<Vec<Pose>, Failure> {
    planner.plan(map, from, to, &Cancellation::default())
}

fn plan_alone(map: &Arc<Costmap>, from: DAffine2, to: &[DAffine2]) -> Result<Vec<Pose>, Failure> {
    plan(&mut planner(), map, from, to)
}

fn update([col, row]: [u32; 2], [width, height]: [u32; 2], value: i8) -> Vec<u8> {
    let (x, y) = (col as i32, row as i32);
    let data = vec![value; (width * height) as usize];
    OccupancyGridUpdate { header: Header::at(0, "map"), x, y, width, height, data }.encode()
}

fn change(map: &mut Arc<Costmap>, corner: [u32; 2], size: [u32; 2], value: i8) {
    Arc::make_mut(map).update(&update(corner, size, value)).unwrap();
}

fn point(&[x, y, _]: &Pose) -> DVec2 {
    DVec2::new(x, y)
}

/// Counts the points on blocked cells, at every half cell of the path's chords.
fn lethal(map: &Costmap, path: &[Pose]) -> usize {
    let blocked = map.blocked_and_costs(&BODY, 1.0).0;
    let chords = path.windows(2).flat_map(|pair| {
        let [from, to] = [&pair[0], &pair[1]].map(point);
        let steps = (from.distance(to) / RESOLUTION_M * 2.0).ceil().max(1.0);
        (0..=steps as usize).map(move |step| from.lerp(to, step as f64 / steps))
    });
    let cells = map.place.inverse();
    let cell = |at| map.cell_at(cells.transform_point2(at)).unwrap();
    chords.filter(|&at| blocked[cell(at).row * map.width + cell(at).col]).count()
}

#[test]
fn no_chord_of_a_long_winding_path_enters_a_blocked_cell() {
    let mut grid = Grid::new(600, 600);
    for wall in 1..30 {
        grid.fill([0, 20 * wall], [600, 4], true);
        grid.fill([580 * (wall % 2), 20 * wall], [20, 4], false);
    }
    let map = map(&grid);
    let path = plan_alone(&map, at(0.5, 0.5), &[at(29.5, 29.6)]).unwrap();
    assert_eq!(lethal(&map, &path), 0, "{} poses", path.len());
    let mut chords = path.windows(2).map(|pair| point(&pair[0]).distance(point(&pair[1])));
    assert!(chords.any(|chord| chord > 0.2), "the path is not thinned");
}

#[test]
fn a_long_path_has_as_many_poses_as_an_answer_carries_and_all_of_its_goals() {
    let map = map(&Grid::new(1000, 20));
    let goals = [at(25.0, 0.5), at(49.0, 0.5)];
    let path = plan_alone(&map, at(1.0, 0.5), &goals).unwrap();
    // Every second of some 960 cells.
    assert!((400..=810).contains(&path.len()), "{}", path.len());
    assert!(path.contains(&[25.0, 0.5, 0.5]) && path.ends_with(&[[49.0, 0.5, 0.5]]), "{path:?}");
    let many = vec![at(2.0, 0.5); 101];
    let refused = plan_alone(&map, at(1.0, 0.5), &many).unwrap_err();
    assert!(refused.1.contains("at most 100 goals"), "{refused:?}");
}

#[test]
fn a_path_begins_at_the_start_ends_in_the_goals_pose_and_looks_ahead_a_cell_at_a_time() {
    let map = map(&rooms());
    let path = plan_across(&map);
    assert_eq!((point(&path[0]), path.last()), (DVec2::new(1.0, 4.0), Some(&[9.0, 1.0, 0.5])));
    for pair in path.windows(2) {
        let [from, to] = [&pair[0], &pair[1]].map(point);
        assert!(from.distance(to) < 2.3 * RESOLUTION_M, "{from} {to}");
        assert!(((to - from).to_angle() - pair[0][2]).abs() < 1e-9);
    }
    let by_way = plan_alone(&map, at(1.0, 4.0), &[at(4.0, 4.5), at(9.0, 1.0)]).unwrap();
    assert!(by_way.contains(&[4.0, 4.5, 0.5]) && by_way.last() == path.last());
}

#[test]
fn a_map_that_is_turned_gives_the_path_that_is_turned() {
    let straight = plan_across(&map(&rooms()));
    let turn = DAffine2::from_angle_translation(FRAC_PI_2, DVec2::ZERO);
    let mut grid = OccupancyGrid::decode(&rooms().message()).unwrap();
    grid.info.origin = [0.0, 0.0, FRAC_PI_2].into();
    let turned = Arc::new(Costmap::read(&grid.encode()).unwrap());
    let path = plan_alone(&turned, turn * at(1.0, 4.0), &[turn * at(9.0, 1.0)]).unwrap();
    assert_eq!(path.len(), straight.len());
    for (a, b) in path.iter().zip(&straight) {
        assert!(turn.transform_point2(point(b)).distance(point(a)) < 1e-6);
    }
}

#[test]
fn each_reason_against_a_path_has_nav2s_error_code_and_says_where() {
    let map = map(&rooms());
    let (free, outside, occupied, closed) =
        (at(4.0, 4.0), at(20.0, 1.0), at(0.6, 1.5), at(1.5, 1.5));
    for (from, to, code, says) in [
        (outside, free, 203, "the start (20.00, 1.00)"),
        (free, outside, 204, "the goal (20.00, 1.00)"),
        (free, at(f64::NAN, 0.0), 204, "the goal"),
        (occupied, free, 205, "the start (0.60, 1.50) is occupied"),
        (free, occupied, 206, "the goal (0.60, 1.50) is occupied"),
        (free, at(4.9, 1.0), 206, "does not fit"),
        (free, closed, 208, "no path leads from (4.00, 4.00) to (1.50, 1.50)"),
        (closed, free, 208, "no path"),
    ] {
        let (reason, words) = plan_alone(&map, from, &[to]).unwrap_err();
        assert_eq!((reason as u16 + 200, words.contains(says)), (code, true), "{words}");
    }
    assert_eq!(plan_alone(&map, free, &[]).unwrap_err().0 as u16, 9);
    let canceled = Cancellation::default();
    canceled.cancel();
    let late = planner().plan(&map, free, &[at(9.0, 1.0)], &canceled).unwrap_err();
    assert_eq!(late.0, Reason::Timeout);
}

#[test]
fn a_robot_that_touches_what_is_inflated_is_led_out_and_not_through_a_wall() {
    let mut grid = Grid::new(200, 100);
    grid.fill([100, 0], [1, 100], true);
    // 0.1 m before the wall the robot's centre is in the inflated part.
    let path = plan_alone(&map(&grid), at(4.9, 2.5), &[at(1.0, 2.5)]).unwrap();
    assert!(path.iter().all(|pose| pose[0] < 4.95));
    let through = plan_alone(&map(&grid), at(4.9, 2.5), &[at(9.0, 2.5)]).unwrap_err();
    assert_eq!(through.0, Reason::NoPath);
}

#[test]
fn a_path_leads_round_a_zone_that_costs_more() {
    // Wall with two doors, of which the lower one is nearer.
    let mut grid = Grid::new(200, 100);
    grid.fill([100, 0], [2, 100], true);
    grid.fill([100, 20], [2, 16], false);
    grid.fill([100, 65], [2, 16], false);
    let crosses = |map: &_| {
        let path = plan_alone(map, at(1.0, 1.9), &[at(9.0, 1.9)]).unwrap();
        path.iter().find(|pose| pose[0] >= 5.0).unwrap()[1]
    };
    let mut zone = map(&grid);
    let direct = crosses(&zone);
    change(&mut zone, [70, 0], [60, 50], 90);
    // The update has covered the wall beside the lower door.
    for [row, height] in [[0, 20], [36, 14]] {
        change(&mut zone, [100, row], [2, height], 100);
    }
    let around = crosses(&zone);
    assert!(direct < 2.0 && around > 3.0, "{direct} {around}");
}

#[test]
fn a_change_of_the_map_changes_the_field_of_a_goal_as_a_new_solve_would() {
    let mut changing = planner();
    let mut grid = rooms();
    let mut newest = map(&grid);
    let mut replan = |map: &_| plan(&mut changing, map, at(1.0, 4.0), &[at(9.0, 1.0)]);
    replan(&newest).unwrap();
    for (corner, size) in [([100, 80], [2, 15]), ([150, 40], [20, 4])] {
        grid.fill(corner.map(|at| at as usize), size.map(|it| it as usize), true);
        change(&mut newest, corner, size, 100);
    }
    let changed = replan(&newest).unwrap();
    let anew = plan_across(&map(&grid));
    for (a, b) in changed.iter().zip(&anew) {
        assert!(point(a).distance(point(b)) < 0.05, "{a:?} {b:?}");
    }
    for (corner, size, reason) in [([100, 60], [2, 25], 8), ([178, 18], [4, 4], 6)] {
        change(&mut newest, corner, size, 100);
        assert_eq!(replan(&newest).unwrap_err().0 as u16, reason);
    }
}

#[test]
fn cells_are_blocked_whose_centres_are_within_the_radius_of_an_occupied_one_and_unknown_ones_if_asked()
 {
    let mut grid = Grid::new(30, 20);
    grid.fill([12, 9], [1, 1], true);
    let mut map = Costmap::read(&grid.message()).unwrap();
    map.update(&update([0, 0], [1, 1], -1)).unwrap();
    map.update(&update([29, 19], [1, 1], 98)).unwrap();
    for (radius_m, enters_unknown) in [(0.0, true), (0.21, true), (0.11, false), (9.0, true)] {
        let blocked = map.blocked_and_costs(&Body { radius_m, enters_unknown, ..BODY }, 1.0).0;
        for (index, &is_blocked) in blocked.iter().enumerate() {
            let (col, row) = ((index % 30) as f64, (index / 30) as f64);
            let near = |c: f64, r: f64| (col - c).hypot(row - r) * RESOLUTION_M <= radius_m + 1e-9;
            assert_eq!(
                is_blocked,
                near(12.0, 9.0) || !enters_unknown && near(0.0, 0.0),
                "{col} {row}"
            );
        }
    }
}

#[test]
fn a_footprint_has_the_radius_of_the_circle_in_it() {
    let box_ = inscribed("[[0.3, 0.2], [0.3, -0.2], [-0.25, -0.2], [-0.25, 0.2]]").unwrap();
    assert!((box_ - 0.2).abs() < 1e-9);
    for wrong in
        ["", "[[0.3, 0.2], [0.3, -0.2]]", "[[0.3, 0.2], [0.3, -0.2], [x, -0.2], [-0.25, 0.2]]"]
    {
        assert!(inscribed(wrong).unwrap_err().contains("[[x, y], ...]"), "{wrong}");
    }
}

#[test]
fn a_map_or_update_that_is_cut_or_false_is_refused_whole() {
    let message = Grid::new(3, 2).message();
    for end in 0..message.len() {
        assert!(Costmap::read(&message[..end]).is_err(), "{end} bytes");
    }
    let mut map = Costmap::read(&message).unwrap();
    for ([col, row], size) in [([2, 0], [2, 1]), ([0, 1], [1, 2]), ([u32::MAX, 0], [1, 1])] {
        assert!(map.update(&update([col, row], size, 100)).is_err());
    }
    assert!(map.blocked_and_costs(&BODY, 1.0).0.iter().all(|blocked| !blocked));
}

#[test]
fn a_frame_is_found_in_another_by_way_of_the_one_above_both_unless_a_transform_is_old_or_missing() {
    let mut frames = Frames::default();
    let now = Instant::now();
    let take = |frames: &mut Frames, of: &[(&str, &str, Pose)], at| {
        frames.take(&crate::messages::transforms(0, of), at).unwrap();
    };
    take(&mut frames, &[("/odom", "base_link", [2.0, 0.0, 0.5])], Some(now));
    assert!(frames.find("base_link", "map", None).unwrap_err().contains("\"odom\""));
    let odom = ("map", "odom", [1.0, 2.0, FRAC_PI_2]);
    take(&mut frames, &[odom, ("map", "mast", [1.0, 0.0, 0.0])], None);
    take(&mut frames, &[("a", "b", [0.0; 3]), ("b", "a", [0.0; 3])], None);
    let later = Some(now + Duration::from_secs(1));
    for (frame, within, since, want) in [
        ("base_link", "map", Some(now), Ok([1.0, 4.0, 0.5 + FRAC_PI_2])),
        ("base_link", "map", later, Err("outdated")),
        ("odom", "map", later, Ok(odom.2)),
        ("map", "map", None, Ok([0.0; 3])),
        ("map", "odom", None, Ok([-2.0, 1.0, -FRAC_PI_2])),
        ("mast", "odom", None, Ok([-2.0, 0.0, -FRAC_PI_2])),
        ("a", "map", None, Err("loop")),
    ] {
        match (frames.find(frame, within, since), want) {
            (Ok(found), Ok([x, y, heading])) => {
                let want = DAffine2::from_angle_translation(heading, DVec2::new(x, y));
                assert!(found.abs_diff_eq(want, 1e-12), "{frame}: {found}");
            }
            (found, want) => assert!(found.unwrap_err().contains(want.unwrap_err()), "{frame}"),
        }
    }
}

/// Goals to (1, 2) from (7, 8), all but the first via (5, 6), as Cyclone DDS serialises each
/// release's types.
const GOALS: [(bool, Release, &[u8]); 4] = [
    (
        true,
        Release::Kilted,
        b"\0\x01\0\0\x03\x03\x03\x03\x03\x03\x03\x03\x03\x03\x03\x03\x03\x03\x03\x03\x0c\0\0\0\0e\xcd\x1d\x04\0\0\0map\0\0\0\0\0\0\0\xf0?\0\0\0\0\0\0\0@\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\xf0?\x0c\0\0\0\0e\xcd\x1d\x04\0\0\0map\0\0\0\0\0\0\0\x1c@\0\0\0\0\0\0 @\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\xf0?\x0a\0\0\0GridBased\0\x01",
    ),
    (
        true,
        Release::Common,
        b"\0\x01\0\0\x03\x03\x03\x03\x03\x03\x03\x03\x03\x03\x03\x03\x03\x03\x03\x03\x0c\0\0\0\0e\xcd\x1d\x04\0\0\0map\0\0\0\0\0\0\0\xf0?\0\0\0\0\0\0\0@\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\xf0?\x0c\0\0\0\0e\xcd\x1d\x04\0\0\0map\0\0\0\0\0\0\0\x1c@\0\0\0\0\0\0 @\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\xf0?\x01\0\0\0\x0c\0\0\0\0e\xcd\x1d\x04\0\0\0map\0\0\0\0\0\0\0\0\0\0\0\x14@\0\0\0\0\0\0\x18@\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\xf0?\x0a\0\0\0GridBased\0\x01",
    ),
    (
        false,
        Release::Jazzy,
        b"\0\x01\0\0\x03\x03\x03\x03\x03\x03\x03\x03\x03\x03\x03\x03\x03\x03\x03\x03\x02\0\0\0\x0c\0\0\0\0e\xcd\x1d\x04\0\0\0map\0\0\0\0\0\0\0\0\0\0\0\x14@\0\0\0\0\0\0\x18@\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\xf0?\x0c\0\0\0\0e\xcd\x1d\x04\0\0\0map\0\0\0\0\0\0\0\xf0?\0\0\0\0\0\0\0@\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\xf0?\x0c\0\0\0\0e\xcd\x1d\x04\0\0\0map\0\0\0\0\0\0\0\x1c@\0\0\0\0\0\0 @\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\xf0?\x0a\0\0\0GridBased\0\x01",
    ),
    (
        false,
        Release::Common,
        b"\0\x01\0\0\x03\x03\x03\x03\x03\x03\x03\x03\x03\x03\x03\x03\x03\x03\x03\x03\x0c\0\0\0\0e\xcd\x1d\x04\0\0\0map\0\x02\0\0\0\x0c\0\0\0\0e\xcd\x1d\x04\0\0\0map\0\0\0\0\0\0\0\0\0\0\0\x14@\0\0\0\0\0\0\x18@\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\xf0?\x0c\0\0\0\0e\xcd\x1d\x04\0\0\0map\0\0\0\0\0\0\0\xf0?\0\0\0\0\0\0\0@\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\xf0?\x0c\0\0\0\0e\xcd\x1d\x04\0\0\0map\0\0\0\0\0\0\0\x1c@\0\0\0\0\0\0 @\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\xf0?\x0a\0\0\0GridBased\0\x01",
    ),
];
type Results = (u16, [Release; 2], [&'static [u8]; 2]);
/// Results with a path from (1, 2) and without: Nav2's first code, and the oldest and newest
/// release with it.
const RESULTS: [Results; 3] = [
    (
        200,
        [Release::Humble, Release::Common],
        [
            b"\0\x01\0\0\x04\0\0\0\x0c\0\0\0\0e\xcd\x1d\x04\0\0\0map\0\x01\0\0\0\x0c\0\0\0\0e\xcd\x1d\x04\0\0\0map\0\0\0\0\0\0\0\xf0?\0\0\0\0\0\0\0@\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\xf0?\0\0\0\0\x05\0\0\0\0\0\0\0\x01\0\0\0\0",
            b"\0\x01\0\0\x06\0\0\0\0\0\0\0\0\0\0\0\x01\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\xd0\0\0\0\x07\0\0\0no way\0",
        ],
    ),
    (
        300,
        [Release::Humble, Release::Kilted],
        [
            b"\0\x01\0\0\x04\0\0\0\x0c\0\0\0\0e\xcd\x1d\x04\0\0\0map\0\x01\0\0\0\x0c\0\0\0\0e\xcd\x1d\x04\0\0\0map\0\0\0\0\0\0\0\xf0?\0\0\0\0\0\0\0@\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\xf0?\0\0\0\0\x05\0\0\0\0\0\0\0\x01\0\0\0\0",
            b"\0\x01\0\0\x06\0\0\0\0\0\0\0\0\0\0\0\x01\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\x35\x01\0\0\x08\0\0\0no goal\0",
        ],
    ),
    (
        300,
        [Release::Common, Release::Common],
        [
            b"\0\x01\0\0\x04\0\0\0\x0c\0\0\0\0e\xcd\x1d\x04\0\0\0map\0\x01\0\0\0\x0c\0\0\0\0e\xcd\x1d\x04\0\0\0map\0\0\0\0\0\0\0\xf0?\0\0\0\0\0\0\0@\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\xf0?\xff\xff\0\0\0\0\0\0\x05\0\0\0\0\0\0\0\x01\0\0\0\0",
            b"\0\x01\0\0\x06\0\0\0\0\0\0\0\0\0\0\0\x01\0\0\0\0\0\0\0\0\0\0\0\xff\xff\0\0\0\0\0\0\0\0\0\0\x35\x01\0\0\x08\0\0\0no goal\0",
        ],
    ),
];

#[test]
fn goals_are_those_of_the_release_in_which_their_bytes_are_whole() {
    for (has_one, newest, goal) in GOALS {
        for padding in 0..4 {
            let asked = calls::read(&[goal, &[0; 3][..padding]].concat(), has_one).unwrap();
            let places: Vec<_> = asked.goals.iter().map(|goal| goal.pose.at()).collect();
            assert!([&[5.0, 6.0], &[1.0, 2.0]].map(|it| *it).ends_with(&places), "{places:?}");
            assert_eq!((asked.id, asked.releases[0]), ([3; 16], newest));
            assert_eq!(asked.start.unwrap().pose.at(), [7.0, 8.0]);
        }
        for cut in 0..goal.len() {
            assert!(calls::read(&goal[..cut], has_one).is_err(), "{newest:?}, {cut} bytes");
        }
        assert!(calls::read(goal, !has_one).is_err());
    }
}

#[test]
fn results_are_those_of_the_clients_release_with_the_error_code_of_their_action() {
    let path = Outcome {
        frame: "map".to_owned(),
        at_ns: 12_500_000_000,
        took_ns: 5,
        path: vec![[1.0, 2.0, 0.0]],
        failure: None,
    };
    for (codes, releases, [found, none]) in RESULTS {
        let (reason, words) =
            if codes == 200 { (Reason::NoPath, "no way") } else { (Reason::NoGoal, "no goal") };
        let failed = Outcome { failure: Some((reason, words.to_owned())), ..Outcome::default() };
        for release in releases {
            assert_eq!(calls::result(4, &path, codes, release), found, "{release:?}");
            assert_eq!(calls::result(6, &failed, codes, release), none, "{release:?}");
        }
    }
}
