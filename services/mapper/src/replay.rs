//! The mapper without its process: the same step, fed with what it took.

use common::{
    grid::Part,
    replay::{Beginning, Output, Replay, ReplayError, entry},
    samples::GridHeader,
    shell::Progress,
    step::Step as _,
    topics,
};
use serde::{Deserialize, Serialize};

use crate::step::{Belief, Change, Input, Mapper};

/// What a generation starts from.
#[derive(Debug, Serialize)]
pub struct Start<'a> {
    /// The snapshot, if there was one.
    pub belief: Option<&'a Belief>,
    /// What was folded into it, oldest first.
    pub inputs: &'a [Input],
}

/// [`Start`], read.
#[derive(Deserialize)]
struct Started {
    belief: Option<Belief>,
    inputs: Vec<Input>,
}

/// What the mapper does, and at which tick.
#[derive(Debug, Serialize, Deserialize)]
pub enum Entry {
    /// The step takes this; what changed is published.
    Step(Input, Progress),
    /// The whole map is published although nothing changed.
    Again(Progress),
}

/// The `grid` sample of `part`.
pub(crate) fn sample_of(
    mapper: &Mapper,
    part: Part,
) -> (GridHeader, impl ExactSizeIterator<Item = u8> + '_) {
    let cells = mapper.state().cells();
    let cells = mapper.frame().cells_of(part.window(), cells);
    (mapper.header(part), cells)
}

struct Generation {
    mapper: Mapper,
}

/// Begin the replay of a generation.
///
/// # Errors
/// Those of [`common::replay::Begin`].
pub fn begin(beginning: Beginning<'_>) -> Result<Box<dyn Replay>, ReplayError> {
    let mut mapper = Mapper::new(&beginning.run.mission);
    let Started { belief, inputs } = entry(beginning.start)?;
    if let Some(belief) = belief {
        // The process went on without a foreign one, too.
        let _ = mapper.restore(belief);
    }
    for input in inputs {
        mapper.step(input, Progress::default().time);
    }
    Ok(Box::new(Generation { mapper }))
}

impl Replay for Generation {
    fn take(&mut self, body: &[u8]) -> Result<Vec<Output>, ReplayError> {
        let (change, at) = match entry(body)? {
            Entry::Step(input, at) => (self.mapper.step(input, at.time), at),
            Entry::Again(at) => (Change::Whole, at),
        };
        let (frame, version) = (self.mapper.frame(), self.mapper.state().version());
        let part = match change {
            Change::None => return Ok(Vec::new()),
            Change::Window(window) => Part::of(frame, window, version),
            Change::Whole => Part::whole(frame, version),
        };
        let (header, cells) = sample_of(&self.mapper, part);
        let cells: Vec<_> = cells.collect();
        let grid = Output::of_slice(&topics::GRID, at.tick, at.time, header, &cells);
        Ok(vec![grid])
    }

    fn describe(&self, body: &[u8]) -> Result<String, ReplayError> {
        Ok(format!("{:?}", entry::<Entry>(body)?))
    }
}
