//! Screening: the decay of u in open space.
//!
//! The screened equation is laplacian u = u / L^2; L, the screening length, is the distance in which u falls by a factor of
//! e besides what the geometry takes. On cells of side h its five-point form is u = (mean of the four neighbours) / (1 + k)
//! with the screening coefficient k = (h / (2 L))^2.

/// Shortest screening length, in cells, at which k = 1e6. A cell with a shorter one is as good as blocked.
pub const MIN_SCREENING_CELLS: f64 = 5e-4;

/// The screening of a map.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Screening {
    /// There is no screening: Laplace's equation.
    #[default]
    None,
    /// All cells have the same screening length.
    Uniform {
        /// The screening length, in the unit of `cell`.
        length: f64,
        /// The side of a cell; 1 where lengths are in cells.
        cell: f64,
    },
    /// Each cell has its screening length, in cells, row-major; infinite for no screening.
    PerCell(Vec<f32>),
}

impl Screening {
    /// The same screening length for all cells, in cells; infinite for no screening.
    pub const fn cells(length: f64) -> Self {
        Self::Uniform { length, cell: 1.0 }
    }
}

/// The screening coefficients k of a map.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Coefficients {
    /// The k of all cells.
    Uniform(f64),
    /// The k of each cell, row-major.
    PerCell(Vec<f32>),
}

impl Coefficients {
    /// No screening.
    pub(crate) const NONE: Self = Self::Uniform(0.0);

    /// The coefficients of valid lengths.
    pub(crate) fn of(screening: &Screening) -> Self {
        match screening {
            Screening::None => Self::NONE,
            Screening::Uniform { length, cell } => Self::Uniform(coefficient(*length, *cell)),
            Screening::PerCell(lengths) => {
                let k = lengths.iter().map(|&length| coefficient(f64::from(length), 1.0) as f32);
                Self::PerCell(k.collect())
            }
        }
    }

    /// k of the cell with row-major `index`, 0 beyond the map.
    pub(crate) fn at(&self, index: usize) -> f64 {
        match self {
            Self::Uniform(k) => *k,
            Self::PerCell(cells) => cells.get(index).copied().map_or(0.0, f64::from),
        }
    }

    /// The smallest k of any cell.
    pub(crate) fn least(&self) -> f64 {
        match self {
            Self::Uniform(k) => *k,
            Self::PerCell(cells) => f64::from(cells.iter().copied().fold(f32::INFINITY, f32::min)),
        }
    }
}

/// k of a screening length; `cell` is the side of a cell in the same unit.
fn coefficient(length: f64, cell: f64) -> f64 {
    (cell / (2.0 * length)).powi(2)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn u_falls_by_a_factor_of_e_in_a_screening_length_on_any_grid() {
        // Along a line 1 + 2 k = cosh(cell / length), nearly.
        for cells in [200, 1000] {
            let cell = 10.0 / f64::from(cells);
            let length = 0.5;
            let k = Coefficients::of(&Screening::Uniform { length, cell }).at(0);
            let decay = (1.0 + 2.0 * k).acosh() / cell;
            assert!((decay * length - 1.0).abs() < 1e-3, "{decay} a metre");
        }
        assert_eq!(Coefficients::of(&Screening::None).at(0), 0.0);
        assert_eq!(Coefficients::of(&Screening::cells(f64::INFINITY)).at(0), 0.0);
    }
}
