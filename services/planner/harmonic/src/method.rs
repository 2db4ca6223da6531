//! The methods a field can be computed by.

/// The method by which a field was computed.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
#[non_exhaustive]
pub enum Method {
    /// Multifrontal factorisation in order of decreasing distance from the target, in extended range.
    Multifrontal,
    /// Multigrid in single precision.
    MultigridSingle,
    /// Multigrid in single precision, and multifrontal factorisation of the passages in which u is below its range.
    MultigridAndMultifrontal,
    /// Multigrid in double precision: for halls of some 3000 cells and more, and one map in a hundred of scattered obstacles, both
    /// too wide to be factorised.
    MultigridDouble,
    /// Multigrid in single precision, one band of u after the other, each with an exponent of its own.
    MultigridBands,
}

impl Method {
    /// The method's name, for logs and reports.
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
