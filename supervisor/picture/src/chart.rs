//! A chart: values against each other, with axes, units and a legend. Series differ in line or mark, not in colour alone.

use glam::DVec2;

use super::{
    page::{Path, ink},
    plot::{Axis, Entry, LEFT, Plot, Range},
};

/// Height of the plot.
const HEIGHT: f64 = 230.0;
/// Points of one series that are drawn at most; of more the least and the greatest of each stretch.
const MOST_POINTS: usize = 2400;

/// The style of a series.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mark {
    /// A solid line, broken where a value is not finite.
    Solid,
    /// A dashed line from point to point.
    Dashed,
    /// A disc at each point.
    Discs,
    /// A cross at each point.
    Crosses,
    /// A bar from the foot of the plot to each point, as wide as to the next point; the last one ends the last bar.
    Bars,
}

/// Values to draw.
#[derive(Clone, Debug)]
pub struct Series {
    /// Name for the legend.
    pub name: String,
    /// The style of the points.
    pub mark: Mark,
    /// x and y, in the units of the axes, in the order of x.
    pub points: Vec<[f64; 2]>,
}

#[derive(Clone, Debug)]
pub struct Chart {
    /// Above it.
    pub title: String,
    /// A description in a sentence, for people who cannot see it.
    pub description: String,
    /// Along the foot.
    pub x: Axis,
    /// Along the left side.
    pub y: Axis,
    /// The series; the first ones are drawn below the others.
    pub series: Vec<Series>,
}

impl Chart {
    /// The text of an SVG file.
    pub fn svg(&self) -> String {
        let along = |axis: usize| {
            let points = self.series.iter().flat_map(|series| &series.points);
            points.map(move |point| point[axis])
        };
        // Bars stand on 0.
        let has_bars = self.series.iter().any(|series| series.mark == Mark::Bars);
        let foot = has_bars.then_some(0.0);
        let x = Range::around(self.x.scale, along(0));
        let y = Range::around(self.y.scale, along(1).chain(foot));
        let entries: Vec<Entry> = self.series.iter().map(entry).collect();
        let plot = Plot::new(&self.title, LEFT, HEIGHT, &entries);
        let place = |[at, value]: [f64; 2]| plot.place(x.part(at), y.part(value));
        let drawn: String = self
            .series
            .iter()
            .map(|series| match series.mark {
                Mark::Bars => bars(&series.points, y.least(), place),
                mark => drawn(mark, reduced(&series.points).into_iter().map(place)),
            })
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
        plot.svg(
            (&x, &self.x.label),
            Some((&y, &self.y.label)),
            &self.description,
            &(drawn + &remark),
        )
    }
}

/// The least and the greatest value of each interval, so that no peak is lost.
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
    let line = |colour: &str, dashes: &str| {
        format!(
            "fill=\"none\" stroke=\"{colour}\" stroke-width=\"1.5\" stroke-dasharray=\"{dashes}\" stroke-linejoin=\"round\""
        )
    };
    match mark {
        Mark::Solid => line(ink::TRUTH, "none"),
        Mark::Dashed => line(ink::BELIEVED, "5 3"),
        Mark::Discs => format!("fill=\"{}\"", ink::TRUTH),
        Mark::Crosses => line(ink::FAILURE, "none"),
        Mark::Bars => format!("fill=\"#9fb3c8\" stroke=\"{}\" stroke-width=\"0.8\"", ink::TEXT),
    }
}

/// `points` on the sheet, by `mark`.
fn drawn(mark: Mark, points: impl Iterator<Item = DVec2>) -> String {
    let mut path = Path::default();
    let mut last: Option<DVec2> = None;
    for at in points {
        if !at.is_finite() {
            last = None;
            continue;
        }
        match mark {
            Mark::Discs => path.circle(at, 1.7),
            Mark::Crosses => add_cross(&mut path, at, 3.0),
            Mark::Solid | Mark::Dashed | Mark::Bars => {
                if let Some(last) = last {
                    path.join(last);
                    path.line_to(at);
                }
            }
        }
        last = Some(at);
    }
    path.element(&style(mark))
}

fn bars(points: &[[f64; 2]], least: f64, place: impl Fn([f64; 2]) -> DVec2) -> String {
    let mut path = Path::default();
    for pair in points.windows(2) {
        let ([from, value], [to, _]) = (pair[0], pair[1]);
        let (corner, foot) = (place([from, value]), place([to, least]));
        if value > least && corner.is_finite() && foot.is_finite() {
            path.rectangle(corner, foot - corner);
        }
    }
    path.element(&style(Mark::Bars))
}

/// Two strokes.
pub(super) fn add_cross(path: &mut Path, at: DVec2, reach: f64) {
    for side in [DVec2::new(1.0, 1.0), DVec2::new(1.0, -1.0)] {
        path.move_to(at - side * reach);
        path.line_to(at + side * reach);
    }
}

fn entry(series: &Series) -> Entry {
    let mark = series.mark;
    let symbol = move |at: DVec2| {
        let half = DVec2::X * 14.0;
        match mark {
            Mark::Solid | Mark::Dashed => drawn(mark, [at - half, at + half].into_iter()),
            Mark::Discs | Mark::Crosses => drawn(mark, [at].into_iter()),
            Mark::Bars => {
                let mut path = Path::default();
                path.rectangle(at - DVec2::new(9.0, 6.0), DVec2::new(18.0, 12.0));
                path.element(&style(mark))
            }
        }
    };
    (Box::new(symbol), series.name.clone())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart(points: Vec<[f64; 2]>) -> Chart {
        Chart {
            title: "a <b> & \"c\"".to_owned(),
            description: "speeds".to_owned(),
            x: Axis::linear("time, s"),
            y: Axis::linear("v, m/s"),
            series: vec![
                Series { name: "commanded".to_owned(), mark: Mark::Solid, points: points.clone() },
                Series { name: "</text><script>".to_owned(), mark: Mark::Dashed, points },
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
        assert!(svg.contains("stroke-dasharray=\"5 3\""));
        crate::png(&svg).unwrap();
    }

    #[test]
    fn whatever_the_values_a_chart_is_a_file_of_bounded_size() {
        let odd = [f64::NAN, f64::INFINITY, -1e300, 1e300, 0.0, -0.0, 1e-300];
        let points = odd.iter().flat_map(|&x| odd.map(|y| [x, y])).collect();
        let many = (0..1_000_000).map(|nth| [f64::from(nth), f64::from(nth % 977)]);
        for points in [points, Vec::new(), vec![[1.0, 1.0]], many.collect()] {
            let mut chart = chart(points);
            for mark in [Mark::Discs, Mark::Crosses, Mark::Solid] {
                chart.series[0].mark = mark;
                chart.x = Axis::logarithmic("t, s");
                assert!(chart.svg().len() < 400_000);
                chart.x = Axis::linear("t, s");
                crate::png(&chart.svg()).unwrap();
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
