//! A map, its field and its updates, for the tests of updates.
#![allow(dead_code, reason = "each test file uses a part")]

use harmonic::testing::{Map, Random};
use harmonic::{Cancellation, Cell, Change, Domain, Field, Settings, Solver, Verdict};

/// A solver that updates in windows on maps of any size.
pub(crate) fn in_windows() -> Solver {
    Solver::new(Settings {
        whole_up_to: 0,
        ..Settings::default()
    })
}

/// A map whose field is kept up to date.
pub(crate) struct Case {
    pub(crate) solver: Solver,
    /// For full solves to compare with.
    pub(crate) reference: Solver,
    pub(crate) domain: Domain,
    pub(crate) field: Field,
}

impl Case {
    pub(crate) fn new(map: &Map) -> Self {
        Self::with(in_windows(), map)
    }

    pub(crate) fn with(mut solver: Solver, map: &Map) -> Self {
        let domain = map.domain().expect("a valid map");
        let field = solver
            .solve(&domain, &Cancellation::new())
            .expect("the map has a field");
        Self {
            solver,
            reference: Solver::default(),
            domain,
            field,
        }
    }

    pub(crate) fn update(&mut self, changes: &[Change]) -> Verdict {
        self.solver
            .update(
                &mut self.domain,
                &mut self.field,
                changes,
                &Cancellation::new(),
            )
            .expect("a valid update")
    }

    pub(crate) fn full(&mut self) -> Field {
        self.reference
            .solve(&self.domain, &Cancellation::new())
            .expect("the map has a field")
    }

    /// Sets a square of cells but the target, as far as it lies inside the map's rim.
    pub(crate) fn square(&self, col: usize, row: usize, side: usize, blocked: bool) -> Vec<Change> {
        let (right, bottom) = (self.domain.width() - 1, self.domain.height() - 1);
        let cells = (row.max(1)..(row + side).min(bottom)).flat_map(|row| {
            (col.max(1)..(col + side).min(right)).map(move |col| Cell::new(col, row))
        });
        cells
            .filter(|&cell| cell != self.domain.target())
            .map(|cell| Change { cell, blocked })
            .collect()
    }

    /// A square of up to five cells a side anywhere, more often put down than taken away.
    pub(crate) fn random_square(&self, random: &mut Random) -> Vec<Change> {
        let at = (
            random.below(self.domain.width()),
            random.below(self.domain.height()),
        );
        self.square(at.0, at.1, 1 + random.below(5), random.unit() < 0.6)
    }

    /// Whether the field is blocked where the map is, and nowhere else.
    pub(crate) fn knows_the_map(&self) -> bool {
        let width = self.domain.width();
        let cell = |index: usize| Cell::new(index % width, index / width);
        let mut map = self.domain.blocked().iter().enumerate();
        map.all(|(index, &blocked)| self.field.is_blocked(cell(index)) == blocked)
    }
}
