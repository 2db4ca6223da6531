//! Single table of a robot's stages and deadlines. Each stage's crate declares its topics and
//! persisted state.
//!
//! Start order, deadlines, `firsthand stage`, `firsthand stage list` and the documentation's tables
//! derive from it.

use std::{path::Path, time::Duration};

use common::{
    bus::Bus,
    mission::Mission,
    replay::Begin,
    run::Run,
    shell::{Process, Simulated, run_stage, simulate},
    stage::{Answering, Answers, replay},
    start::{self, Generation, StageError, Start},
    wiring::Wiring,
};

pub struct Stage {
    pub name: &'static str,
    /// Topics that the process opens on the bus, and the state that it persists.
    pub wiring: &'static Wiring,
    /// Deadlines on a map without cells.
    pub deadlines: Deadlines,
    /// Addition to each deadline per million map cells.
    pub per_million_cells: Duration,
    pub while_down: &'static str,
    pub run: fn(&Start) -> Result<(), StageError>,
    pub simulate: fn(Generation, Run, Bus) -> start::Result<Box<dyn Simulated>>,
    pub replay: Begin,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Deadlines {
    pub startup: Duration,
    /// Maximum time between beats, which come every 150 ms or with a tick.
    ///
    /// Waiting for a processor does not count; a sleeping stage has four times as long: see
    /// [`Activity`](crate::activity::Activity).
    pub heartbeat: Duration,
    /// Maximum time from a tick on the inputs to the output of that tick or a later one.
    pub answers: Duration,
}

impl Stage {
    const fn new<P: Process + 'static>(replay: Begin, while_down: &'static str) -> Self {
        Self {
            name: P::WIRING.stage,
            wiring: P::WIRING,
            deadlines: DEADLINES,
            per_million_cells: Duration::ZERO,
            while_down,
            run: run_stage::<P>,
            simulate: simulate::<P>,
            replay,
        }
    }

    const fn answering<A: Answering>(while_down: &'static str) -> Self {
        Self::new::<Answers<A>>(replay::<A>, while_down)
    }

    /// `None` for `firsthand`'s own.
    pub fn executable<'mission>(&self, mission: &'mission Mission) -> Option<&'mission Path> {
        mission.planner.executable.as_deref().filter(|_| self.name == PLANNER)
    }

    pub fn deadlines_on(&self, cells: usize) -> Deadlines {
        assert!(self.deadlines.heartbeat < self.deadlines.answers);
        let more = self.per_million_cells.mul_f64(cells as f64 * 1e-6);
        Deadlines {
            startup: self.deadlines.startup + more,
            heartbeat: self.deadlines.heartbeat + more,
            answers: self.deadlines.answers + more,
        }
    }
}

const DEADLINES: Deadlines = Deadlines {
    // Time for a stage to open its topics, which incomplete services block. On a loaded machine of
    // two cores the slowest start took a tenth of it.
    startup: Duration::from_secs(3),
    // Five beats. A loaded machine with more stages than cores sometimes delays a beat by 200 ms.
    // With 500 ms during a build, three healthy stages were aborted in 70 missions. The link's stop
    // on a stale command is independent of this.
    heartbeat: Duration::from_millis(750),
    // The slowest answers take a hundredth of it.
    answers: Duration::from_secs(1),
};
/// The planner beats between solves, and leaves ticks unanswered while it solves.
const PLANNER_DEADLINES: Deadlines =
    Deadlines { heartbeat: Duration::from_secs(2), answers: Duration::from_secs(4), ..DEADLINES };
/// The mapper restores and publishes its whole map in one iteration. At 16.8 million cells no beat
/// was late even without this.
const MAPPER_MILLION_CELLS: Duration = Duration::from_millis(100);
/// A full solve, a keyframe of the field and the backlog may fall into one planner iteration.
///
/// At 16.8 million cells its beats paused for more than 2 s forty times in a mission; with this
/// allowance, never in a run of 97 s.
const PLANNER_MILLION_CELLS: Duration = Duration::from_millis(400);

/// Stage that gives guidance, for which a mission may name an executable.
pub const PLANNER: &str = "planner";

const STOPPED: &str = "stopped by the link when the command is stale";

/// All stages in pipeline order.
pub static TABLE: &[Stage] = &[
    Stage::new::<link::shell::Shell>(
        replay::<link::stage::LinkStage>,
        "stands when its timed command ends",
    ),
    Stage::answering::<dead_reckoning::DeadReckoning>(STOPPED),
    Stage {
        per_million_cells: MAPPER_MILLION_CELLS,
        ..Stage::new::<mapper::shell::Shell>(replay::<mapper::step::Mapper>, STOPPED)
    },
    Stage {
        deadlines: PLANNER_DEADLINES,
        per_million_cells: PLANNER_MILLION_CELLS,
        ..Stage::new::<planner::shell::Shell>(replay::<planner::stage::PlannerStage>, STOPPED)
    },
    Stage::answering::<controller::Controller>(STOPPED),
];

pub fn find(name: &str) -> Option<&'static Stage> {
    TABLE.iter().find(|stage| stage.name == name)
}

pub fn unknown(name: &str) -> String {
    let names = TABLE.iter().map(|stage| stage.name).collect::<Vec<_>>().join(", ");
    format!("no stage is called {name:?}; the stages are {names}")
}

/// Each after the writers of its inputs. They stop in reverse order.
pub fn start_order() -> Vec<&'static Stage> {
    let mut order: Vec<&'static Stage> = Vec::with_capacity(TABLE.len());
    while order.len() < TABLE.len() {
        let waiting: Vec<&'static Stage> = TABLE
            .iter()
            .filter(|stage| !order.iter().any(|placed| placed.name == stage.name))
            .collect();
        let next = waiting.iter().find(|stage| {
            stage.wiring.inputs.iter().all(|input| {
                let writer = input.spec().writer;
                !waiting.iter().any(|other| other.name == writer)
            })
        });
        // In a circle of inputs, the remaining stages start in the table's order.
        order.extend(next.or(waiting.first()));
    }
    assert_eq!(order[0].name, common::topics::LINK.spec().writer);
    order
}

#[cfg(test)]
mod tests {
    use super::*;
    use common::topics::{self, EVERY_STAGE, OPERATOR, SUPERVISOR};

    #[test]
    fn every_input_has_a_writer_and_every_topic_is_an_output_of_the_stage_it_names() {
        let no_stage = [SUPERVISOR, OPERATOR, EVERY_STAGE];
        for stage in TABLE {
            for input in stage.wiring.inputs.iter().chain(stage.wiring.feedback) {
                let (name, writer) = (input.spec().name, input.spec().writer);
                assert!(no_stage.contains(&writer) || find(writer).is_some(), "{name}");
            }
            for output in stage.wiring.outputs {
                assert_eq!(output.spec().writer, stage.name, "{}", output.spec().name);
            }
        }
        let written = topics::TABLE.iter().map(|topic| topic.spec());
        for spec in written.filter(|spec| !no_stage.contains(&spec.writer)) {
            let mut outputs = find(spec.writer).unwrap().wiring.outputs.iter();
            assert!(outputs.any(|output| output.spec().name == spec.name), "{}", spec.name);
        }
    }

    #[test]
    fn a_stage_starts_after_the_writers_of_its_inputs() {
        let names: Vec<_> = start_order().iter().map(|stage| stage.name).collect();
        let place = |name: &str| names.iter().position(|placed| *placed == name);
        for stage in TABLE {
            for input in stage.wiring.inputs {
                if let Some(writer) = place(input.spec().writer) {
                    assert!(Some(writer) < place(stage.name), "{names:?}");
                }
            }
        }
        assert_eq!(names.len(), TABLE.len());
    }
}
