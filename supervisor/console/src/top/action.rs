//! What the keys do.

use common::domain::RobotName;
use ratatui::crossterm::event::{KeyCode, KeyEvent, KeyModifiers};

/// What an operator does to a robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action {
    /// Kill the chosen stage.
    Kill,
    /// Freeze it.
    Freeze,
    /// Let it go on.
    Thaw,
    /// Replace it by a new generation.
    Restart,
    /// Let the robot stand.
    Stop,
    /// Let it go on.
    Resume,
}

/// Does it to a robot, and to the stage that is named, until it is done; what failed is one sentence.
pub type Act = fn(&RobotName, Action, &str) -> Result<(), String>;

impl Action {
    /// The subcommand that does the same.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Kill => "kill",
            Self::Freeze => "freeze",
            Self::Thaw => "thaw",
            Self::Restart => "restart",
            Self::Stop => "stop",
            Self::Resume => "resume",
        }
    }

    /// Whether it is about a stage, and not about the robot.
    #[must_use]
    pub const fn is_of_a_stage(self) -> bool {
        !matches!(self, Self::Stop | Self::Resume)
    }
}

/// What a key means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Key {
    /// Choose the stage above.
    Up,
    /// Choose the stage below.
    Down,
    /// Do something.
    Act(Action),
    /// End.
    Quit,
}

/// The keys, for the last line of the screen.
pub(super) const KEYS: [(&str, &str); 8] = [
    ("↑↓", "choose"),
    ("k", "kill"),
    ("f", "freeze"),
    ("t", "thaw"),
    ("r", "restart"),
    ("s", "stop"),
    ("c", "resume"),
    ("q", "quit"),
];

/// What `key` means; none for any other.
pub(super) fn meaning(key: KeyEvent) -> Option<Key> {
    let control = key.modifiers.contains(KeyModifiers::CONTROL);
    Some(match key.code {
        // The terminal sends it as a key.
        KeyCode::Char('c') if control => Key::Quit,
        _ if control => return None,
        KeyCode::Up => Key::Up,
        KeyCode::Down => Key::Down,
        KeyCode::Char('k') => Key::Act(Action::Kill),
        KeyCode::Char('f') => Key::Act(Action::Freeze),
        KeyCode::Char('t') => Key::Act(Action::Thaw),
        KeyCode::Char('r') => Key::Act(Action::Restart),
        KeyCode::Char('s') => Key::Act(Action::Stop),
        KeyCode::Char('c') => Key::Act(Action::Resume),
        KeyCode::Char('q') => Key::Quit,
        _ => return None,
    })
}
