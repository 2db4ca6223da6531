//! Acceptance of commands and orders: the link takes orders from its supervisor only, and commands from the controller that the
//! supervisor started.

use common::{
    bus::{Author, BusError, Ignored, Reader, SliceReader},
    samples::{CommandSample, RosterEntry, RosterHeader, name_str},
    shell::{Context, StageError},
    topics::{self, AnyTopic as _},
};

/// The roster, and the samples of other writers that were ignored.
#[derive(Debug)]
pub(crate) struct Writers {
    roster: SliceReader<RosterHeader, RosterEntry>,
    ignored: Ignored,
}

impl Writers {
    /// Follow the roster. No command is accepted until the roster names the controller.
    pub(crate) fn open(
        context: &mut Context,
        command: &mut Reader<CommandSample>,
    ) -> Result<Self, StageError> {
        command.follow(Author { process: 0, generation: 0 });
        Ok(Self { roster: context.slice_reader(&topics::ROSTER)?, ignored: Ignored::default() })
    }

    /// Make `command` return only samples of the controller that the roster names.
    pub(crate) fn follow(&mut self, command: &mut Reader<CommandSample>) -> Result<(), BusError> {
        while let Some(entries) = self.roster.take()? {
            let writer = topics::COMMAND.spec().writer;
            let mut entries = entries.iter();
            let named = entries.find(|entry| name_str(&entry.stage) == writer);
            if let Some(entry) = named.filter(|entry| entry.pid != 0) {
                command.follow(Author { process: entry.pid, generation: entry.generation });
            }
        }
        Ok(())
    }

    /// Add up the ignored samples of all topics, and warn of each new process among their writers.
    pub(crate) fn tell(&mut self, ignored: [Ignored; 3]) -> Ignored {
        let samples = ignored.iter().map(|topic| topic.samples).sum();
        let changed = samples != self.ignored.samples;
        let last = ignored
            .iter()
            .find(|topic| topic.process != 0 && (changed && topic.process != self.ignored.process));
        if let Some(last) = last {
            tracing::warn!(
                pid = last.process,
                "a process that is neither the controller nor the supervisor writes commands or orders; they are ignored; end it"
            );
            self.ignored.process = last.process;
        }
        self.ignored.samples = samples;
        self.ignored
    }
}
