//! The mapper as a stage: what it records, publishes and persists.

use common::{
    grid::Part,
    mission::Mission,
    outputs::Outputs,
    shell::{Context, Progress},
    stage::{ForeignState, Stage},
    start::StageError,
    topics::{GRID, SCAN_FIX},
};
use serde::{Deserialize, Serialize};

use crate::step::{Belief, Change, Input, Mapper};

#[derive(Debug, Serialize, Deserialize)]
pub struct Start {
    belief: Option<Belief>,
    /// Oldest first, after the snapshot.
    inputs: Vec<Input>,
}

#[allow(clippy::large_enum_variant, reason = "there is one at a time, on the stack")]
#[derive(Debug, Serialize, Deserialize)]
pub enum Entry {
    Step(Input, Progress),
    /// The whole map is published although nothing changed.
    Again(Progress),
}

impl Stage for Mapper {
    type Start = Start;
    type Entry<'a> = Entry;
    type Outcome = Option<Part>;

    fn new(mission: &Mission) -> Self {
        Self::new(mission)
    }

    fn start(&self, context: &mut Context) -> Result<Start, StageError> {
        let saved = context.saved_journal(self.saved_bytes(), self.entry_bytes())?;
        Ok(Start { belief: saved.state, inputs: saved.entries })
    }

    fn begin(&mut self, start: Start) -> Result<(), ForeignState> {
        let restored = start.belief.map_or(Ok(()), |belief| self.restore(belief));
        for input in start.inputs {
            self.step(input, Progress::default().time);
        }
        // The last input's fix was published before.
        self.take_fix();
        restored
    }

    fn take_entry(&mut self, entry: Entry, out: &mut Outputs) -> Result<Option<Part>, StageError> {
        let change = match entry {
            Entry::Step(input, at) => {
                out.at = at;
                let change = self.step(input.clone(), at.time);
                // A belief that a fault made wrong is wrong in its journal, too.
                if change != Change::None || matches!(input, Input::Fault(_)) {
                    out.append(&input)?;
                }
                change
            }
            Entry::Again(at) => {
                out.at = at;
                Change::Whole
            }
        };
        if let Some(fix) = self.take_fix() {
            out.publish(&SCAN_FIX, fix)?;
        }
        let (frame, version) = (self.frame(), self.state().version());
        let part = match change {
            Change::None => return Ok(None),
            Change::Window(window) => Part::of(frame, window, version),
            Change::Whole => Part::whole(frame, version),
        };
        let (header, cells) = (self.header(part), self.state().cells());
        out.publish_slice(&GRID, header, &frame.cells_of(part.window(), cells))?;
        Ok(Some(part))
    }
}
