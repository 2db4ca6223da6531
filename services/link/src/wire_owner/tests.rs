//! All histories of processes, wires and rest, up to a depth.

use std::collections::HashSet;

use super::*;

const DEPTH: usize = 9;

#[derive(Clone, Copy, Debug)]
enum Happens {
    Drives,
    LinkEnds,
    LinkStarts,
    GuardIsKilled,
    /// Whether commands reach the robot.
    Commands(bool),
    /// Whether frames reach the host.
    Frames(bool),
    SignedOff,
}
use Happens::*;

const ALL: [Happens; 9] = [
    Drives,
    LinkEnds,
    LinkStarts,
    GuardIsKilled,
    Commands(true),
    Commands(false),
    Frames(true),
    Frames(false),
    SignedOff,
];

#[derive(Clone, Copy, Default, PartialEq, Eq, Hash)]
struct World {
    link: bool,
    guard: bool,
    mark: bool,
    moves: bool,
    commands: bool,
    frames: bool,
    /// Motion was ordered, without rest or sign-off since.
    due: bool,
}

impl World {
    fn happen(&mut self, what: Happens) {
        match what {
            Drives if self.link => {
                self.mark = is_owed(self.mark, true, false);
                self.moves |= self.commands;
                self.due = true;
            }
            LinkEnds => self.link = false,
            LinkStarts => self.link = true,
            // A killed guard leaves the mark, and `firsthand stop` starts another.
            GuardIsKilled if self.link => self.guard = false,
            Commands(pass) => self.commands = pass,
            Frames(pass) => self.frames = pass,
            SignedOff if !self.link => self.settle(true),
            _ => {}
        }
        self.settle(false);
        if !matches!(what, Drives) {
            self.stop();
        }
        self.settle(false);
    }

    /// Lets the guard take its role, and a link replace a missing guard.
    fn settle(&mut self, is_signed_off: bool) {
        self.guard |= self.link;
        let found = Found {
            link_lives: self.link,
            is_owed: self.mark,
            is_succeeded: false,
            is_signed_off,
            is_robot_gone: false,
        };
        if self.guard && found.role() == Role::Leaves {
            self.guard = false;
            // The guard leaves for one of these.
            self.mark &= !is_signed_off;
            self.due &= !is_signed_off;
        }
    }

    /// Orders the stop, if a process can, and checks the encoders.
    fn stop(&mut self) {
        if !self.link && !self.guard {
            return;
        }
        self.moves &= !self.commands;
        let rests = self.frames && !self.moves;
        self.due &= !rests;
        self.mark = is_owed(self.mark, false, rests);
    }
}

#[test]
fn no_history_leaves_a_robot_that_may_move_without_a_process_that_orders_the_stop() {
    let first = World { link: true, guard: true, commands: true, frames: true, ..World::default() };
    let (mut seen, mut newest) = (HashSet::from([first]), vec![(first, Vec::new())]);
    for _ in 0..DEPTH {
        for (world, history) in std::mem::take(&mut newest) {
            for what in ALL {
                let (mut world, mut history) = (world, history.clone());
                world.happen(what);
                history.push(what);
                assert!(!world.due || world.link || world.guard, "abandoned: {history:?}");
                assert!(world.due || world.link || !world.guard, "a guard lingers: {history:?}");
                if seen.insert(world) {
                    newest.push((world, history));
                }
            }
        }
    }
    assert!(newest.is_empty() && seen.len() > 20);
}
