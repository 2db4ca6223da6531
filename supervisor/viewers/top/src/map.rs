//! Draws map, field, robot, path and target. A letter is twice as high as wide, so it shows two
//! squares.

use std::f64::consts::FRAC_PI_4;

use common::grid::{Cell, CellState, GridFrame};
use glam::DVec2;
use ratatui::{
    style::{Color, Modifier, Style},
    text::{Line, Span},
};

use robot_state::RobotState;

/// Directions from east, counter-clockwise, 45 degrees each.
const FIELD: [char; 8] = ['→', '↗', '↑', '↖', '←', '↙', '↓', '↘'];
const ROBOT: [char; 8] = ['▶', '◥', '▲', '◤', '◀', '◣', '▼', '◢'];
pub const TARGET: char = 'X';
pub const WAY: char = '·';
/// Intervals of field symbols, letters to the right and down.
const FIELD_EVERY: (usize, usize) = (4, 2);

const SCANNED: Color = Color::Indexed(236);
pub const FIELD_STYLE: Style = Style::new().fg(Color::Indexed(67));
pub const WAY_STYLE: Style = Style::new().fg(Color::Magenta);
pub const TARGET_STYLE: Style = Style::new().fg(Color::Green).add_modifier(Modifier::BOLD);
pub const ROBOT_STYLE: Style = Style::new().fg(Color::White).add_modifier(Modifier::BOLD);

/// Order of cell states. A square shows the last of its cells' states.
const BY_IMPORTANCE: [CellState; 6] = [
    CellState::Free,
    CellState::Scanned,
    CellState::Margin,
    CellState::Perimeter,
    CellState::Known,
    CellState::Sensed,
];

fn importance(state: &CellState) -> Option<usize> {
    BY_IMPORTANCE.iter().position(|other| other == state)
}

const fn hazard(state: CellState) -> Option<Color> {
    match state {
        CellState::Free | CellState::Scanned => None,
        CellState::Margin => Some(Color::Indexed(94)),
        CellState::Perimeter => Some(Color::DarkGray),
        CellState::Known => Some(Color::Blue),
        CellState::Sensed => Some(Color::Indexed(208)),
    }
}

pub fn legend() -> [(char, Style, &'static str); 4] {
    [
        (CellState::Sensed, "sensed"),
        (CellState::Margin, "margin"),
        (CellState::Known, "known"),
        (CellState::Perimeter, "perimeter"),
    ]
    .map(|(state, what)| ('█', Style::new().fg(hazard(state).unwrap_or_default()), what))
}

struct Scale {
    frame: GridFrame,
    side: usize,
    /// Cells along each side of a square.
    step: f64,
}

impl Scale {
    /// Returns column and row of a point's square, from above, inside the map.
    fn square(&self, point: DVec2) -> Option<(usize, usize)> {
        let at = (self.frame.to_cells(point) + DVec2::splat(0.5)) / self.step;
        let inside = at.cmpge(DVec2::ZERO).all() && at.cmplt(DVec2::splat(self.side as f64)).all();
        inside.then(|| (at.x as usize, self.side - 1 - at.y as usize))
    }

    /// Returns a square's cells along one axis, counted in its direction.
    fn cells(&self, square: usize) -> std::ops::Range<usize> {
        let all = self.frame.cells as usize;
        let first = ((square as f64 * self.step) as usize).min(all - 1);
        let end = ((square + 1) as f64 * self.step).ceil() as usize;
        first..end.clamp(first + 1, all)
    }
}

/// Draws a map in at most `width` by `height` letters, from the first grid on.
pub fn lines(state: &RobotState, width: u16, height: u16) -> Option<Vec<Line<'static>>> {
    let frame = state.map.frame()?;
    let side = usize::from(width).min(2 * usize::from(height)) & !1;
    if side == 0 {
        return None;
    }
    let scale = Scale { frame, side, step: f64::from(frame.cells) / side as f64 };
    let mut letters: Vec<Vec<(char, Style)>> = (0..side / 2)
        .map(|line| (0..side).map(|col| letter(state, &scale, col, line)).collect())
        .collect();
    let mut put = |point: DVec2, letter: char, style: Style| {
        if let Some((col, row)) = scale.square(point) {
            letters[row / 2][col] = (letter, style);
        }
    };
    for &point in &state.way {
        put(point, WAY, WAY_STYLE);
    }
    for target in state.targets() {
        put(target.position(), TARGET, TARGET_STYLE);
    }
    if let Some(pose) = state.pose {
        put(pose.pose().position, robot(pose.heading_rad), ROBOT_STYLE);
    }
    let line = |letters: Vec<(char, Style)>| -> Line<'static> {
        letters.into_iter().map(|(letter, style)| Span::styled(letter.to_string(), style)).collect()
    };
    Some(letters.into_iter().map(line).collect())
}

pub fn robot(heading: f64) -> char {
    ROBOT[octant(heading)]
}

fn octant(angle: f64) -> usize {
    // The cast converts NaN to 0.
    ((angle / FRAC_PI_4).round() as i64).rem_euclid(8) as usize
}

fn letter(state: &RobotState, scale: &Scale, col: usize, line: usize) -> (char, Style) {
    let square = |row: usize| {
        let (cells, side) = (state.map.cells(), scale.frame.cells as usize);
        let rows = scale.cells(scale.side - 1 - row);
        let cols = scale.cells(col);
        rows.flat_map(|row| &cells[row * side + cols.start..row * side + cols.end])
            .map(|&cell| CellState::from_byte(cell))
            .max_by_key(importance)
            .unwrap_or(CellState::Free)
    };
    let (above, below) = (square(2 * line), square(2 * line + 1));
    let ground = |square| match square {
        CellState::Scanned => SCANNED,
        _ => Color::Reset,
    };
    match (hazard(above), hazard(below)) {
        (Some(one), Some(other)) if one == other => ('█', Style::new().fg(one)),
        (Some(one), Some(other)) => ('▀', Style::new().fg(one).bg(other)),
        (Some(one), None) => ('▀', Style::new().fg(one).bg(ground(below))),
        (None, Some(other)) => ('▄', Style::new().fg(other).bg(ground(above))),
        (None, None) => (
            field(state, scale, col, line).unwrap_or(' '),
            FIELD_STYLE.bg(ground(if above == CellState::Free { below } else { above })),
        ),
    }
}

fn field(state: &RobotState, scale: &Scale, col: usize, line: usize) -> Option<char> {
    let (every_col, every_line) = FIELD_EVERY;
    let drawn = col % every_col == every_col / 2 && line % every_line == every_line / 2;
    if !drawn || state.field.frame() != Some(scale.frame) {
        return None;
    }
    let cell = Cell {
        col: scale.cells(col).start as u32,
        row: scale.cells(scale.side - 1 - 2 * line).start as u32,
    };
    let policy = state.field.cells().get(scale.frame.index(cell))?;
    let (ex, ey) = (f64::from(policy.ex), f64::from(policy.ey));
    (ex != 0.0 || ey != 0.0).then(|| FIELD[octant(ey.atan2(ex))])
}
