pub(super) type Result<T = (), E = Objection> = std::result::Result<T, E>;

pub(super) struct Objection {
    pub key: &'static str,
    pub problem: String,
    pub remedy: String,
}

pub(super) fn objection(
    key: &'static str,
    problem: impl Into<String>,
    remedy: impl Into<String>,
) -> Objection {
    Objection { key, problem: problem.into(), remedy: remedy.into() }
}

pub(super) fn refuse_if(
    wrong: bool,
    key: &'static str,
    problem: impl Into<String>,
    remedy: impl Into<String>,
) -> Result {
    if wrong { Err(objection(key, problem, remedy)) } else { Ok(()) }
}

pub(super) fn all_within<const N: usize>(
    limits: [(&'static str, f64, std::ops::RangeInclusive<f64>, &str); N],
) -> Result {
    limits.into_iter().try_for_each(|(key, value, range, unit)| within(key, value, range, unit))
}

/// Requires `value` in `range`, which rejects NaN.
pub(super) fn within(
    key: &'static str,
    value: f64,
    range: std::ops::RangeInclusive<f64>,
    unit: &str,
) -> Result {
    let problem = format!("{value} {unit} is out of range");
    let remedy = format!("give {} to {} {unit}", range.start(), range.end());
    refuse_if(!range.contains(&value), key, problem, remedy)
}
