//! Background solver: it solves the newest map while the robot follows the previous field.

use std::{io, sync::Arc};

use common::clock::Instant;
use harmonic::{Cancellation, Field, Solver};

use crate::{
    background::Background,
    step::{Job, Solved},
};

#[derive(Default)]
pub(crate) struct Worker {
    solver: Solver,
    cancellation: Cancellation,
    last: Option<Arc<Field>>,
}

impl Worker {
    pub(crate) fn on_a_thread() -> io::Result<Background<Job, Solved>> {
        let mut worker = Self::default();
        let cancellation = worker.cancellation.clone();
        Background::start("full-solve", cancellation, move |job| worker.solve(job))
    }

    pub(crate) fn solve(&mut self, Job { number, domain }: Job) -> Solved {
        let began = Instant::now();
        let field = match &self.last {
            Some(near) => self.solver.solve_near(&domain, near, &self.cancellation),
            None => self.solver.solve(&domain, &self.cancellation),
        };
        let field = field.map(Arc::new);
        self.last = field.as_ref().ok().cloned();
        Solved { number, field, took_ns: began.elapsed().as_nanos() as u64 }
    }
}
