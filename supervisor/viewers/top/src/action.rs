use std::thread::{self, JoinHandle};

use common::domain::RobotName;
use mission_control::operator as requests;
use rustix::process::Signal;

use console::operator;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action {
    Kill,
    Freeze,
    Thaw,
    Restart,
    Stop,
    Resume,
}

impl Action {
    fn name(self) -> &'static str {
        KEYS.iter().find(|(_, _, key)| *key == Key::Act(self)).map_or("", |(_, name, _)| name)
    }

    fn perform(self, robot: &RobotName, stage: &str) -> Result<(), String> {
        let done = match self {
            Self::Kill => operator::send(robot, stage, Signal::KILL),
            Self::Freeze => operator::send(robot, stage, Signal::STOP),
            Self::Thaw => operator::send(robot, stage, Signal::CONT),
            Self::Restart => requests::restart(robot, stage).map_err(Into::into),
            Self::Stop => operator::stand(robot),
            Self::Resume => requests::resume(robot).map_err(Into::into),
        };
        done.map_err(|error| error.to_string())
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Key {
    Up,
    Down,
    Act(Action),
    Quit,
}

/// Keys: text in the last screen line, effect and meaning.
pub const KEYS: [(&str, &str, Key); 8] = [
    ("↑↓", "choose", Key::Down),
    ("k", "kill", Key::Act(Action::Kill)),
    ("f", "freeze", Key::Act(Action::Freeze)),
    ("t", "thaw", Key::Act(Action::Thaw)),
    ("r", "restart", Key::Act(Action::Restart)),
    ("s", "stop", Key::Act(Action::Stop)),
    ("c", "resume", Key::Act(Action::Resume)),
    ("q", "quit", Key::Quit),
];

/// Takes keys out of `typed`, the bytes of a raw terminal. An incomplete key stays there.
pub fn take_keys(typed: &mut Vec<u8>) -> Vec<Key> {
    let mut keys = Vec::new();
    let mut rest = &typed[..];
    loop {
        rest = match rest {
            // An escape sequence ends with a letter or `~`.
            [ESCAPE, b'[' | b'O', sequence @ ..] => {
                let Some(last) = sequence.iter().position(|byte| (b'@'..=b'~').contains(byte))
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
/// Ctrl-C, which a raw terminal sends as a byte.
const CONTROL_C: u8 = 0x03;
const LONGEST_SEQUENCE: usize = 32;

fn meaning(letter: u8) -> Option<Key> {
    let row = KEYS.iter().find(|(key, ..)| key.as_bytes() == [letter]);
    if letter == CONTROL_C { Some(Key::Quit) } else { row.map(|(.., key)| *key) }
}

/// Executor of one action at a time. A thread waits, because a stop lasts until rest.
pub struct Operator {
    robot: RobotName,
    /// Thread that gives the text to show.
    under_way: Option<JoinHandle<String>>,
}

impl Operator {
    pub fn new(robot: &RobotName) -> Self {
        Self { robot: robot.clone(), under_way: None }
    }

    /// Returns the text to show meanwhile.
    pub fn ask(&mut self, action: Action, stage: Option<&str>) -> String {
        if self.under_way.is_some() {
            return "the last action is still under way".to_owned();
        }
        let stage = match (action, stage) {
            (Action::Stop | Action::Resume, _) => String::new(),
            (_, Some(stage)) => stage.to_owned(),
            (_, None) => return "no stage is known yet".to_owned(),
        };
        let asked = format!("{} {stage}", action.name()).trim_end().to_owned();
        let (robot, name) = (self.robot.clone(), asked.clone());
        self.under_way = Some(thread::spawn(move || match action.perform(&robot, &stage) {
            Ok(()) => format!("{name}: done"),
            Err(problem) => format!("{name}: {problem}"),
        }));
        format!("{asked} ...")
    }

    pub fn answer(&mut self) -> Option<String> {
        let thread = self.under_way.take_if(|thread| thread.is_finished())?;
        Some(thread.join().unwrap_or_else(|_| "failed".to_owned()))
    }
}

/// Waits for an action under way, so that it leaves the bus in order.
impl Drop for Operator {
    fn drop(&mut self) {
        if let Some(thread) = self.under_way.take() {
            let _ = thread.join();
        }
    }
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
        assert!(typed.is_empty(), "unknown bytes stay");
    }
}
