use common::{
    latency::Histogram,
    process_usage::Usage,
    samples::{Action, LinkSample, RosterEntry, StageState, name_str},
};
use ratatui::{
    Frame,
    layout::{Constraint, Layout, Rect},
    style::{Color, Modifier, Style},
    text::{Line, Span},
    widgets::{Paragraph, Row, Table, TableState, Wrap},
};

use super::{action::KEYS, map, view::View};
use console::{
    waiting,
    words::{self, age},
};
use robot_state::{RobotState, guidance_in_words};

const TABLE_WIDTH: u16 = 80;
const WIDE: u16 = TABLE_WIDTH + 50;

const TITLE: Style = Style::new().add_modifier(Modifier::BOLD);
const DIM: Style = Style::new().fg(Color::DarkGray);
const BAD: Style = Style::new().fg(Color::Red).add_modifier(Modifier::BOLD);

pub fn draw(view: &View, frame: &mut Frame<'_>) {
    let [title, body, message, keys] = Layout::vertical([
        Constraint::Length(1),
        Constraint::Min(0),
        Constraint::Length(message_height(&view.message, frame.area().width)),
        Constraint::Length(1),
    ])
    .areas(frame.area());
    frame.render_widget(Paragraph::new(heading(view)), title);
    let table_height = view.state.stages.len() as u16 + 3;
    let split = |area: Rect, left: u16| {
        let columns = [Constraint::Length(left), Constraint::Length(2), Constraint::Min(0)];
        let [left, _, right] = Layout::horizontal(columns).areas(area);
        [left, right]
    };
    let is_wide = body.width >= WIDE;
    let [left, right] = if is_wide { split(body, TABLE_WIDTH) } else { [body; 2] };
    let [stages, below] =
        Layout::vertical([Constraint::Length(table_height), Constraint::Min(0)]).areas(left);
    // The map is square, and a line is as high as two letters are wide.
    let side = (2 * below.height).min(below.width / 2);
    let [map, text] = if is_wide { [right, below] } else { split(below, side) };
    table(view, frame, stages);
    details(view, frame, text);
    let lines = map::lines(&view.state, map.width, map.height)
        .unwrap_or_else(|| vec![Line::styled("no map yet", DIM)]);
    frame.render_widget(Paragraph::new(lines), map);
    let wrapped = Paragraph::new(view.message.as_str()).wrap(Wrap { trim: true });
    frame.render_widget(wrapped, message);
    let keys_line = explained(KEYS.map(|(key, what, _)| (key, TITLE, what)));
    frame.render_widget(Paragraph::new(keys_line), keys);
}

fn message_height(message: &str, width: u16) -> u16 {
    // Adds a fifth for lines that end early before a long word.
    let letters = message.chars().count() * 6 / 5;
    1 + (letters / usize::from(width).max(1)).min(4) as u16
}

fn heading(view: &View) -> Line<'static> {
    let robot = format!("robot {}", view.robot);
    let Some(supervisor) = view.state.supervisor else {
        let state = if view.connected { "is here" } else { waiting::NOT_RUNNING };
        return Line::from(vec![Span::styled(robot, TITLE), Span::raw(format!(" {state}"))]);
    };
    let kind = if supervisor.simulated == 1 { " (simulated): " } else { ": " };
    let state = if view.connected {
        let order = words::order(&supervisor);
        format!("{order}, {:.1} s", supervisor.stamp.seconds())
    } else {
        waiting::ENDED.to_owned()
    };
    let (is_old, age) = view.state.age_in_words().unwrap_or_default();
    let age = if age.is_empty() { age } else { format!("; {age}") };
    let age = Span::styled(age, if is_old { BAD } else { Style::new() });
    Line::from(vec![Span::styled(robot, TITLE), Span::raw(kind), Span::raw(state), age])
}

fn explained(
    signs: impl IntoIterator<Item = (impl ToString, Style, &'static str)>,
) -> Line<'static> {
    signs
        .into_iter()
        .flat_map(|(sign, style, what)| {
            [Span::styled(sign.to_string(), style), Span::styled(format!(" {what}  "), DIM)]
        })
        .collect()
}

fn table(view: &View, frame: &mut Frame<'_>, area: Rect) {
    let mut rows: Vec<_> = view
        .state
        .stages
        .iter()
        .enumerate()
        .map(|(at, entry)| stage_row(view, at, entry))
        .collect();
    if let Some(supervisor) = view.state.supervisor {
        let pid = supervisor.supervisor_pid.to_string();
        let state = if view.connected { "running" } else { "ended" };
        let usage = usage(view, view.state.stages.len());
        let (cpu, memory) = (cpu(usage), memory(usage));
        let texts = ["supervisor", state, &pid, "", "", "", "", &cpu, &memory];
        rows.push((texts.map(str::to_owned), Style::new()));
    }
    let widths: [u16; 9] = [14, 11, 7, 3, 8, 7, 7, 5, 8];
    let heads = ["stage", "state", "pid", "gen", "restarts", "rate", "beat", "CPU", "memory"];
    let row = |texts: [String; 9], style| {
        let cells = texts.into_iter().zip(widths).enumerate().map(|(at, (text, width))| match at {
            0 | 1 => text,
            _ => format!("{text:>width$}", width = usize::from(width)),
        });
        Row::new(cells).style(style)
    };
    let table = Table::new(rows.into_iter().map(|(texts, style)| row(texts, style)), widths)
        .header(row(heads.map(str::to_owned), DIM))
        .column_spacing(1)
        .highlight_symbol("> ")
        .row_highlight_style(Style::new().add_modifier(Modifier::REVERSED));
    let chosen = (!view.state.stages.is_empty()).then_some(view.chosen);
    let mut state = TableState::default().with_selected(chosen);
    frame.render_stateful_widget(table, area, &mut state);
}

/// Returns the usage of a row's stage, or of the supervisor after the last one.
fn usage(view: &View, at: usize) -> Usage {
    view.usage.get(at).copied().unwrap_or_default()
}

fn stage_row(view: &View, at: usize, entry: &RosterEntry) -> ([String; 9], Style) {
    let state = entry.state();
    let runs = view.connected && entry.pid != 0;
    let stage = name_str(&entry.stage);
    let texts = [
        stage.to_owned(),
        robot_state::words(state),
        if runs { entry.pid.to_string() } else { "-".to_owned() },
        entry.generation.to_string(),
        entry.restarts.to_string(),
        view.rates_hz.get(stage).map_or("-".to_owned(), |hz| rate(*hz)),
        age(words::seconds(entry.beat_age_ns)),
        cpu(usage(view, at)),
        memory(usage(view, at)),
    ];
    let style = match state {
        StageState::Running => Style::new(),
        StageState::Held => BAD,
        _ => Style::new().fg(Color::Yellow),
    };
    (texts, style)
}

fn rate(hz: f64) -> String {
    if hz < 100.0 { format!("{hz:.1} Hz") } else { format!("{hz:.0} Hz") }
}

fn cpu(usage: Usage) -> String {
    usage.cpu.map_or("-".to_owned(), |share| format!("{:.0} %", share * 100.0))
}

fn memory(usage: Usage) -> String {
    usage.memory_bytes.map_or("-".to_owned(), words::size)
}

fn details(view: &View, frame: &mut Frame<'_>, area: Rect) {
    let mut lines = numbers(&view.state);
    let legend = legend(usize::from(area.width));
    let room = usize::from(area.height).saturating_sub(lines.len() + legend.len() + 1);
    lines.push(Line::default());
    lines.extend(
        view.events
            .iter()
            .take(room)
            .map(|event| Line::raw(format!("{}: {}, {:.1} s", event.of, event.text, event.t))),
    );
    let [above, foot] =
        Layout::vertical([Constraint::Min(0), Constraint::Length(legend.len() as u16)]).areas(area);
    frame.render_widget(Paragraph::new(lines), above);
    frame.render_widget(Paragraph::new(legend), foot);
}

fn numbers(state: &RobotState) -> Vec<Line<'static>> {
    let mut lines = Vec::new();
    let mut line = |name: &str, text: String, style: Style| {
        let name = Span::styled(format!("{name:<10}"), DIM);
        lines.push(Line::from(vec![name, Span::styled(text, style)]));
    };
    let plain = Style::new();
    if let Some(pose) = state.pose {
        let heading = pose.heading_rad.to_degrees().rem_euclid(360.0);
        let within_m = pose.position_within_m();
        let place = format!("{:.2}, {:.2} ±{within_m:.2} m, {heading:.0}°", pose.x_m, pose.y_m);
        line("pose", place, plain);
        line("speed", format!("{:.2} m/s, {:.2} rad/s", pose.v_m_s, pose.omega_rad_s), plain);
        line("to go", state.way_to_go().unwrap_or_default(), plain);
        line("driven", format!("{:.2} m", pose.travelled_m), plain);
    }
    if let Some(guidance) = state.guidance {
        let limit = guidance.signed_limit_m_s();
        let limit =
            if limit.is_finite() { format!(", at most {limit:.2} m/s") } else { String::new() };
        line("guidance", format!("{}{limit}", guidance_in_words(guidance.status)), plain);
        let (events, full) = (guidance.safety_events, guidance.full_solves);
        line("map", format!("{events} hazards found; {full} solves"), plain);
    }
    if let Some(link) = &state.link {
        let (text, style) = robot_words(link);
        line("robot", text, style);
        line("latency", latency(link), plain);
    }
    if let Some(complaint) = state.complaint() {
        line("trouble", complaint.to_string(), BAD);
    }
    if let Some(power) = state.power {
        let (board, motor, servo) = (power.board_v, power.motor_v, power.servo_v);
        let style = if power.is_low() { BAD } else { plain };
        line("battery", format!("board {board:.1}, motors {motor:.1}, servos {servo:.1} V"), style);
    }
    lines
}

fn robot_words(link: &LinkSample) -> (String, Style) {
    if link.connected == 0 {
        let lost = age(Some(link.lost_ns as f64 * 1e-9));
        return (format!("LOST for {lost}"), BAD);
    }
    let does = link.action().effect();
    match link.action() {
        Action::Go => (does.to_owned(), Style::new()),
        _ => {
            let cause = link.cause().name();
            (format!("{does}: {cause}"), Style::new().fg(Color::Yellow))
        }
    }
}

/// Formats the latency of ticks since this process of the link began.
fn latency(link: &LinkSample) -> String {
    let mut histogram = Histogram::default();
    histogram.add(&link.latency_histogram, link.latency_max_ns);
    let quantile = |share| histogram.quantile_us(share).map_or("-".to_owned(), time);
    format!("{}, 99 % {}, longest {}", quantile(0.5), quantile(0.99), quantile(1.0))
}

fn time(microseconds: f64) -> String {
    if microseconds < 1000.0 {
        format!("{microseconds:.0} µs")
    } else {
        format!("{:.1} ms", microseconds / 1e3)
    }
}

/// Explains the map's signs in lines of at most `width` columns.
fn legend(width: usize) -> Vec<Line<'static>> {
    let letters = [
        (map::robot(0.0), map::ROBOT_STYLE, "robot"),
        (map::TARGET, map::TARGET_STYLE, "target"),
        (map::WAY, map::WAY_STYLE, "way"),
        ('→', map::FIELD_STYLE, "field"),
    ];
    let mut lines: Vec<Line<'static>> = Vec::new();
    for sign in letters.into_iter().chain(map::legend()) {
        let sign = explained([sign]);
        match lines.last_mut().filter(|line| line.width() + sign.width() <= width) {
            Some(line) => line.extend(sign),
            None => lines.push(sign),
        }
    }
    lines
}
