//! Values against each other. Series differ in their marks, not in colour alone.

use glam::DVec2;

use super::{
    margin::FONT,
    page::{Path, Px, ink, round_up, text, ticks},
};

/// Text is readable on a telephone, and as large as the text in a column of print.
const WIDTH: f64 = 620.0;
const LEFT: f64 = 70.0;
const RIGHT: f64 = WIDTH - 20.0;
const TOP: f64 = 60.0;
const BOTTOM: f64 = TOP + 230.0;
const HEIGHT: f64 = BOTTOM + 52.0;
/// A character is about as wide.
const CHARACTER: f64 = 8.6;
/// Room of a symbol in the legend, and from one entry to the next.
const SYMBOL: f64 = 38.0;
const APART: f64 = 24.0;
const MIDDLE: &str = " text-anchor=\"middle\"";

#[derive(Clone, Copy, Debug)]
pub enum Mark {
    Discs,
    Crosses,
}

#[derive(Debug)]
pub struct Series {
    pub name: &'static str,
    pub mark: Mark,
    /// Points in the units of the axes.
    pub points: Vec<[f64; 2]>,
}

#[derive(Debug)]
pub struct Chart {
    pub title: &'static str,
    /// A sentence for people who cannot see it.
    pub description: &'static str,
    pub axes: [&'static str; 2],
    /// Later series are drawn above the first ones.
    pub series: Vec<Series>,
}

struct Range {
    low: f64,
    high: f64,
    step: f64,
}

impl Range {
    /// 0 to 1 around no values.
    fn around(values: impl Iterator<Item = f64>) -> Self {
        let bounds = values
            .filter(|value| value.is_finite())
            .map(|value| (value, value))
            .reduce(|(low, high), (value, _)| (low.min(value), high.max(value)));
        let (low, high) = bounds.unwrap_or((0.0, 1.0));
        let (low, high) = (low.max(-1e12), high.min(1e12));
        let step = round_up((high - low).max(1e-9 * high.abs().max(1e-3)) / 5.0);
        let (low, high) = ((low / step).floor() * step, (high / step).ceil() * step);
        Self { low, high: if high > low { high } else { low + step }, step }
    }

    /// 0 at the low end, 1 at the high one; NaN if it has no place.
    fn part(&self, value: f64) -> f64 {
        let part = (value - self.low) / (self.high - self.low);
        if part.is_finite() { part.clamp(0.0, 1.0) } else { f64::NAN }
    }

    fn ticks(&self) -> impl Iterator<Item = (f64, String)> + use<'_> {
        let part = |value: f64| (value - self.low) / (self.high - self.low);
        let ticks = ticks(self.low, self.high, self.step);
        ticks.map(move |(value, number)| (part(value), number))
    }
}

/// The place of shares of both ranges.
fn place(x: f64, y: f64) -> DVec2 {
    DVec2::new(LEFT + x * (RIGHT - LEFT), TOP + (1.0 - y) * (BOTTOM - TOP))
}

impl Chart {
    pub fn svg(&self) -> String {
        let Self { title, description, axes, series } = self;
        let along = |axis: usize| {
            Range::around(series.iter().flat_map(|it| &it.points).map(move |point| point[axis]))
        };
        let [x, y] = [along(0), along(1)];
        let (mut legend, mut marks, mut labels) = (String::new(), String::new(), String::new());
        let mut at = DVec2::new(LEFT, 48.0);
        for Series { name, mark, points } in series {
            legend += &drawn(*mark, [at + DVec2::new(SYMBOL / 2.0 - 4.0, -5.0)]);
            legend += &text(at + DVec2::X * SYMBOL, "", name);
            at.x += SYMBOL + name.len() as f64 * CHARACTER + APART;
            marks +=
                &drawn(*mark, points.iter().map(|point| place(x.part(point[0]), y.part(point[1]))));
        }
        if series.iter().all(|it| it.points.is_empty()) {
            marks += &text(place(0.5, 0.5), MIDDLE, "nothing recorded");
        }
        let mut rules = Path::default();
        for (part, number) in x.ticks() {
            rules.segment(place(part, 0.0), place(part, 1.0));
            labels += &text(place(part, 0.0) + DVec2::Y * 19.0, MIDDLE, &number);
        }
        for (part, number) in y.ticks() {
            rules.segment(place(0.0, part), place(1.0, part));
            let at = place(0.0, part) + DVec2::new(-7.0, 5.0);
            labels += &text(at, " text-anchor=\"end\"", &number);
        }
        labels += &text(place(0.5, 0.0) + DVec2::Y * 42.0, MIDDLE, axes[0]);
        let middle = Px(place(0.0, 0.5).y);
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" width=\"{WIDTH}\" height=\"{HEIGHT}\" \
             role=\"img\" font-family=\"{FONT}\" font-size=\"14\" fill=\"{ink}\">\n\
             <title>{title}</title>\n<desc>{description}</desc>\n\
             <rect width=\"{WIDTH}\" height=\"{HEIGHT}\" fill=\"#fff\"/>\n\
             <text x=\"{LEFT}\" y=\"22\" font-size=\"16\" font-weight=\"600\">{title}</text>\n{legend}{}{marks}\
             <rect x=\"{LEFT}\" y=\"{TOP}\" width=\"{}\" height=\"{}\" fill=\"none\" stroke=\"{ink}\" stroke-width=\"1.2\"/>\n{labels}\
             <text transform=\"translate(17 {middle}) rotate(-90)\"{MIDDLE}>{}</text>\n</svg>\n",
            rules.element("stroke=\"#d5dbe1\" stroke-width=\"0.8\" fill=\"none\""),
            RIGHT - LEFT,
            BOTTOM - TOP,
            axes[1],
            ink = ink::TEXT,
        )
    }
}

fn drawn(mark: Mark, places: impl IntoIterator<Item = DVec2>) -> String {
    let mut path = Path::default();
    for at in places.into_iter().filter(|at| at.is_finite()) {
        match mark {
            Mark::Discs => path.circle(at, 1.7),
            Mark::Crosses => {
                for reach in [DVec2::new(3.0, 3.0), DVec2::new(3.0, -3.0)] {
                    path.segment(at - reach, at + reach);
                }
            }
        }
    }
    path.element(&match mark {
        Mark::Discs => format!("fill=\"{}\"", ink::TRUTH),
        Mark::Crosses => format!("fill=\"none\" stroke=\"{}\" stroke-width=\"1.5\"", ink::FAILURE),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_chart_of_any_values_is_a_file_with_its_axes_their_units_and_a_legend() {
        let odd = [f64::NAN, f64::INFINITY, -1e300, 1e300, 0.0, -0.0, 1e-300];
        let odd = odd.iter().flat_map(|&x| odd.map(|y| [x, y])).collect();
        for points in [odd, Vec::new(), vec![[1.0, 1.0]], vec![[0.0, 0.1], [1.0, 0.2]]] {
            let series = |name, mark| Series { name, mark, points: points.clone() };
            let chart = Chart {
                title: "speeds",
                description: "the speeds of a robot",
                axes: ["time, s", "v, m/s"],
                series: vec![series("commanded", Mark::Discs), series("driven", Mark::Crosses)],
            };
            let svg = chart.svg();
            for text in [">time, s<", ">v, m/s<", ">commanded<", ">driven<"] {
                assert!(svg.contains(text), "{text} in {svg}");
            }
            assert!(points.len() != 2 || svg.contains(">0.20<"), "{svg}");
            roxmltree::Document::parse(&svg).unwrap();
        }
    }
}
