#![allow(clippy::unwrap_used)]

use std::f64::consts::FRAC_PI_2;

use common::{
    grid::{CellState, GridFrame, Part},
    process_usage::Usage,
    samples::*,
};
use glam::DVec2;
use ratatui::{Terminal, backend::TestBackend, buffer::Cell};

use robot_state::Sample;

use super::{screen, view::View};

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
    view.rates_hz = STAGES.map(|stage| (stage, 1234.4)).into();
    view.state.stages[3].state = StageState::BackingOff.into();
    let frame = GridFrame { cells: 100, resolution_m: 0.1, centre: DVec2::ZERO };
    let mut grid = vec![CellState::Free as u8; frame.area()];
    let mut field = vec![FieldCell { ex: 0.0, ey: 1.0, log2_u: -1.0 }; frame.area()];
    for cell in frame.whole().cells() {
        let state = match (frame.is_rim(cell), cell.col >= 80 && cell.row < 50) {
            (true, _) => CellState::Perimeter,
            (_, true) => CellState::Sensed,
            _ => continue,
        };
        grid[frame.index(cell)] = state as u8;
        field[frame.index(cell)].ey = 0.0;
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
    let text = |line: &[Cell]| {
        let line: String = line.iter().map(Cell::symbol).collect();
        line.trim_end().to_owned()
    };
    lines.map(text).collect()
}

#[test]
fn stages_with_all_columns_and_the_map_with_all_on_it_are_on_the_smallest_and_on_a_large_screen() {
    for (width, height, stored) in
        [(80, 24, include_str!("tests/80x24.txt")), (200, 50, include_str!("tests/200x50.txt"))]
    {
        assert_eq!(screen(&view(), width, height).join("\n") + "\n", stored);
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
