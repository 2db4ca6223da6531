/// Method that computed a field.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
#[non_exhaustive]
pub enum Method {
    /// Multifrontal factorisation by decreasing distance from the target, in extended range.
    Multifrontal,
    /// Multigrid in single precision.
    MultigridSingle,
    /// Multigrid in single precision, with multifrontal factorisation of the passages in which u is
    /// below its range.
    MultigridAndMultifrontal,
    /// Multigrid in double precision.
    ///
    /// It serves halls of some 3000 cells and more, and one map in a hundred of scattered
    /// obstacles. Both are too wide for the factorisation.
    MultigridDouble,
    /// Multigrid in single precision, in successive bands of u with an exponent each.
    MultigridBands,
}

impl Method {
    /// Returns the name of the method, for logs and reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Multifrontal => "multifrontal",
            Self::MultigridSingle => "multigrid f32",
            Self::MultigridAndMultifrontal => "multigrid f32, multifrontal",
            Self::MultigridDouble => "multigrid f64",
            Self::MultigridBands => "multigrid bands",
        }
    }
}
