//! Screening: the decay of u in open space, in addition to that from the geometry.

/// Shortest screening length, in cells; it gives k = 1e6.
///
/// A cell with a shorter length is as good as blocked.
pub const MIN_SCREENING_CELLS: f64 = 5e-4;

/// Screening of a map: k = (h / (2 L))^2 for cells of side h.
#[derive(Clone, Debug, PartialEq)]
pub struct Screening {
    /// Screening length L, in the unit of `cell`; infinity gives Laplace's equation, k = 0.
    pub length: f64,
    /// Side h of a cell; 1 if `length` is in cells.
    pub cell: f64,
}

impl Screening {
    /// Creates a screening with `length` in cells.
    pub const fn cells(length: f64) -> Self {
        Self { length, cell: 1.0 }
    }

    /// Returns the coefficient k.
    pub(crate) fn coefficient(&self) -> f64 {
        (self.cell / (2.0 * self.length)).powi(2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn u_falls_by_a_factor_of_e_in_a_screening_length_on_any_grid() {
        // Along a line, 1 + 2 k = cosh(cell / length), nearly.
        for cells in [200, 1000] {
            let cell = 10.0 / f64::from(cells);
            let length = 0.5;
            let k = Screening { length, cell }.coefficient();
            let decay = (1.0 + 2.0 * k).acosh() / cell;
            assert!((decay * length - 1.0).abs() < 1e-3, "{decay} a metre");
        }
        assert_eq!(Screening::cells(f64::INFINITY).coefficient(), 0.0);
    }
}
