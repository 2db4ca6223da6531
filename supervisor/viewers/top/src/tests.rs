//! Tests of the screen, drawn into memory.
#![allow(clippy::unwrap_used, clippy::print_stdout)]

use std::f64::consts::FRAC_PI_2;

use common::{
    grid::{CellState, GridFrame, Part},
    process_usage::Usage,
    samples::{
        CommandSample, DeathSample, FieldCell, GuidanceSample, GuidanceStatus, LinkSample, Order,
        PoseSample, PowerSample, RosterEntry, RosterHeader, StageState, Stamp, TargetPoint,
        TargetSample, name,
    },
};
use glam::DVec2;
use ratatui::{Terminal, backend::TestBackend};

use robot_state::Sample;

use super::{action::KEYS, screen, view::View};

const STAGES: [&str; 5] = ["link", "dead-reckoning", "mapper", "planner", "controller"];

/// Returns a robot in mid-mission: a wall to the east, and the field to the north, where the target
/// is.
fn view() -> View {
    let mut view = View::new("robot-of-16-char".parse().unwrap());
    view.on_connected();
    let stamp = Stamp { tick: 8641, stamp_ns: 1_234_500_000_000, generation: 1, sequence: 9 };
    let header = RosterHeader {
        stamp,
        supervisor_pid: 4_194_303,
        order: Order::Drive.into(),
        reason: 1,
        simulated: 1,
        last_request: 0,
        answer: 0,
    };
    let entries = STAGES.map(|stage| RosterEntry {
        stage: name(stage),
        pid: 4_194_000,
        generation: 100,
        state: StageState::Running.into(),
        restarts: 99,
        uptime_ns: 1,
        beat_age_ns: 599_900_000_000,
        output_age_ns: 0,
    });
    view.apply(&Sample::Roster(header, entries.to_vec()));
    let usage = Usage { cpu: Some(1.99), memory_bytes: Some(999_900_000) };
    view.usage = vec![usage; STAGES.len() + 1];
    view.rates_hz = vec![Some(1234.4); STAGES.len()];
    view.state.stages[3].state = StageState::BackingOff.into();
    let frame = GridFrame { cells: 100, resolution_m: 0.1, centre: DVec2::ZERO };
    let mut grid = vec![CellState::Free as u8; frame.area()];
    let mut field = vec![FieldCell { ex: 0.0, ey: 1.0, log2_u: -1.0 }; frame.area()];
    for row in 0..100 {
        for col in 0..100 {
            let rim = [row, col].iter().any(|&at| at == 0 || at == 99);
            let wall = col >= 80 && row < 50;
            let state = match (rim, wall) {
                (true, _) => CellState::Perimeter,
                (_, true) => CellState::Sensed,
                _ => continue,
            };
            grid[row * 100 + col] = state as u8;
            field[row * 100 + col].ey = 0.0;
        }
    }
    view.state.map.apply(&Part::whole(frame, 3), &grid);
    view.state.field.apply(&Part::whole(frame, 3), &field);
    let target = TargetPoint::at(DVec2::new(0.0, 4.0));
    view.state.target = Some(TargetSample { target, ..TargetSample::default() });
    for y in -40..0 {
        view.apply(&Sample::Pose(PoseSample {
            stamp,
            y_m: f64::from(y) * 0.1,
            heading_rad: FRAC_PI_2,
            travelled_m: 123.45,
            covariance: [0.0036, 0.0, 0.0, 0.0009, 0.0, 0.0],
            ..PoseSample::default()
        }));
    }
    view.state.command = Some(CommandSample { distance_m: 4.1, ..CommandSample::default() });
    view.state.guidance = Some(GuidanceSample {
        status: GuidanceStatus::Unreachable.into(),
        speed_limit_m_s: 0.5,
        full_solves: 1000,
        ..GuidanceSample::default()
    });
    view.state.link =
        Some(LinkSample { connected: 1, action: 2, cause: 12, ..LinkSample::default() });
    view.state.power = Some(PowerSample::default());
    for generation in 0..60 {
        view.apply(&Sample::Death(DeathSample {
            stamp,
            stage: name("dead-reckoning"),
            generation,
            cause: 1,
            code: 9,
            hung: 1,
            ..DeathSample::default()
        }));
    }
    view.message = "kill planner: done".to_owned();
    view
}

fn screen(view: &View, width: u16, height: u16) -> Vec<String> {
    let mut terminal = Terminal::new(TestBackend::new(width, height)).unwrap();
    terminal.draw(|frame| screen::draw(view, frame)).unwrap();
    let buffer = terminal.backend().buffer().clone();
    let lines = buffer.content().chunks(usize::from(width).max(1));
    let text = |line: &[ratatui::buffer::Cell]| {
        let line: String = line.iter().map(ratatui::buffer::Cell::symbol).collect();
        line.trim_end().to_owned()
    };
    let lines: Vec<_> = lines.map(text).collect();
    println!("{}", lines.join("\n"));
    lines
}

fn columns(line: &str, letters: &str) -> Vec<usize> {
    let columns = line.chars().enumerate();
    columns.filter(|(_, letter)| letters.contains(*letter)).map(|(at, _)| at).collect()
}

#[test]
fn every_stage_with_all_its_columns_is_on_the_smallest_and_on_a_large_screen() {
    for (width, height) in [(80, 24), (200, 50)] {
        let lines = screen(&view(), width, height);
        assert!(
            lines[0].contains("robot-of-16-char (simulated): driving, 1234.5 s"),
            "{}",
            lines[0]
        );
        for (line, stage) in lines[2..].iter().zip(STAGES) {
            let state = if stage == "planner" { "backing off" } else { "running" };
            let cells =
                [stage, state, "4194000", "100", "99", "1234 Hz", "599.9 s", "199 %", "999.9 MB"];
            let line: String = line.chars().take(80).collect();
            let words: Vec<_> = line.trim_start_matches('>').split_whitespace().collect();
            assert_eq!(words.join(" "), cells.join(" "), "{width} columns");
        }
        assert!(lines[7].contains("supervisor") && lines[7].contains("4194303"), "{}", lines[7]);
        let foot = &lines[usize::from(height) - 2..];
        assert_eq!(foot[0], "kill planner: done");
        for (key, what, _) in KEYS {
            assert!(foot[1].contains(&format!("{key} {what}")), "{}", foot[1]);
        }
        let whole = lines.join("\n");
        for text in [
            "0.00, -0.10 ±0.12 m, 90°",
            "4.1 m to target 0 of 0",
            "123.45 m",
            "no path to the target, at most 0.50 m/s",
            "0 hazards found; 1000 solves",
            "stands: odometry implausible",
            "dead-reckoning: generation 59 died (hung, signal 9)",
            "█ perimeter",
        ] {
            assert!(whole.contains(text), "{width} columns: {text:?} in\n{whole}");
        }
    }
}

#[test]
fn robot_way_target_hazard_and_field_are_where_they_are_on_the_map() {
    for (width, height, left) in [(80, 24, 0), (200, 50, 82)] {
        let lines = screen(&view(), width, height);
        let below = if left == 0 { 9 } else { 1 };
        let map = lines[below..usize::from(height) - 2].iter().map(|line| {
            line.chars().skip(left).take(if left == 0 { 26 } else { 118 }).collect::<String>()
        });
        let map: Vec<_> = map.collect();
        let find = |letter: &str| {
            let found = map.iter().enumerate();
            found
                .filter_map(|(row, line)| Some((row, *columns(line, letter).first()?)))
                .collect::<Vec<_>>()
        };
        let (robot, target) = (find("▲"), find("X"));
        let ((robot_row, robot_col), (target_row, target_col)) = (robot[0], target[0]);
        assert_eq!((robot.len(), target.len()), (1, 1));
        assert!(target_row < robot_row && target_col == robot_col, "the target is north of it");
        let way: Vec<_> = find("·");
        assert!(way.iter().all(|&(row, col)| row >= robot_row && col == robot_col), "{way:?}");
        assert!(!way.is_empty());
        assert!(find("↑").len() > 2, "the field leads north");
        let wall = |line: &str| columns(line, "█").len();
        let (north, south) = (wall(&map[2]), wall(&map[map.len() - 3]));
        assert!(south >= north + 3, "{south} letters of wall below, {north} above");
        assert!(columns(&map[map.len() - 3], "█").iter().any(|&at| at > robot_col));
    }
}

#[test]
fn a_long_message_is_shown_whole() {
    let mut view = view();
    view.message = format!("stop: {}", "the robot was not seen at rest ".repeat(8));
    let whole = screen(&view, 80, 24).join(" ");
    let words = whole.matches("seen at").count();
    assert_eq!(words, 8, "{whole}");
    assert!(whole.contains("q quit") && whole.contains("supervisor"), "{whole}");
}

#[test]
fn a_screen_of_any_size_is_drawn_and_one_without_a_robot_says_so() {
    let empty = View::new("x80".parse().unwrap());
    let lines = screen(&empty, 80, 24);
    assert_eq!(lines[0], "robot x80 is not running here; waiting for it");
    assert!(lines.join("\n").contains("no map yet"));
    for (width, height) in [(0, 0), (1, 1), (20, 5), (79, 12), (130, 10), (400, 100)] {
        screen(&view(), width, height);
        screen(&empty, width, height);
    }
    let mut gone = view();
    gone.connected = false;
    assert!(screen(&gone, 80, 24)[0].contains("has ended its run; waiting for it"));
}
