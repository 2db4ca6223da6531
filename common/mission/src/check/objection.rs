pub(super) struct Objection {
    pub(super) key: &'static str,
    pub(super) problem: String,
    pub(super) remedy: String,
}

pub(super) fn objection(
    key: &'static str,
    problem: impl Into<String>,
    remedy: impl Into<String>,
) -> Objection {
    Objection { key, problem: problem.into(), remedy: remedy.into() }
}

/// `value` must lie in `range`; NaN lies in none.
pub(super) fn within(
    key: &'static str,
    value: f64,
    range: std::ops::RangeInclusive<f64>,
    unit: &str,
) -> Result<(), Objection> {
    if range.contains(&value) {
        return Ok(());
    }
    Err(objection(
        key,
        format!("{value} {unit} is out of range"),
        format!("give {} to {} {unit}", range.start(), range.end()),
    ))
}
