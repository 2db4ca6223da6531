//! Tests of `firsthand top` on a pseudo-terminal.

use std::{
    fs::File,
    io::{Read as _, Write as _},
    os::fd::OwnedFd,
    process::Child,
    time::Instant,
};

use rustix::{
    process::Signal,
    pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt},
    termios::{Winsize, tcsetwinsize},
};
use serde_json::Value;

use crate::support::{
    PATIENCE, Run, all_run, firsthand_under, generation, refused, signal_process,
};

/// Lines and columns of the terminal.
const SIZE: (usize, usize) = (24, 80);

/// `firsthand top` on its own terminal. It ends with the test.
struct Screen {
    child: Child,
    terminal: Option<File>,
    /// Bytes written to the terminal.
    written: Vec<u8>,
}

/// Renders `written` on a screen: each letter at the cursor position, without colours.
fn shown(written: &[u8]) -> String {
    let mut letters = vec![vec![' '; SIZE.1]; SIZE.0];
    let (mut row, mut col) = (0, 0);
    let text = String::from_utf8_lossy(written);
    // A code ends with its letter. The last one may be incomplete.
    for part in text.trim_end_matches('\x1b').split("\x1b[") {
        let Some(end) = part.find(|letter: char| letter.is_ascii_alphabetic()) else { continue };
        let (numbers, shown) = (&part[..end], &part[end + 1..]);
        // This sequence moves the cursor. The others are colours and modes.
        if part[end..].starts_with('H')
            && let Some((line, column)) = numbers.split_once(';')
        {
            row = line.parse::<usize>().unwrap() - 1;
            col = column.parse::<usize>().unwrap() - 1;
        }
        for letter in shown.chars() {
            assert_ne!(letter, '\x1b', "no code of this kind is known");
            if let Some(place) = letters.get_mut(row).and_then(|line| line.get_mut(col)) {
                *place = letter;
            }
            col += 1;
        }
    }
    let lines = letters.into_iter().map(|line| line.into_iter().collect::<String>());
    lines.collect::<Vec<_>>().join("\n")
}

impl Screen {
    fn start(robot: &str) -> Self {
        let terminal: OwnedFd =
            openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC).unwrap();
        grantpt(&terminal).unwrap();
        unlockpt(&terminal).unwrap();
        let size =
            Winsize { ws_row: SIZE.0 as u16, ws_col: SIZE.1 as u16, ws_xpixel: 0, ws_ypixel: 0 };
        tcsetwinsize(&terminal, size).unwrap();
        let name = ptsname(&terminal, Vec::new()).unwrap().into_string().unwrap();
        let its = || File::options().read(true).write(true).open(&name).unwrap();
        // The terminal is the command's controlling terminal, as in a shell.
        let child = firsthand_under(&["setsid", "--ctty"], &["top", "--robot", robot])
            .stdin(its())
            .stdout(its())
            .stderr(its())
            .spawn()
            .unwrap();
        Self { child, terminal: Some(terminal.into()), written: Vec::new() }
    }

    /// Reads output until the screen shows `text`.
    fn wait_for(&mut self, text: &str) {
        let began = Instant::now();
        while !shown(&self.written).contains(text) {
            let so_far = shown(&self.written);
            assert!(began.elapsed() < PATIENCE, "no {text:?} on\n{so_far}");
            assert!(self.read(), "top has ended:\n{so_far}");
        }
    }

    /// Reads some output. Returns whether there was any. A terminal without open handles gives an
    /// error.
    fn read(&mut self) -> bool {
        let mut some = [0; 4096];
        let Some(Ok(read)) = self.terminal.as_mut().map(|it| it.read(&mut some)) else {
            return false;
        };
        self.written.extend_from_slice(&some[..read]);
        read > 0
    }

    fn press(&mut self, keys: &str) {
        let terminal = self.terminal.as_mut().unwrap();
        terminal.write_all(keys.as_bytes()).unwrap();
    }

    /// Waits for the end. Returns exit code and all output.
    fn end(&mut self) -> (Option<i32>, String) {
        while self.read() {}
        let code = self.child.wait().unwrap().code();
        (code, String::from_utf8_lossy(&self.written).into_owned())
    }
}

#[test]
fn top_does_what_its_keys_say_ends_with_its_terminal_and_on_a_signal_and_the_mission_arrives() {
    let robot = "con-top";
    let mut screen = Screen::start(robot);
    screen.wait_for("is not running here");
    // The robot stands while the other keys are pressed, so it cannot arrive earlier.
    let slow = "--pace 2 --timeout 600 --set controller.speed_m_s=0.2";
    let mut run = Run::start(robot, "obstacle-course", slow);
    screen.wait_for("driving");
    screen.wait_for("dead-reckoning");
    screen.wait_for("perimeter");
    run.wait_until_under_way(1.0);
    screen.press("s");
    screen.wait_for("stop: done");
    run.wait_until("it stands", |status| status["order"] == "stopped by an operator");
    let mut closed = Screen::start(robot);
    closed.wait_for("controller");
    closed.terminal = None;
    assert_eq!(closed.end().0, Some(0));
    let mut signalled = Screen::start(robot);
    signalled.wait_for("controller");
    signal_process(signalled.child.id(), Signal::TERM);
    let (code, written) = signalled.end();
    assert_eq!(code, Some(0), "{written:?}");
    assert!(written.contains("\x1b[?1049l"), "{written:?}");
    refused(&["top", "--robot", robot], "no-terminal", &["firsthand status"]);
    // The planner is the fourth stage.
    screen.press("\x1b[B\x1b[B\x1b[Bk");
    screen.wait_for("kill planner: done");
    let is_generation = |least: u64| {
        move |status: &Value| generation(status, "planner") >= least && all_run(status)
    };
    run.wait_until("it is replaced", is_generation(2));
    let deaths = run.records("deaths.jsonl");
    let killed = deaths.iter().any(|death| {
        let by_signal = death["cause"]["signalled"]["signal"] == 9 && death["hung"] == false;
        death["stage"] == "planner" && by_signal
    });
    assert!(killed, "{deaths:?}");
    screen.wait_for("signal 9");
    screen.press("r");
    screen.wait_for("restart planner: done");
    run.wait_until("it has a process again", is_generation(3));
    screen.press("f");
    screen.wait_for("freeze planner: done");
    screen.press("c");
    screen.wait_for("resume: done");
    screen.press("q");
    let (code, written) = screen.end();
    assert_eq!(code, Some(0), "{written:?}");
    // The terminal returns to its first screen and cursor.
    for restored in ["\x1b[?1049l", "\x1b[?25h"] {
        assert!(written.contains(restored), "{written:?}");
    }
    run.arrives();
}
