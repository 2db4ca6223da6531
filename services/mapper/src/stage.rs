//! Mapper as a stage: its records, publications and saved state.

use common::{
    grid::Part,
    journal::Restored,
    mission::Mission,
    outputs::Outputs,
    shell::{Context, Progress},
    stage::{ForeignState, Stage},
    start::Result,
    topics::{GRID, SCAN_FIX},
};
use serde::{Deserialize, Serialize};

use crate::step::{Belief, Change, Input, Mapper};

#[allow(clippy::large_enum_variant, reason = "there is one at a time, on the stack")]
#[derive(Debug, Serialize, Deserialize)]
pub enum Entry {
    Step(Input, Progress),
    /// Publication of the whole, unchanged map.
    Again(Progress),
}

impl Stage for Mapper {
    type Start = Restored<Belief, Input>;
    type Entry<'a> = Entry;
    type Outcome = Option<Part>;

    fn new(mission: &Mission) -> Self {
        Self::new(mission)
    }

    fn start(&self, context: &mut Context) -> Result<Self::Start> {
        context.saved_journal(self.saved_bytes(), self.entry_bytes())
    }

    fn begin(&mut self, start: Self::Start) -> Result<(), ForeignState> {
        let restored = start.state.map_or(Ok(()), |belief| self.restore(belief));
        for input in start.entries {
            self.step(input, Progress::default().time);
        }
        // The last input's fix was already published.
        self.take_fix();
        restored
    }

    fn take_entry(&mut self, entry: Entry, out: &mut Outputs) -> Result<Option<Part>> {
        let change = match entry {
            Entry::Step(input, at) => {
                out.at = at;
                let change = self.step(input.clone(), at.time);
                // The journal also holds faults, which change later beliefs.
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
        let frame = self.frame();
        let version = self.state().version;
        let part = match change {
            Change::None => return Ok(None),
            Change::Window(window) => Part::of(frame, window, version),
            Change::Whole => Part::whole(frame, version),
        };
        assert!(frame.contains(part.window()));
        let cells = frame.cells_of(part.window(), &self.state().cells);
        out.publish_slice(&GRID, self.header(part), &cells)?;
        Ok(Some(part))
    }
}
