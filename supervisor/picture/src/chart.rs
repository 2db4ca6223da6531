//! Values against each other. Series differ in their marks, not in colour alone.

use glam::DVec2;

use super::{
    page::{Path, ink},
    plot::{Entry, Plot, Range},
};

const HEIGHT: f64 = 230.0;
/// From more points, the least and the greatest of each stretch are drawn.
const MOST_POINTS: usize = 2400;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mark {
    Discs,
    Crosses,
}

#[derive(Clone, Debug)]
pub struct Series {
    pub name: String,
    pub mark: Mark,
    /// Points in the units of the axes, in the order of x.
    pub points: Vec<[f64; 2]>,
}

#[derive(Clone, Debug)]
pub struct Chart {
    pub title: String,
    /// A sentence for people who cannot see it.
    pub description: String,
    /// Quantity and unit.
    pub x: String,
    pub y: String,
    /// Later series are drawn above the first ones.
    pub series: Vec<Series>,
}

impl Chart {
    pub fn svg(&self) -> String {
        let along = |axis: usize| {
            let points = self.series.iter().flat_map(|series| &series.points);
            points.map(move |point| point[axis])
        };
        let (x, y) = (Range::around(along(0)), Range::around(along(1)));
        let entries: Vec<Entry> = self.series.iter().map(entry).collect();
        let plot = Plot::new(&self.title, HEIGHT, &entries);
        let place = |[at, value]: [f64; 2]| plot.place(x.part(at), y.part(value));
        let drawn: String = self
            .series
            .iter()
            .map(|series| drawn(series.mark, reduced(&series.points).into_iter().map(place)))
            .collect();
        let nothing = self.series.iter().all(|series| series.points.is_empty());
        let remark = if nothing {
            let at = plot.place(0.5, 0.5);
            format!(
                "<text x=\"{}\" y=\"{}\" text-anchor=\"middle\">nothing recorded</text>\n",
                at.x, at.y
            )
        } else {
            String::new()
        };
        plot.svg((&x, &self.x), (&y, &self.y), &self.description, &(drawn + &remark))
    }
}

/// Least and greatest of each interval, so that no peak is lost.
fn reduced(points: &[[f64; 2]]) -> Vec<[f64; 2]> {
    if points.len() <= MOST_POINTS {
        return points.to_vec();
    }
    let stretch = points.len().div_ceil(MOST_POINTS / 2);
    let kept = points.chunks(stretch).flat_map(|stretch| {
        let by_value = |a: &&[f64; 2], b: &&[f64; 2]| a[1].total_cmp(&b[1]);
        let least = stretch.iter().min_by(by_value);
        let greatest = stretch.iter().max_by(by_value);
        let mut both: Vec<_> = [least, greatest].into_iter().flatten().copied().collect();
        both.sort_by(|a, b| a[0].total_cmp(&b[0]));
        both
    });
    kept.collect()
}

fn style(mark: Mark) -> String {
    match mark {
        Mark::Discs => format!("fill=\"{}\"", ink::TRUTH),
        Mark::Crosses => format!("fill=\"none\" stroke=\"{}\" stroke-width=\"1.5\"", ink::FAILURE),
    }
}

fn drawn(mark: Mark, points: impl Iterator<Item = DVec2>) -> String {
    let mut path = Path::default();
    for at in points.filter(|at| at.is_finite()) {
        match mark {
            Mark::Discs => path.circle(at, 1.7),
            Mark::Crosses => add_cross(&mut path, at, 3.0),
        }
    }
    path.element(&style(mark))
}

fn add_cross(path: &mut Path, at: DVec2, reach: f64) {
    for side in [DVec2::new(1.0, 1.0), DVec2::new(1.0, -1.0)] {
        path.move_to(at - side * reach);
        path.line_to(at + side * reach);
    }
}

fn entry(series: &Series) -> Entry {
    let mark = series.mark;
    let symbol = move |at: DVec2| drawn(mark, std::iter::once(at));
    (Box::new(symbol), series.name.clone())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart(points: Vec<[f64; 2]>) -> Chart {
        Chart {
            title: "a <b> & \"c\"".to_owned(),
            description: "speeds".to_owned(),
            x: "time, s".to_owned(),
            y: "v, m/s".to_owned(),
            series: vec![
                Series { name: "commanded".to_owned(), mark: Mark::Discs, points: points.clone() },
                Series { name: "</text><script>".to_owned(), mark: Mark::Crosses, points },
            ],
        }
    }

    #[test]
    fn a_chart_names_axes_with_units_and_series_in_a_legend_and_escapes_all_of_it() {
        let svg = chart(vec![[0.0, 0.1], [1.0, 0.2], [2.0, 0.15]]).svg();
        for text in [
            ">time, s<",
            ">v, m/s<",
            ">commanded<",
            ">0.20<",
            "a &lt;b&gt; &amp; &quot;c&quot;",
            "&lt;/text&gt;&lt;script&gt;",
        ] {
            assert!(svg.contains(text), "{text} in {svg}");
        }
        roxmltree::Document::parse(&svg).unwrap();
    }

    #[test]
    fn whatever_the_values_a_chart_is_a_file_of_bounded_size() {
        let odd = [f64::NAN, f64::INFINITY, -1e300, 1e300, 0.0, -0.0, 1e-300];
        let points = odd.iter().flat_map(|&x| odd.map(|y| [x, y])).collect();
        let many = (0..1_000_000).map(|nth| [f64::from(nth), f64::from(nth % 977)]);
        for points in [points, Vec::new(), vec![[1.0, 1.0]], many.collect()] {
            let mut chart = chart(points);
            for mark in [Mark::Discs, Mark::Crosses] {
                chart.series[0].mark = mark;
                let svg = chart.svg();
                assert!(svg.len() < 400_000);
                roxmltree::Document::parse(&svg).unwrap();
            }
        }
    }

    #[test]
    fn a_peak_among_very_many_points_is_drawn() {
        let mut points: Vec<_> = (0..100_000).map(|nth| [f64::from(nth), 0.0]).collect();
        points[54_321][1] = 7.0;
        assert!(reduced(&points).contains(&[54_321.0, 7.0]));
    }
}
