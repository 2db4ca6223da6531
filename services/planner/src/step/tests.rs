use super::*;
use crate::{
    testing::{self, beam, belief},
    view::View,
};
use GuidanceStatus::{Along, Look, Unreachable, Waiting, WayOut};
use common::{
    bus::Stamp,
    grid::{CellState, Part},
    samples::{BaseResponseSample, Mover},
};
use glam::dvec2;

fn mission() -> Mission {
    mission_of(40)
}

fn mission_of(cells: u32) -> Mission {
    testing::mission(&format!(
        "target = [1.5, 0]\nmethod = 'paper'\nperimeter = {{ width_m = 4, cells = {cells} }}"
    ))
}

/// Returns the mission of a robot that this line describes, by the default method.
fn mission_with(robot: &str) -> Mission {
    testing::mission(&format!(
        "target = [1.5, 0]\nperimeter = {{ width_m = 4, cells = 40 }}\n{robot}"
    ))
}

impl Planner {
    pub(crate) fn view(&self) -> View<'_> {
        self.live.as_ref().unwrap().view(self.grid.cells())
    }

    fn ask(&mut self, pose: &PoseSample) -> GuidanceSample {
        let stamp_ns = pose.stamp.stamp_ns + 60_000_000_000;
        let pose = PoseSample { stamp: Stamp { stamp_ns, ..pose.stamp }, ..*pose };
        self.answer(&pose).unwrap().1
    }

    fn ask_at(&mut self, x_m: f64, y_m: f64) -> GuidanceSample {
        self.ask(&PoseSample { x_m, y_m, ..PoseSample::default() })
    }

    fn ask_at_start(&mut self) -> GuidanceSample {
        self.ask_at(0.0, 0.0)
    }

    fn status_at_start(&mut self) -> GuidanceStatus {
        self.ask_at_start().status()
    }

    /// Takes its map again with this change.
    fn retake(&mut self, change: impl FnOnce(&mut GridHeader, &mut [u8])) -> Work {
        let (mut header, mut cells) = (self.belief, self.grid.cells().to_vec());
        change(&mut header, &mut cells);
        self.take_grid(&header, &cells).unwrap()
    }

    /// Takes the next version of its map, in which these places are hazard too.
    fn block(&mut self, becomes: impl Fn(DVec2) -> bool) {
        let work = self.retake(|header, cells| {
            let frame = header.part.frame();
            for (cell, state) in frame.whole().cells().zip(cells) {
                if becomes(frame.centre_of(cell)) {
                    *state = CellState::Sensed as u8;
                }
            }
            header.part.version += 1;
        });
        assert_eq!(work, Work::Stale);
    }

    fn block_post(&mut self, x: f64, y: f64) {
        self.block(|at| at.distance(dvec2(x, y)) < 0.03);
    }

    fn send(&mut self, number: u64, x: f64, y: f64) -> Work {
        let target = TargetPoint::at(dvec2(x, y));
        let sample = TargetSample { number, last: number, target, ..TargetSample::default() };
        self.take_target(&sample).unwrap()
    }

    fn solve(&mut self) {
        let job = self.begin_job().unwrap();
        assert_eq!(self.swap_in(solve(&job)).unwrap(), Work::SwappedIn);
    }
}

fn sent(mission: &Mission) -> Planner {
    let mut planner = Planner::new(mission);
    let target = TargetSample::first(mission);
    assert_eq!(planner.take_target(&target).unwrap(), Work::None);
    planner
}

pub(crate) fn keyframe(
    mission: &Mission,
    hazard: impl Fn(DVec2) -> bool,
    scanned: impl Fn(DVec2) -> bool,
) -> (GridHeader, Vec<u8>) {
    let frame = mission.grid_frame();
    let state = |cell| match frame.centre_of(cell) {
        _ if frame.is_rim(cell) => CellState::Perimeter,
        at if hazard(at) => CellState::Sensed,
        at if scanned(at) => CellState::Scanned,
        _ => CellState::Free,
    };
    let cells = frame.whole().cells().map(|cell| state(cell) as u8).collect();
    (GridHeader { part: Part::whole(frame, 1), ..GridHeader::default() }, cells)
}

fn in_room(mission: &Mission, hazard: impl Fn(DVec2) -> bool) -> Planner {
    in_scanned_room(mission, hazard, |_| false)
}

/// Returns a planner of a robot whose scan to both sides had no echo.
pub(crate) fn in_scanned_room(
    mission: &Mission,
    hazard: impl Fn(DVec2) -> bool,
    scanned: impl Fn(DVec2) -> bool,
) -> Planner {
    let (header, cells) = keyframe(mission, hazard, scanned);
    let look = |step: i32| beam(DVec2::ZERO, f64::from(step) * 15.0, 2.0);
    let mut beams = Vec::from_iter((-5..=5).map(look));
    beams.swap(0, 5);
    let header = GridHeader { part: header.part, ..belief(&beams, &[]) };
    let mut planner = sent(mission);
    assert_eq!(planner.take_grid(&header, &cells).unwrap(), Work::Solved);
    planner
}

/// A wall that is open only above y = 1.
fn wall(at: DVec2) -> bool {
    (at.x - 0.7).abs() < 0.06 && at.y < 1.0
}

fn after(seconds: f64) -> PoseSample {
    let stamp_ns = (seconds * 1e9) as u64;
    PoseSample { stamp: Stamp { stamp_ns, ..Stamp::default() }, ..PoseSample::default() }
}

fn solve(job: &Job) -> Solved {
    let field = Solver::default().solve(&job.domain, &Cancellation::default());
    Solved { number: job.number, field: field.map(Arc::new), took_ns: 0 }
}

#[test]
fn before_the_first_keyframe_there_is_no_guidance_and_a_missing_version_waits_for_it() {
    let mut planner = sent(&mission());
    assert_eq!(planner.status_at_start(), Waiting);
    assert!(planner.snapshot().is_none());
    let part = Part { keyframe: 0, width: 1, height: 1, ..Part::whole(mission().grid_frame(), 5) };
    let header = GridHeader { part, ..GridHeader::default() };
    assert_eq!(planner.take_grid(&header, &[1]).unwrap(), Work::Missed);
}

#[test]
fn the_status_and_direction_of_a_place_are_those_of_the_map_around_it() {
    let ring = |at: DVec2| (0.5..0.75).contains(&at.length());
    let block = |at: DVec2| at.x.abs() < 0.25 && at.y.abs() < 0.45;
    let aside = dvec2(1.0, -1.0).normalize();
    for (name, hazard, from, status, direction) in [
        ("an empty room", &(|_| false) as &dyn Fn(DVec2) -> bool, [0.0, 0.0], Along, DVec2::X),
        ("in the target's cell", &|_| false, [1.48, 0.02], Along, aside),
        ("walled in", &ring, [0.0, 0.0], Unreachable, DVec2::ZERO),
        ("on a hazard, left of its middle", &block, [-0.15, 0.0], WayOut, DVec2::NEG_X),
    ] {
        let guidance = in_room(&mission(), hazard).ask_at(from[0], from[1]);
        assert_eq!(guidance.status(), status, "{name}");
        let off = direction.distance(dvec2(guidance.ex, guidance.ey));
        assert!(off < 0.03, "{name}: {guidance:?}");
        let left = (mission().target - DVec2::from(from)).length();
        assert!((guidance.distance_m - left).abs() < 1e-9, "{name}: {guidance:?}");
    }
}

#[test]
fn a_wall_that_appears_elsewhere_is_solved_for_after_the_tick() {
    let mut planner = in_room(&mission_of(200), |_| false);
    let ask = |planner: &mut Planner| planner.ask_at(-1.5, 0.0);
    let before = ask(&mut planner);
    planner.block(wall);
    let after = ask(&mut planner);
    assert_eq!((after.ex, after.ey, after.full_solves), (before.ex, before.ey, 1));
    let over = [Work::Solved, Work::None];
    assert_eq!(over.map(|_| planner.end_tick().unwrap().0), over, "once");
    let guidance = ask(&mut planner);
    assert!(guidance.ey > before.ey + 0.1, "{guidance:?}");
    assert_eq!(planner.snapshot().unwrap().header.grid_version, 2);
}

#[test]
fn a_wall_that_appears_on_the_way_ahead_is_solved_for_in_the_tick() {
    let mut planner = in_room(&mission_of(200), |_| false);
    planner.block(wall);
    let guidance = planner.ask_at(0.45, 0.0);
    assert_eq!((guidance.status(), guidance.full_solves), (Along, 2));
    assert!(guidance.ex < 0.0 && guidance.ey > 0.3, "{guidance:?}");
}

fn evidential(scanned: impl Fn(DVec2) -> bool) -> Planner {
    let mission = Mission { method: Method::Evidential, ..mission() };
    in_scanned_room(&mission, |_| false, scanned)
}

#[test]
fn an_evidential_robot_without_sensing_does_not_look_first() {
    let mission = Mission { method: Method::Evidential, sensing: false, ..mission() };
    let mut planner = in_room(&mission, |_| false);
    let guidance = planner.ask_at_start();
    assert_eq!(guidance.status(), Along);
    assert_eq!(guidance.speed_limit_m_s, f64::INFINITY);
}

#[test]
fn an_evidential_robot_looks_square_to_the_surfaces_it_could_touch_undetected() {
    // A sonar that looked ahead only scanned all ground.
    let mut planner = evidential(|_| true);
    planner.belief.clear_beam_count = 1;
    let guidance = planner.ask_at_start();
    assert_eq!(guidance.status(), Look);
    let to_the_side = guidance.ey.atan2(guidance.ex).to_degrees().abs();
    assert!((45.0..=90.0).contains(&to_the_side), "{to_the_side}");
}

#[test]
fn a_robot_that_senses_beside_it_turns_from_a_drum_before_the_field_does() {
    let drum = |at: DVec2| at.distance(dvec2(0.8, 0.05)) < 0.3;
    let mut planner = in_scanned_room(&mission_with(KOBUKI), drum, |_| true);
    let pose = Pose2 { position: dvec2(0.1, 0.0), ..Pose2::default() };
    let (_, field) = planner.follow_field(&pose).unwrap();
    let guidance = planner.ask_at(0.1, 0.0);
    assert_eq!(guidance.status(), Along);
    let [field, aimed] = [field.to_angle(), guidance.ey.atan2(guidance.ex)].map(f64::to_degrees);
    assert!(field < 0.0 && (-90.0..field - 5.0).contains(&aimed), "{field} {aimed}");
}

#[test]
fn a_robot_whose_base_was_found_to_stop_late_goes_no_faster_than_it_can_stop() {
    let mut planner = evidential(|at| at.x < 0.7);
    let before = planner.ask_at_start().speed_limit_m_s;
    let mut limit = |dead_time_s| {
        let sample =
            BaseResponseSample { dead_time_s, acceleration_m_s2: 0.3, ..Default::default() };
        planner.take_response(&sample.into());
        planner.ask_at_start().speed_limit_m_s
    };
    let late = limit(0.5);
    assert!(late > 0.0 && late < 0.6 * before, "{before} to {late}");
    assert_eq!(limit(f64::INFINITY), late);
}

#[test]
fn a_robot_goes_slower_before_what_it_has_not_seen_as_long_as_nobody_knows_how_it_answers() {
    let limit = |robot: &str| {
        let mission = mission_with(robot);
        in_scanned_room(&mission, |_| false, |at| at.x < 0.7).ask_at_start().speed_limit_m_s
    };
    let stated =
        "robot = { protocol = 'json', response = { delay_s = 0.07, acceleration_m_s2 = 1000.0 } }";
    let [unknown, stated, x80] = ["robot.protocol = 'json'", stated, ""].map(limit);
    assert!(unknown > 0.0 && unknown < 0.7 * stated, "{unknown} {stated}");
    assert!((stated - x80).abs() < 0.01, "{stated} {x80}");
}

#[test]
fn a_late_base_is_guided_for_the_place_where_it_will_act() {
    let mission = mission_with("robot.response.delay_s = 0.4");
    let advice = |commanded: &[CommandSample], from: f64| {
        let mut planner = in_scanned_room(&mission, |_| false, |at| at.x < 0.9);
        commanded.iter().for_each(|command| _ = planner.take_command(command));
        planner.ask(&PoseSample { x_m: from, ..after(0.48) })
    };
    let driving = CommandSample {
        v_m_s: 0.5,
        state: CommandState::Driving.into(),
        ..CommandSample::default()
    };
    let [late, there] = [advice(&[driving], 0.0), advice(&[], 0.24)];
    assert!((late.speed_limit_m_s - there.speed_limit_m_s).abs() < 1e-6, "{late:?} {there:?}");
    assert!((late.ex - there.ex).abs() < 1e-6 && late.x_m == 0.0, "{late:?} {there:?}");
    assert!(there.speed_limit_m_s < advice(&[], 0.0).speed_limit_m_s);
    let hostile = CommandSample { v_m_s: f64::NAN, ..driving };
    assert_eq!(advice(&[hostile], 0.0), advice(&[], 0.0));
}

#[test]
fn an_evidential_robot_does_not_creep_towards_what_it_hears_right_before_it() {
    for (clear_m, may_go) in [(-0.01, false), (0.07, false), (0.5, true)] {
        let mut planner = evidential(|_| true);
        let count = planner.belief.clear_beam_count as usize;
        // Every second reading is silent.
        for beam in planner.belief.clear_beams[..count].iter_mut().step_by(2) {
            (beam.x_m, beam.clear_m) = (0.19, clear_m);
            beam.bearing_rad = 0.0;
        }
        let guidance = planner.ask_at_start();
        let limit = guidance.speed_limit_m_s;
        assert_eq!(limit > 0.0, may_go, "{clear_m} m: {guidance:?}");
        let ahead = planner.advise(&Pose2::default(), WayOut, DVec2::X);
        assert_eq!(ahead.limit > 0.0, may_go, "on the way out of a hazard, {clear_m} m");
    }
}

/// Large room, of a background solver, with a wall at x = 0.8 that has two gaps.
fn large_room() -> Planner {
    let in_gap = |y| (1.0..1.4).contains(&y) || (-0.2..0.2).contains(&y);
    let mut planner = in_room(&mission_of(600), |at| (at.x - 0.8).abs() < 0.03 && !in_gap(at.y));
    assert!(planner.begin_job().is_none(), "the field is current");
    planner
}

fn close_near_gap(planner: &mut Planner) {
    planner.block(|at| (at.x - 0.8).abs() < 0.03 && at.y < 1.0);
}

#[test]
fn on_a_large_map_a_change_on_the_way_ahead_makes_the_robot_wait_until_the_field_is_solved() {
    let mut room = large_room();
    assert_eq!(room.status_at_start(), Along);
    room.block_post(0.2, 0.1);
    assert_eq!(room.status_at_start(), Waiting);
    let solved = solve(&room.begin_job().unwrap());
    let other = Solved { number: solved.number + 1, field: solved.field.clone(), took_ns: 0 };
    assert_eq!(room.swap_in(other).unwrap(), Work::None, "no field waits for it");
    assert_eq!(room.status_at_start(), Waiting);
    assert_eq!(room.swap_in(solved).unwrap(), Work::SwappedIn);
    assert_eq!(room.status_at_start(), Along);
    assert_eq!(room.ask_at(0.2, 0.1).status(), WayOut);
}

#[test]
fn on_a_large_map_a_robot_goes_on_where_nothing_changed_on_its_way_ahead() {
    let mut room = large_room();
    let before = room.ask_at_start();
    close_near_gap(&mut room);
    let after = room.ask_at_start();
    assert_eq!((after.ex, after.ey), (before.ex, before.ey), "far from the gap");
    assert_eq!(room.ask_at(0.5, 0.0).status(), Waiting, "at the gap");
    room.solve();
    let guidance = room.ask_at(0.5, 0.0);
    assert!(guidance.ey > 0.4, "to the other gap: {guidance:?}");
}

#[test]
fn a_change_while_a_job_runs_is_in_the_field_of_the_job_after() {
    let mut room = large_room();
    close_near_gap(&mut room);
    let first = room.begin_job().unwrap();
    assert!(room.begin_job().is_none(), "one at a time");
    room.block_post(0.4, 0.6);
    let version = |room: &Planner| room.snapshot().unwrap().header.grid_version;
    assert_eq!(version(&room), 1);
    room.swap_in(solve(&first)).unwrap();
    assert_eq!(version(&room), 2);
    assert_eq!(room.ask_at(0.4, 0.4).status(), Waiting);
    room.solve();
    assert_eq!(version(&room), 3);
    assert_eq!(room.ask_at(0.4, 0.4).status(), Along);
    assert_eq!(room.ask_at(0.4, 0.6).status(), WayOut);
    assert!(room.begin_job().is_none(), "the field is current");
}

#[test]
fn a_robot_cut_off_on_a_large_map_hears_so_only_from_a_field_of_the_newest_map() {
    let mut room = large_room();
    room.block(|at| (at.x - 0.8).abs() < 0.03);
    room.solve();
    assert_eq!(room.status_at_start(), Unreachable);
    room.block_post(-1.0, -1.0);
    assert_eq!(room.status_at_start(), Waiting);
    room.solve();
    assert_eq!(room.status_at_start(), Unreachable);
}

#[test]
fn the_policy_covers_every_cell_with_unit_vectors_or_nothing() {
    let planner = in_room(&mission(), |at| at.distance(dvec2(0.7, 0.3)) < 0.3);
    let snapshot = planner.snapshot().unwrap();
    let policy = snapshot.cells();
    assert_eq!((policy.len(), snapshot.header.grid_version), (1600, 1));
    for (cell, &state) in policy.iter().zip(planner.grid.cells()) {
        let length = f64::from(cell.ex).hypot(f64::from(cell.ey));
        let directed = (length - 1.0).abs() < 1e-6;
        let target = cell.log2_u == 0.0;
        assert_eq!(directed || target, state == 0, "{cell:?} where the grid says {state}");
    }
}

#[test]
fn a_planner_that_knows_no_target_gives_no_direction() {
    let mut planner = Planner::new(&mission());
    let (header, cells) = keyframe(&mission(), |_| false, |_| false);
    assert_eq!(planner.take_grid(&header, &cells).unwrap(), Work::None);
    let guidance = planner.ask_at_start();
    assert_eq!((guidance.status(), guidance.target_number), (Waiting, 0));
    assert_eq!(planner.send(1, 1.5, 0.0), Work::Solved);
    assert_eq!(planner.status_at_start(), Along);
}

#[test]
fn a_target_in_hazard_or_outside_ends_no_planner() {
    let mut planner = in_room(&mission(), |at| at.x < -0.5);
    planner.send(2, -1.5, 0.0);
    assert_eq!(planner.status_at_start(), Unreachable);
    // The mapper's next map still has hazard there.
    planner.block(|at| at.x < -0.4);
    for (x, y) in [(9.0, 0.0), (1.99, 0.0), (f64::NAN, 0.0)] {
        assert_eq!(planner.send(3, x, y), Work::None, "{x}");
        assert_eq!(planner.ask_at_start().target_number, 2, "{x}");
    }
}

#[test]
fn on_a_large_map_the_robot_waits_until_the_field_leads_to_its_new_target() {
    let mut room = large_room();
    room.block_post(-1.0, -1.0);
    let before = room.begin_job().unwrap();
    assert_eq!(room.send(2, -1.5, 0.0), Work::Stale);
    assert_eq!(room.status_at_start(), Waiting);
    assert_eq!(room.swap_in(solve(&before)).unwrap(), Work::None);
    assert_eq!(room.status_at_start(), Waiting);
    room.solve();
    let guidance = room.ask_at_start();
    assert_eq!(guidance.status(), Along);
    assert!(guidance.ex < -0.9, "{guidance:?}");
}

#[test]
fn the_field_leads_past_a_bend_that_the_body_refused_until_the_map_is_reset() {
    // Two inflated walls 0.55 m apart, each with a gap; a way around both passes y = -1.5.
    let wall = |at: DVec2, x: f64, gap: f64| {
        (at.x - x).abs() < 0.255 && at.y > -1.0 && (at.y - gap).abs() > 0.05
    };
    let hazard = |at| wall(at, 0.3, 0.0) || wall(at, 0.85, 1.0);
    // A robot of 0.9 by 0.4 m with a laser.
    let text = "target = [1.5, 1.0]\nrobot.model = 'jackal'\n\
         perimeter = { width_m = 4, cells = 80 }\n\
         robot.footprint = [[-0.45, -0.2], [0.45, -0.2], [0.45, 0.2], [-0.45, 0.2]]";
    let mut planner = in_scanned_room(&testing::mission(text), hazard, |_| true);
    let mut led = planner.ask_at(-0.3, 0.0);
    assert!(led.speed_limit_m_s == 0.0, "it does not go in: {led:?}");
    for _ in 0..30 {
        planner.end_tick().unwrap();
        led = planner.ask_at(-0.3, 0.0);
    }
    assert!(led.ey < -0.5 && led.status() != Unreachable, "{led:?}");
    planner.retake(|header, _| (header.epoch, header.part.version) = (1, 2));
    assert_eq!(planner.ask_at(-0.3, 0.0).speed_limit_m_s, 0.0, "the refusal is forgotten");
}

const KOBUKI: &str = "robot.model = 'kobuki'";
const JACKAL: &str = "robot.model = 'jackal'";

/// Robot at the origin that drives at 0.4 m/s along x, beside a mover, in a scanned hall with two
/// walls at `wall_m` metres from its way.
fn guidance_beside(wall_m: f64, robot: &str, at: [f64; 2], velocity: [f64; 2]) -> GuidanceSample {
    let pose = PoseSample { v_m_s: 0.4, ..PoseSample::default() };
    in_hall(wall_m, robot).guidance(&pose, at, velocity)
}

fn in_hall(wall_m: f64, robot: &str) -> Planner {
    let hall = "target = [4, 0]\nperimeter = { width_m = 12, cells = 120 }";
    let mission = testing::mission(&format!("{hall}\n{robot}"));
    in_scanned_room(&mission, |at| at.y.abs() > wall_m, |_| true)
}

impl Planner {
    fn guidance(&mut self, pose: &PoseSample, at: [f64; 2], velocity: [f64; 2]) -> GuidanceSample {
        let ([x_m, y_m], [vx_m_s, vy_m_s]) = (at.map(|x| x as f32), velocity.map(|v| v as f32));
        let mover = Mover { x_m, y_m, vx_m_s, vy_m_s, radius_m: 0.3, ..Mover::default() };
        self.retake(|header, _| (header.movers[0], header.mover_count) = (mover, 1));
        self.ask(pose)
    }

    /// Returns the guidance while something comes along x from `x_m`.
    fn comes(&mut self, second: u8, x_m: f64) -> GuidanceSample {
        self.guidance(&after(second.into()), [x_m, 0.1], [-1.2, 0.0])
    }
}

#[test]
fn a_robot_that_movers_kept_from_its_way_for_long_goes_on_where_it_rests_in_time_and_steps_aside_no_more()
 {
    let aside = |guidance: GuidanceSample| guidance.ey.abs() > 0.3;
    let insisting = || {
        let mut planner = in_hall(6.0, JACKAL);
        (1..=16).for_each(|second| assert!(aside(planner.comes(second, 4.5)), "{second} s"));
        planner.comes(17, 4.5);
        let far = planner.comes(18, 4.5);
        assert!(far.ex > 0.99 && far.signed_limit_m_s() > 0.0, "{far:?}");
        planner
    };
    assert_eq!(insisting().comes(19, 1.0).status(), Waiting);
    let mut alone = insisting();
    (19..=35).for_each(|second| _ = alone.comes(second, 100.0));
    assert!(aside(alone.comes(36, 4.5)), "nothing moved near it");
    let mut sent = insisting();
    sent.send(2, 4.0, 0.2);
    assert!(aside(sent.comes(19, 4.5)), "it has another target");
}

#[test]
fn what_goes_away_or_passes_far_off_changes_no_guidance() {
    let speed = mission_with(KOBUKI).speed_m_s();
    for (at, velocity) in [([1.5, 0.0], [1.5, 0.0]), ([0.0, 3.0], [1.0, 0.0])] {
        let guidance = guidance_beside(6.0, KOBUKI, at, velocity);
        assert_eq!(guidance.status(), Along);
        assert!(guidance.ex > 0.99 && guidance.signed_limit_m_s() >= speed, "{guidance:?}");
    }
}

#[test]
fn a_robot_gets_out_of_the_way_of_what_comes_early_or_stands() {
    let near = guidance_beside(6.0, JACKAL, [2.5, 0.1], [-0.8, 0.0]);
    let aside = near.ey.abs() > 0.3 || near.maneuver() == Maneuver::Back;
    assert!(aside && near.status() == Along, "{near:?}");
    // A Jackal cannot back up, because its laser does not cover the rear.
    let far = guidance_beside(6.0, JACKAL, [4.5, 0.1], [-1.2, 0.0]);
    assert!(far.status() == Along && far.ey.abs() > 0.3, "{far:?}");
    let late = guidance_beside(6.0, KOBUKI, [1.2, 0.0], [-1.5, 0.0]);
    assert_eq!(late.status(), Waiting, "{late:?}");
}

#[test]
fn a_robot_does_not_take_a_wall_beside_what_comes_for_its_trace_and_does_not_step_aside_into_it() {
    let aside = |wall_m| {
        (13..19).any(|decimetres| {
            let at = [0.1 * f64::from(decimetres), 0.0];
            let guidance = guidance_beside(wall_m, JACKAL, at, [-0.4, 0.0]);
            guidance.ey.abs() > 0.3 && guidance.signed_limit_m_s() > 0.0
        })
    };
    assert_eq!([6.0, 0.1].map(aside), [true, false]);
}

#[test]
fn a_robot_backs_only_where_a_laser_looks() {
    let backs = |robot| {
        (2..30).any(|decimetres| {
            let at = [0.1 * f64::from(decimetres), 0.0];
            guidance_beside(6.0, robot, at, [-0.8, 0.0]).maneuver() == Maneuver::Back
        })
    };
    assert_eq!([KOBUKI, JACKAL].map(backs), [true, false]);
}

#[test]
fn a_robot_with_a_laser_stands_for_half_a_second_at_first_to_see_what_moves_and_others_do_not() {
    for (robot, seconds, waits) in [(KOBUKI, 0.3, true), (KOBUKI, 0.6, false), ("", 0.3, false)] {
        let mut planner = in_room(&mission_with(robot), |_| false);
        let status = planner.answer(&after(seconds)).unwrap().1.status();
        assert_eq!(status == Waiting, waits, "{robot} after {seconds} s");
    }
}

#[test]
fn a_robot_turns_at_its_target_to_the_heading_though_it_slips_and_stands_if_its_body_has_no_room() {
    let target = TargetPoint {
        heading_rad: std::f64::consts::FRAC_PI_2,
        has_heading: 1,
        ..TargetPoint::at(dvec2(4.0, 0.0))
    };
    let long = "robot.model = 'jackal'\n\
        robot.footprint = [[-0.45, -0.2], [0.45, -0.2], [0.45, 0.2], [-0.45, 0.2]]";
    for (robot, wall_m, there) in
        [(KOBUKI, 6.0, Maneuver::Turn), (long, 6.0, Maneuver::Turn), (long, 0.1, Maneuver::Stand)]
    {
        let mut planner = in_hall(wall_m, robot);
        let sent = TargetSample { number: 2, last: 2, target, ..TargetSample::default() };
        planner.take_target(&sent).unwrap();
        let tolerance_m = planner.mission.arrival_tolerance_m;
        let asked = [1.5, 0.5, 1.5, 2.5].map(|short| {
            let guidance = planner.ask_at(4.0 - short * tolerance_m, 0.0);
            assert!(guidance.maneuver() != Maneuver::Turn || guidance.ey > 0.99, "{guidance:?}");
            guidance.maneuver()
        });
        let [far, near, slipped, farther] = asked;
        assert_eq!([near, slipped], [there; 2], "{robot} {wall_m}");
        assert!(![far, farther].contains(&there), "{asked:?}");
    }
}
