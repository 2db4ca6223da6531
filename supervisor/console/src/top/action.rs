//! What the keys do.

use common::domain::RobotName;

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

/// Takes the keys out of `typed`, what a terminal in raw mode sent. The beginning of a key whose rest has not come stays.
pub(super) fn take_keys(typed: &mut Vec<u8>) -> Vec<Key> {
    let mut keys = Vec::new();
    let mut rest = &typed[..];
    loop {
        rest = match rest {
            // A key that sends a sequence: its last byte is a letter or `~`.
            [ESCAPE, b'[' | b'O', sequence @ ..] => {
                let Some(last) = sequence
                    .iter()
                    .position(|byte| (b'@'..=b'~').contains(byte))
                else {
                    break;
                };
                match sequence[last] {
                    b'A' => keys.push(Key::Up),
                    b'B' => keys.push(Key::Down),
                    _ => {}
                }
                &sequence[last + 1..]
            }
            [] | [ESCAPE] => break,
            [byte, others @ ..] => {
                keys.extend(meaning(*byte));
                others
            }
        };
    }
    let left = rest.len();
    typed.drain(..typed.len() - left);
    if left > LONGEST_SEQUENCE {
        typed.clear();
    }
    keys
}

const ESCAPE: u8 = 0x1b;
/// Ctrl-C, which a terminal in raw mode sends as a byte.
const CONTROL_C: u8 = 0x03;
/// No key sends so many bytes.
const LONGEST_SEQUENCE: usize = 32;

/// What a letter means; none for any other.
const fn meaning(letter: u8) -> Option<Key> {
    Some(match letter {
        b'k' => Key::Act(Action::Kill),
        b'f' => Key::Act(Action::Freeze),
        b't' => Key::Act(Action::Thaw),
        b'r' => Key::Act(Action::Restart),
        b's' => Key::Act(Action::Stop),
        b'c' => Key::Act(Action::Resume),
        b'q' | CONTROL_C => Key::Quit,
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_are_understood_however_their_bytes_come() {
        let mut typed = b"\x1b[B\x1bOA\x1b[3~xk\x1b".to_vec();
        let keys = [Key::Down, Key::Up, Key::Act(Action::Kill)];
        assert_eq!(take_keys(&mut typed), keys);
        assert_eq!(typed, [ESCAPE], "the rest may come");
        typed.extend(b"[1;5");
        assert_eq!(take_keys(&mut typed), []);
        typed.extend(b"B\x03");
        assert_eq!(take_keys(&mut typed), [Key::Down, Key::Quit]);
        typed.extend([ESCAPE, b'[']);
        typed.extend([b'1'; 100]);
        assert_eq!(take_keys(&mut typed), []);
        assert!(typed.is_empty(), "what is no key is not kept");
    }
}
