//! Normal of a wall from the echoes of a sweep.

use serde::{Deserialize, Serialize};

/// Distances from the median range within which an echo belongs to the wall. If a rough wall
/// answers over the whole sweep, the next limit omits its ends.
const WITHIN_M: [f64; 3] = [0.12, 0.06, 0.03];
/// Readings off the wall required at either end of a leg, so that the arc is whole.
const MARGIN: usize = 2;
const FEWEST: usize = 5;
/// Maximum readings of a leg, three times those of the slowest sweep at 7 Hz.
const MOST: usize = 200;
/// Maximum difference of both legs' arcs. Beyond it, silence or an object cut one short.
const UNEQUAL_RAD: f64 = 0.12;

/// Turn to one side, in order of time: heading and range, metres, NaN without an echo.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Leg(Vec<(f64, f64)>);

/// Headings of the first and the last echo of the wall, radians.
#[derive(Clone, Copy, Debug)]
struct Arc {
    first: f64,
    last: f64,
    range_m: f64,
}

impl Leg {
    pub(crate) fn push(&mut self, heading: f64, range_m: Option<f64>) {
        if self.0.len() < MOST {
            self.0.push((heading, range_m.unwrap_or(f64::NAN)));
        }
    }

    fn arc(&self) -> Option<Arc> {
        let mut ranges: Vec<f64> =
            self.0.iter().map(|(_, range)| *range).filter(|range| range.is_finite()).collect();
        const { assert!(MARGIN > 0 && FEWEST + 2 * MARGIN < MOST) };
        if ranges.len() < FEWEST {
            return None;
        }
        ranges.sort_by(f64::total_cmp);
        let median = ranges[ranges.len() / 2];
        let whole = |within: f64| {
            let of_wall = |&(_, range): &(f64, f64)| (range - median).abs() <= within;
            let first = self.0.iter().position(of_wall)?;
            let last = self.0.iter().rposition(of_wall)?;
            let answers = self.0[first..=last].iter().filter(|&reading| of_wall(reading)).count();
            let inside = first >= MARGIN && last + MARGIN < self.0.len() && answers >= FEWEST;
            // The edge lies between the last reading outside and the first inside.
            let edge =
                |outside: usize, inside: usize| f64::midpoint(self.0[outside].0, self.0[inside].0);
            inside.then(|| Arc {
                first: edge(first - 1, first),
                last: edge(last + 1, last),
                range_m: median,
            })
        };
        WITHIN_M.into_iter().find_map(whole)
    }
}

#[derive(Debug, PartialEq)]
pub(crate) struct Normal {
    pub heading: f64,
    /// Middle of the first turn's arc less that of the second. The age of the ranges shifts all
    /// sweeps equally, so the scatter is the normals'.
    pub difference: f64,
    /// Distance of the wall from the sonar.
    pub range_m: f64,
}

#[derive(Debug, PartialEq, Eq)]
pub(crate) enum NoNormal {
    /// A leg lacks an end of the arc.
    Narrow,
    Unequal,
}

pub(crate) fn normal(legs: &[Leg; 2]) -> Result<Normal, NoNormal> {
    let [Some(there), Some(back)] = [legs[0].arc(), legs[1].arc()] else {
        return Err(NoNormal::Narrow);
    };
    let width = |arc: Arc| (arc.last - arc.first).abs();
    let middle = |arc: Arc| f64::midpoint(arc.first, arc.last);
    if (width(there) - width(back)).abs() > UNEQUAL_RAD {
        return Err(NoNormal::Unequal);
    }
    Ok(Normal {
        heading: f64::midpoint(middle(there), middle(back)),
        difference: middle(there) - middle(back),
        range_m: f64::midpoint(there.range_m, back.range_m),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a turn to one `side`, of what `echo` gives for each heading.
    fn turn(side: f64, echo: impl Fn(f64) -> Option<f64>) -> Leg {
        let mut leg = Leg::default();
        for step in 0..=90 {
            let heading = side * 0.8 * (f64::from(step) / 45.0 - 1.0);
            leg.push(heading, echo(heading));
        }
        leg
    }

    /// Returns a turn past a wall at heading `wall` that is seen `late` radians behind.
    fn leg(side: f64, wall: f64, late: f64) -> Leg {
        turn(side, |heading| ((heading - late * side - wall).abs() <= 0.38).then_some(0.42))
    }

    #[test]
    fn the_age_of_the_ranges_cancels_between_both_ways() {
        let legs = [leg(1.0, 0.1, 0.02), leg(-1.0, 0.1, 0.02)];
        let normal = normal(&legs).unwrap();
        assert!((normal.heading - 0.1).abs() < 0.01, "{normal:?}");
        assert!((normal.difference - 0.04).abs() < 0.02, "{normal:?}");
    }

    #[test]
    fn an_arc_that_the_sweep_or_silence_cuts_short_gives_no_normal() {
        let whole = leg(1.0, 0.1, 0.0);
        let cut = leg(1.0, 0.6, 0.0);
        assert_eq!(normal(&[whole.clone(), cut]), Err(NoNormal::Narrow));
        let mut silent = leg(-1.0, 0.1, 0.0);
        silent.0.iter_mut().filter(|(heading, _)| *heading > 0.2).for_each(|it| it.1 = f64::NAN);
        assert_eq!(normal(&[whole.clone(), silent]), Err(NoNormal::Unequal));
        assert_eq!(normal(&[whole, Leg::default()]), Err(NoNormal::Narrow));
    }

    #[test]
    fn a_rough_wall_that_answers_at_every_angle_is_found_by_its_nearest_part() {
        let rough = |heading: f64| {
            let beyond = ((heading - 0.05).abs() - 0.26).max(0.0);
            Some(0.61 / beyond.cos() - 0.19 * beyond.cos())
        };
        let normal = normal(&[turn(1.0, rough), turn(-1.0, rough)]).unwrap();
        assert!((normal.heading - 0.05).abs() < 0.03, "{normal:?}");
    }
}
