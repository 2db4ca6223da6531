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
}

impl Screening {
    /// The same screening length for all cells, in cells; infinite for no screening.
    pub const fn cells(length: f64) -> Self {
        Self::Uniform { length, cell: 1.0 }
    }

    /// The coefficient k.
    pub(crate) fn coefficient(&self) -> f64 {
        match self {
            Self::None => 0.0,
            Self::Uniform { length, cell } => (cell / (2.0 * length)).powi(2),
        }
    }
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
            let k = Screening::Uniform { length, cell }.coefficient();
            let decay = (1.0 + 2.0 * k).acosh() / cell;
            assert!((decay * length - 1.0).abs() < 1e-3, "{decay} a metre");
        }
        assert_eq!(Screening::None.coefficient(), 0.0);
        assert_eq!(Screening::cells(f64::INFINITY).coefficient(), 0.0);
    }
}
