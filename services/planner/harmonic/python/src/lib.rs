//! Python binding of the crate `firsthand-field`, documented in `harmonic_field.pyi`.
//!
//! A cell is (row, column), as in NumPy. A position or direction is (x, y), with x along columns.

use harmonic::{
    Cancellation, Cell, Change, Domain, Field as Solved, Guidance, Screening, Settings, Solver,
};
use numpy::{
    PyArray1, PyArray2, PyArray3, PyArrayMethods as _, PyReadonlyArray2, PyUntypedArrayMethods as _,
};
use pyo3::{
    create_exception,
    exceptions::{PyTypeError, PyValueError},
    prelude::*,
};
use std::{collections::HashMap, num::NonZeroUsize};

create_exception!(
    harmonic_field,
    SolveError,
    PyValueError,
    "A map is invalid, or its solve failed."
);

fn refused(error: harmonic::SolveError) -> PyErr {
    SolveError::new_err(error.to_string())
}

type Index = (usize, usize);

const fn cell((row, col): Index) -> Cell {
    Cell::new(col, row)
}

#[pyfunction]
#[pyo3(signature = (free, target, screening=None, *, threads=NonZeroUsize::MIN, memory_limit=2 << 30))]
fn solve(
    py: Python<'_>,
    free: &Bound<'_, PyAny>,
    target: Index,
    screening: Option<f64>,
    threads: NonZeroUsize,
    memory_limit: u64,
) -> PyResult<Field> {
    let free: PyReadonlyArray2<'_, bool> = free.extract().map_err(|_| {
        PyTypeError::new_err("free must be a two-dimensional NumPy array of bool, (rows, columns)")
    })?;
    let [height, width] = [free.shape()[0], free.shape()[1]];
    let blocked = free.as_array().iter().map(|free| !free).collect();
    let screening = Screening::cells(screening.unwrap_or(f64::INFINITY));
    py.detach(|| {
        let domain =
            Domain::new(width, height, blocked, cell(target))?.with_screening(&screening)?;
        let mut solver = Solver::new(Settings { threads, memory_limit });
        let solved = solver.solve(&domain, &Cancellation::new())?;
        Ok(Field { domain, solver, solved })
    })
    .map_err(refused)
}

#[pyclass(module = "harmonic_field")]
struct Field {
    domain: Domain,
    solver: Solver,
    solved: Solved,
}

#[pymethods]
impl Field {
    #[getter]
    fn shape(&self) -> Index {
        (self.solved.height(), self.solved.width())
    }

    #[getter]
    fn target(&self) -> Index {
        let Cell { col, row } = self.solved.target();
        (row, col)
    }

    fn guidance(&self, x: f64, y: f64) -> (&'static str, Option<(f64, f64)>) {
        match self.solved.guidance(x, y) {
            Guidance::Along(direction) => ("along", Some(direction.into())),
            Guidance::AtTarget => ("at_target", None),
            Guidance::WayOut(direction) => ("way_out", Some(direction.into())),
            Guidance::Unreachable => ("unreachable", None),
        }
    }

    fn direction(&self, x: f64, y: f64) -> Option<(f64, f64)> {
        self.guidance(x, y).1
    }

    fn directions<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let mut directions = Vec::with_capacity(2 * self.domain.blocked().len());
        for row in 0..self.solved.height() {
            self.solved.policy_of_row(row, |policy| directions.extend(policy.direction));
        }
        let (rows, columns) = self.shape();
        PyArray1::from_vec(py, directions).reshape([rows, columns, 2])
    }

    #[getter]
    fn u<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.each(py, |cell| self.solved.u(cell).relative_to(0))
    }

    #[getter]
    fn log10_u<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.each(py, |cell| self.solved.u(cell).log10())
    }

    fn path<'py>(&self, py: Python<'py>, start: Index) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let path = self.solved.path(cell(start)).ok_or_else(|| {
            let (row, column) = start;
            SolveError::new_err(format!(
                "no path leads from (row {row}, column {column}) to the target"
            ))
        })?;
        let steps = path.len();
        PyArray1::from_vec(py, path.into_flattened()).reshape([steps, 2])
    }

    #[getter]
    fn verification(&self) -> Verification {
        let found = self.solved.verification();
        Verification {
            worst_residual: found.worst_residual,
            worst_tile: found.worst_tile,
            method: found.method.name(),
            reachable: found.reachable,
        }
    }

    fn update(&mut self, py: Python<'_>, changes: HashMap<Index, bool>) -> PyResult<()> {
        let changed = |(at, free): (Index, bool)| Change { cell: cell(at), blocked: !free };
        let changes: Vec<_> = changes.into_iter().map(changed).collect();
        py.detach(|| {
            let mut domain = self.domain.clone();
            domain.apply(&changes)?;
            self.solved = self.solver.solve_near(&domain, &self.solved, &Cancellation::new())?;
            self.domain = domain;
            Ok(())
        })
        .map_err(refused)
    }

    fn __repr__(&self) -> String {
        let ((rows, columns), target) = (self.shape(), self.target());
        format!("Field({rows} rows x {columns} columns, target={target:?})")
    }
}

impl Field {
    fn each<'py>(
        &self,
        py: Python<'py>,
        value: impl Fn(Cell) -> f64,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let (rows, columns) = self.shape();
        let cells = (0..rows).flat_map(|row| (0..columns).map(move |col| Cell::new(col, row)));
        PyArray1::from_vec(py, cells.map(value).collect()).reshape([rows, columns])
    }
}

#[pyclass(module = "harmonic_field", frozen, get_all)]
struct Verification {
    worst_residual: f64,
    worst_tile: f64,
    method: &'static str,
    reachable: usize,
}

#[pymethods]
impl Verification {
    fn __repr__(&self) -> String {
        let Self { worst_residual, worst_tile, method, reachable } = self;
        format!(
            "Verification(worst_residual={worst_residual:.1e}, worst_tile={worst_tile:.1e}, method={method:?}, \
             reachable={reachable})"
        )
    }
}

#[pymodule(name = "harmonic_field")]
mod module {
    #[pymodule_export]
    use super::{Field, SolveError, Verification, solve};
}
