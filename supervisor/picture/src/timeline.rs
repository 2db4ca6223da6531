//! Events on one time line: a lane for each process, marks of different shape for what happened to it.

use glam::DVec2;

use super::{
    chart::add_cross,
    page::{Path, Px, escape, ink},
    plot::{Entry, Plot, Range},
};

/// Left edge of the lanes: their names stand before it.
const LEFT: f64 = 132.0;
/// Height of a lane.
const LANE: f64 = 34.0;
/// Marks and spans of a lane that are drawn at most.
const MOST: usize = 500;
/// Lanes that are drawn at most.
const MOST_LANES: usize = 24;

/// The symbol of a mark.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Symbol {
    /// A process ended: a cross.
    Death,
    /// Its successor is ready: a ring.
    Ready,
    /// Something was noticed or begun: a triangle.
    Event,
    /// Somebody asked for something: a diamond.
    Request,
}

impl Symbol {
    const ALL: [Self; 4] = [Self::Death, Self::Ready, Self::Event, Self::Request];

    const fn words(self) -> &'static str {
        match self {
            Self::Death => "process ended",
            Self::Ready => "successor ready",
            Self::Event => "event",
            Self::Request => "request of an operator",
        }
    }

    fn drawn(self, places: impl Iterator<Item = DVec2>) -> String {
        let mut path = Path::default();
        for at in places {
            match self {
                Self::Death => add_cross(&mut path, at, 5.0),
                Self::Ready => path.circle(at, 5.0),
                Self::Event => path.polygon(
                    [(0.0, -6.0), (5.5, 4.5), (-5.5, 4.5)].map(|(x, y)| at + DVec2::new(x, y)),
                ),
                Self::Request => path.polygon(
                    [(0.0, -6.0), (6.0, 0.0), (0.0, 6.0), (-6.0, 0.0)]
                        .map(|(x, y)| at + DVec2::new(x, y)),
                ),
            }
        }
        let (fill, stroke, width) = match self {
            Self::Death => ("none", ink::FAILURE, 2.4),
            Self::Ready => ("#fff", ink::TARGET, 1.8),
            Self::Event => (ink::SENSED, ink::TEXT, 1.0),
            Self::Request => ("#fff", ink::TEXT, 1.4),
        };
        path.element(&format!("fill=\"{fill}\" stroke=\"{stroke}\" stroke-width=\"{width}\""))
    }
}

/// A row of the time line.
#[derive(Clone, Debug, Default)]
pub struct Lane {
    /// The name of the process.
    pub name: String,
    /// Intervals in which it was down or standing, seconds.
    pub spans: Vec<[f64; 2]>,
    /// The times of the events, seconds, and their symbols.
    pub marks: Vec<(f64, Symbol)>,
}

/// The events of a run.
#[derive(Clone, Debug)]
pub struct Timeline {
    /// Above it.
    pub title: String,
    /// A description in a sentence.
    pub description: String,
    /// End of the time axis, seconds.
    pub duration_s: f64,
    /// The meaning of a span, such as `no process; the robot is kept standing`.
    pub span: String,
    /// The lanes from top to bottom.
    pub lanes: Vec<Lane>,
}

impl Timeline {
    /// The text of an SVG file.
    pub fn svg(&self) -> String {
        let lanes = &self.lanes[..self.lanes.len().min(MOST_LANES)];
        let x = Range::to(self.duration_s);
        let height = LANE * lanes.len().max(1) as f64;
        let mut entries: Vec<Entry> = Symbol::ALL
            .into_iter()
            .filter(|symbol| {
                lanes.iter().any(|lane| lane.marks.iter().any(|(_, its)| its == symbol))
            })
            .map(|symbol| {
                let drawn = move |at| symbol.drawn([at].into_iter());
                (Box::new(drawn) as _, symbol.words().to_owned())
            })
            .collect();
        if lanes.iter().any(|lane| !lane.spans.is_empty()) {
            let span = |at| span(&[[at - DVec2::X * 14.0, at + DVec2::X * 14.0]]);
            entries.push((Box::new(span), self.span.clone()));
        }
        let plot = Plot::new(&self.title, LEFT, height, &entries);
        let mut drawn = String::new();
        for (nth, lane) in lanes.iter().enumerate() {
            let y = 1.0 - (nth as f64 + 0.5) / lanes.len() as f64;
            let place = |time: f64| plot.place(x.part(time), y);
            let mut rule = Path::default();
            rule.move_to(plot.place(0.0, y));
            rule.line_to(plot.place(1.0, y));
            drawn += &rule.element(&format!(
                "fill=\"none\" stroke=\"{}\" stroke-width=\"0.8\"",
                ink::PERIMETER
            ));
            let spans: Vec<_> = lane.spans.iter().take(MOST).collect();
            let spans: Vec<_> = spans.into_iter().map(|ends| ends.map(place)).collect();
            drawn += &span(&spans);
            for symbol in Symbol::ALL {
                let its = lane.marks.iter().filter(|(_, its)| *its == symbol);
                let places = its.take(MOST).map(|(time, _)| place(*time));
                drawn += &symbol.drawn(places.filter(|at| at.is_finite()));
            }
            let at = plot.place(0.0, y);
            drawn += &format!(
                "<text x=\"{}\" y=\"{}\" text-anchor=\"end\">{}</text>\n",
                Px(at.x - 10.0),
                Px(at.y + 5.0),
                escape(&lane.name, 15)
            );
        }
        plot.svg((&x, "mission time, s"), None, &self.description, &drawn)
    }
}

/// Bars from place to place, never so thin that they are not seen.
fn span(ends: &[[DVec2; 2]]) -> String {
    let mut path = Path::default();
    for [from, to] in ends {
        if from.is_finite() && to.is_finite() {
            let corner = *from - DVec2::Y * 4.0;
            path.rectangle(corner, DVec2::new((to.x - from.x).max(1.5), 8.0));
        }
    }
    path.element(&format!("fill=\"#cbd2d9\" stroke=\"{}\" stroke-width=\"0.8\"", ink::QUIET))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_time_line_names_its_lanes_its_unit_and_each_shape() {
        let lane = |name: &str, marks: Vec<(f64, Symbol)>| Lane {
            name: name.to_owned(),
            spans: vec![[1.0, 1.2], [f64::NAN, 2.0]],
            marks,
        };
        let svg = Timeline {
            title: "Events".to_owned(),
            description: "deaths".to_owned(),
            duration_s: 10.0,
            span: "no process".to_owned(),
            lanes: vec![
                lane("planner", vec![(1.0, Symbol::Death), (1.2, Symbol::Ready)]),
                lane("<mapper>", vec![(f64::NAN, Symbol::Event)]),
            ],
        }
        .svg();
        for text in [
            ">planner<",
            "&lt;mapper&gt;",
            ">mission time, s<",
            ">process ended<",
            ">successor ready<",
            ">no process<",
        ] {
            assert!(svg.contains(text), "{text} in {svg}");
        }
        assert!(!svg.contains("request of"));
        crate::png(&svg).unwrap();
    }

    #[test]
    fn a_time_line_of_very_many_events_is_a_small_file() {
        let marks = (0..100_000).map(|nth| (f64::from(nth), Symbol::Death));
        let lane = Lane {
            name: "planner".to_owned(),
            spans: vec![[0.0, 1.0]; 10_000],
            marks: marks.collect(),
        };
        let timeline = Timeline {
            title: String::new(),
            description: String::new(),
            duration_s: f64::NAN,
            span: String::new(),
            lanes: vec![lane; 2 * MOST_LANES],
        };
        assert!(timeline.svg().len() < 2_000_000);
    }
}
