//! `firsthand top`: stages, map, field and robot on a terminal, with keys for an operator's
//! actions.

// `pub` marks use by another module.
#![allow(unreachable_pub)]

mod action;
mod feed;
mod map;
mod screen;
#[cfg(test)]
mod tests;
mod view;

use std::{
    io::{self, IsTerminal as _},
    time::{Duration, Instant},
};

use clap::Parser;
use common::{
    bus::BusError,
    domain::RobotName,
    follower::{Event, Follower},
    poll,
    signals::Signals,
    topics,
};
use ratatui::DefaultTerminal;
use thiserror::Error;

use self::{
    action::{Key, Operator},
    feed::ScreenFeed,
    view::View,
};
use console::{
    failure::{Result, refuse},
    stream::let_stages_go_first,
};

/// Show a robot on the terminal: stages, believed map and field.
///
/// Keys kill, freeze, thaw, restart, stop and resume.
#[derive(Debug, Parser)]
#[command(name = "firsthand-top", version)]
pub struct Arguments {
    /// Name of the robot.
    #[arg(long, default_value = "x80")]
    robot: RobotName,
}

#[derive(Debug, Error)]
enum TopError {
    #[error(transparent)]
    Bus(#[from] BusError),
    #[error("cannot draw on this terminal: {0}; use `firsthand status` instead")]
    Terminal(#[from] io::Error),
}

/// Longest delay of a key when nothing is published.
const LOOK_EVERY: Duration = Duration::from_millis(50);
const DRAW_EVERY: Duration = Duration::from_millis(200);

pub fn show_on_terminal(arguments: &Arguments) -> Result {
    if !(io::stdin().is_terminal() && io::stdout().is_terminal()) {
        let message =
            "top needs a terminal; elsewhere use `firsthand status` and `firsthand topic hz`";
        return refuse("no-terminal", message);
    }
    let_stages_go_first();
    Ok(show(&arguments.robot)?)
}

/// Shows `robot` until q is pressed, a signal comes, or the terminal is closed.
fn show(robot: &RobotName) -> Result<(), TopError> {
    let mut signals = Signals::that_end()?;
    let mut terminal = ratatui::try_init()?;
    let shown = run(robot, &mut signals, &mut terminal);
    if terminal.show_cursor().is_err() {
        // The destructor would report an error on standard error, and panic if that is closed too.
        std::mem::forget(terminal);
    }
    match shown.and(ratatui::try_restore().map_err(TopError::from)) {
        Err(TopError::Terminal(_)) if signals.came() || is_closed() => Ok(()),
        shown => shown,
    }
}

fn is_closed() -> bool {
    poll::is_closed(io::stdin()).unwrap_or(true)
}

fn run(
    robot: &RobotName,
    signals: &mut Signals,
    terminal: &mut DefaultTerminal,
) -> Result<(), TopError> {
    let mut follower = Follower::new(robot.domain(), "top", &topics::POSE, ScreenFeed::open)
        .also_on([&topics::ROSTER as _, &topics::LINK as _]);
    let mut view = View::new(robot.clone());
    let mut operator = Operator::new(robot);
    let mut drawn = None::<Instant>;
    // The terminal library's reader never ends after the terminal is closed.
    let mut typed = Vec::new();
    while !signals.came() && !is_closed() {
        match follower.wait(LOOK_EVERY)? {
            Event::Connected => view.on_connected(),
            Event::Disconnected => view.connected = false,
            Event::Nothing => {}
            Event::Samples(feed) => feed.update(&mut view)?,
        }
        let mut changed = false;
        while poll::is_readable(io::stdin(), Duration::ZERO)? {
            let mut bytes = [0; 64];
            let read = rustix::io::read(io::stdin(), &mut bytes).map_err(io::Error::from)?;
            if read == 0 {
                return Ok(());
            }
            typed.extend_from_slice(&bytes[..read]);
        }
        for key in action::take_keys(&mut typed) {
            changed = true;
            match key {
                Key::Quit => return Ok(()),
                Key::Up => view.choose(-1),
                Key::Down => view.choose(1),
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
