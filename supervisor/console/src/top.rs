//! `firsthand top`: stages, map, field and robot on the screen of a terminal; keys that do what an operator does.
//!
//! | file | holds |
//! |---|---|
//! | `view` | what the screen shows |
//! | `feed` | brings it up to date from the bus |
//! | `screen`, `map` | draw it |
//! | `action` | what the keys do |

mod action;
mod feed;
mod map;
mod screen;
#[cfg(test)]
mod tests;
mod view;

use std::{
    io,
    sync::mpsc::{Receiver, TryRecvError, channel},
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};

use common::{
    bus::BusError,
    domain::{Domain, RobotName},
    follower::{Event, Follower},
    poll,
    signals::{SIGHUP, SIGINT, SIGTERM, Signals},
    topics,
};
use ratatui::DefaultTerminal;
use thiserror::Error;

pub use self::action::{Act, Action};
use self::{action::Key, feed::Feed, view::View};

/// Why the screen ended.
#[derive(Debug, Error)]
pub enum TopError {
    /// The bus.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// The terminal, while it is open.
    #[error("cannot draw on this terminal: {0}; `firsthand status` needs none")]
    Terminal(#[from] io::Error),
}

/// A key is noticed so soon where nothing is published.
const LOOK_EVERY: Duration = Duration::from_millis(50);
/// The screen is drawn again so often.
const DRAW_EVERY: Duration = Duration::from_millis(200);

/// Show `robot` until q is pressed, a signal comes, or the terminal is closed. `act` does what a key asks for.
///
/// # Errors
/// When a bus that is there cannot be read, or the terminal refuses while it is open.
pub fn show(robot: &RobotName, act: Act) -> Result<(), TopError> {
    let mut signals = Signals::catch(&[SIGINT, SIGTERM, SIGHUP])?;
    let mut terminal = ratatui::try_init()?;
    let shown = run(robot, act, &mut signals, &mut terminal);
    if terminal.show_cursor().is_err() {
        // Dropped, it would tell standard error that it cannot show the cursor, and panic where that is closed too.
        std::mem::forget(terminal);
    }
    let restored = ratatui::try_restore();
    match shown.and(restored.map_err(TopError::from)) {
        Err(TopError::Terminal(_)) if signals.came() || is_closed() => Ok(()),
        shown => shown,
    }
}

fn is_closed() -> bool {
    poll::is_closed(io::stdin()).unwrap_or(true)
}

fn run(
    robot: &RobotName,
    act: Act,
    signals: &mut Signals,
    terminal: &mut DefaultTerminal,
) -> Result<(), TopError> {
    let domain = Domain::of(robot.clone());
    let mut follower = Follower::new(domain, "top", &topics::POSE, Feed::open)
        .also_on([&topics::ROSTER as _, &topics::LINK as _]);
    let mut view = View::of(robot.clone());
    let mut operator = Operator::new(robot, act);
    let mut drawn = None::<Instant>;
    // Keys are read here: the reader of the terminal's library never ends where the terminal was closed.
    let mut typed = Vec::new();
    while !signals.came() && !is_closed() {
        match follower.wait(LOOK_EVERY)? {
            Event::Connected => view.on_connected(),
            Event::Disconnected => view.connected = false,
            Event::Nothing => {}
            Event::Samples(feed) => feed.take(&mut view)?,
        }
        let mut changed = false;
        while poll::is_readable(io::stdin(), Duration::ZERO)? {
            let mut bytes = [0; 64];
            let read = rustix::io::read(io::stdin(), &mut bytes).map_err(io::Error::from)?;
            if read == 0 {
                // The terminal was closed.
                return Ok(());
            }
            typed.extend_from_slice(&bytes[..read]);
        }
        for key in action::take_keys(&mut typed) {
            changed = true;
            match key {
                Key::Quit => return Ok(()),
                Key::Up => view.chosen = view.chosen.saturating_sub(1),
                Key::Down => {
                    view.chosen = (view.chosen + 1).min(view.stages.len().saturating_sub(1));
                }
                Key::Act(action) => view.message = operator.ask(action, view.chosen_stage()),
            }
        }
        if let Some(message) = operator.answer() {
            (view.message, changed) = (message, true);
        }
        if changed || drawn.is_none_or(|drawn| drawn.elapsed() >= DRAW_EVERY) {
            terminal.draw(|frame| screen::draw(&view, frame))?;
            drawn = Some(Instant::now());
        }
    }
    Ok(())
}

/// Does one thing at a time, beside the screen: a stop takes until the robot rests.
struct Operator {
    robot: RobotName,
    act: Act,
    under_way: Option<(JoinHandle<()>, Receiver<String>)>,
}

impl Operator {
    fn new(robot: &RobotName, act: Act) -> Self {
        Self {
            robot: robot.clone(),
            act,
            under_way: None,
        }
    }

    /// Begin. Returns what to show meanwhile.
    fn ask(&mut self, action: Action, stage: Option<&str>) -> String {
        if self.under_way.is_some() {
            return "the last key is not done yet".to_owned();
        }
        let stage = match stage {
            _ if !action.is_of_a_stage() => String::new(),
            Some(stage) => stage.to_owned(),
            None => return "no stage is known yet".to_owned(),
        };
        let asked = format!("{} {stage}", action.name()).trim_end().to_owned();
        let (robot, act, name) = (self.robot.clone(), self.act, asked.clone());
        let (tell, told) = channel();
        let thread = thread::spawn(move || {
            let message = match act(&robot, action, &stage) {
                Ok(()) => format!("{name}: done"),
                Err(problem) => format!("{name}: {problem}"),
            };
            // Nobody listens any more where the screen has ended.
            let _ = tell.send(message);
        });
        self.under_way = Some((thread, told));
        format!("{asked} ...")
    }

    /// What became of it, once.
    fn answer(&mut self) -> Option<String> {
        let (_, told) = self.under_way.as_ref()?;
        let message = match told.try_recv() {
            Ok(message) => message,
            Err(TryRecvError::Empty) => return None,
            Err(TryRecvError::Disconnected) => "failed".to_owned(),
        };
        self.end();
        Some(message)
    }

    fn end(&mut self) {
        if let Some((thread, _)) = self.under_way.take() {
            let _ = thread.join();
        }
    }
}

/// What is under way leaves the bus in order.
impl Drop for Operator {
    fn drop(&mut self) {
        self.end();
    }
}
