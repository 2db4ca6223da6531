//! The common parts of charts: a sheet of fixed width, ranges with round ticks, axes with units, a legend.

use glam::DVec2;

use super::page::{Path, Px, escape, ink, round_up};

/// Width of the sheet: on a telephone its text is still read, across a column of print it is as large as the text.
pub(super) const WIDTH: f64 = 620.0;
/// Left edge of the plot.
pub(super) const LEFT: f64 = 70.0;
/// Right edge of the plot.
pub(super) const RIGHT: f64 = WIDTH - 20.0;
/// Text, px.
const TEXT: f64 = 14.0;
/// The approximate width of a character of the text.
const CHARACTER: f64 = 8.6;
/// Distance between rows of the legend.
const ROW: f64 = 21.0;
/// Room of a symbol of the legend, and from one entry to the next.
const SYMBOL: f64 = 38.0;
const APART: f64 = 24.0;
/// The space below the plot.
const BELOW: f64 = 52.0;
/// Characters that surely fit across the sheet.
const ACROSS: usize = 70;

/// The scale of an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// Equal distances are equal differences.
    Linear,
    /// Logarithmic; values of 0 and less are not drawn.
    Logarithmic,
}

/// An axis of a chart.
#[derive(Clone, Debug)]
pub struct Axis {
    /// Its quantity and unit, such as `time, s`.
    pub label: String,
    /// The scale.
    pub scale: Scale,
}

impl Axis {
    /// A linear axis.
    pub fn linear(label: &str) -> Self {
        Self { label: label.to_owned(), scale: Scale::Linear }
    }

    /// A logarithmic axis.
    pub fn logarithmic(label: &str) -> Self {
        Self { label: label.to_owned(), scale: Scale::Logarithmic }
    }
}

/// The range of an axis; of a logarithmic one the exponents.
#[derive(Clone, Copy, Debug)]
pub(super) struct Range {
    scale: Scale,
    low: f64,
    high: f64,
    step: f64,
}

impl Range {
    /// Round numbers around `values`; 0 to 1 around none.
    pub(super) fn around(scale: Scale, values: impl Iterator<Item = f64>) -> Self {
        let placed = values.map(|value| scaled(scale, value)).filter(|value| value.is_finite());
        let bounds = placed.fold(None, |bounds: Option<(f64, f64)>, value| {
            let (low, high) = bounds.unwrap_or((value, value));
            Some((low.min(value), high.max(value)))
        });
        let (low, high) = bounds.unwrap_or((0.0, 1.0));
        let (low, high) = (low.max(-1e12), high.min(1e12));
        let step = match scale {
            Scale::Linear => round_up((high - low).max(1e-9 * high.abs().max(1e-3)) / 5.0),
            Scale::Logarithmic => 1.0,
        };
        let (low, high) = ((low / step).floor() * step, (high / step).ceil() * step);
        let high = if high > low { high } else { low + step };
        Self { scale, low, high, step }
    }

    /// An axis from 0 to exactly `high`.
    pub(super) fn to(high: f64) -> Self {
        let high = if high.is_finite() && high > 0.0 { high } else { 1.0 };
        Self { scale: Scale::Linear, low: 0.0, high, step: round_up(high / 6.0) }
    }

    /// The place of `value`: 0 at the low end, 1 at the high one; NaN if it has none.
    pub(super) fn part(&self, value: f64) -> f64 {
        let part = (scaled(self.scale, value) - self.low) / (self.high - self.low);
        if part.is_finite() { part.clamp(0.0, 1.0) } else { f64::NAN }
    }

    /// The least value.
    pub(super) fn least(&self) -> f64 {
        match self.scale {
            Scale::Linear => self.low,
            Scale::Logarithmic => 10_f64.powf(self.low),
        }
    }

    /// Places and labels of the ticks.
    fn ticks(&self) -> Vec<(f64, String)> {
        let digits = (-self.step.log10().floor()).clamp(0.0, 9.0) as usize;
        let first = (self.low / self.step - 1e-6).ceil();
        (0..40)
            .map(|nth| (first + f64::from(nth)) * self.step + 0.0)
            .take_while(|value| *value <= self.high + self.step * 1e-6)
            .map(|value| {
                let text = match self.scale {
                    Scale::Linear => format!("{value:.digits$}"),
                    Scale::Logarithmic => {
                        let value = 10_f64.powf(value);
                        let digits = (-value.log10().floor()).clamp(0.0, 9.0) as usize;
                        format!("{value:.digits$}")
                    }
                };
                ((value - self.low) / (self.high - self.low), text)
            })
            .collect()
    }
}

fn scaled(scale: Scale, value: f64) -> f64 {
    match scale {
        Scale::Linear => value,
        Scale::Logarithmic if value > 0.0 => value.log10(),
        Scale::Logarithmic => f64::NAN,
    }
}

/// An entry of a legend: what draws its symbol about a place, and its words.
pub(super) type Entry = (Box<dyn Fn(DVec2) -> String>, String);

/// The sheet of a chart.
pub(super) struct Plot {
    title: String,
    /// Left edge of the plot.
    left: f64,
    top: f64,
    height: f64,
    legend: String,
}

impl Plot {
    /// A sheet with a plot `height` high from `left` on, below `title` and the entries of its legend.
    pub(super) fn new(title: &str, left: f64, height: f64, entries: &[Entry]) -> Self {
        let mut at = DVec2::new(LEFT, 48.0);
        let mut legend = String::new();
        for (symbol, words) in entries {
            let words = escape(words, ACROSS);
            let wide = SYMBOL + words.chars().count() as f64 * CHARACTER;
            if at.x > LEFT && at.x + wide > WIDTH {
                at = DVec2::new(LEFT, at.y + ROW);
            }
            legend += &symbol(at + DVec2::new(SYMBOL / 2.0 - 4.0, -5.0));
            legend +=
                &format!("<text x=\"{}\" y=\"{}\">{words}</text>\n", Px(at.x + SYMBOL), Px(at.y));
            at.x += wide + APART;
        }
        let below = if entries.is_empty() { 0.0 } else { 12.0 };
        Self { title: title.to_owned(), left, top: at.y + below, height, legend }
    }

    /// The point on the sheet at these shares of both ranges.
    pub(super) fn place(&self, x: f64, y: f64) -> DVec2 {
        DVec2::new(self.left + x * (RIGHT - self.left), self.top + (1.0 - y) * self.height)
    }

    /// The file with `drawn` between axes. The y axis has no ticks if it has no range.
    pub(super) fn svg(
        &self,
        x: (&Range, &str),
        y: Option<(&Range, &str)>,
        description: &str,
        drawn: &str,
    ) -> String {
        let height = self.top + self.height + BELOW;
        let (title, description) = (escape(&self.title, ACROSS), escape(description, 600));
        let (mut rules, mut labels) = (Path::default(), String::new());
        let mut last = f64::NEG_INFINITY;
        for (part, text) in x.0.ticks() {
            let foot = self.place(part, 0.0);
            rules.move_to(foot);
            rules.line_to(self.place(part, 1.0));
            let half = text.chars().count() as f64 * CHARACTER / 2.0;
            if foot.x - half < last {
                continue;
            }
            last = foot.x + half + 6.0;
            labels += &format!(
                "<text x=\"{}\" y=\"{}\" text-anchor=\"middle\">{text}</text>\n",
                Px(foot.x),
                Px(foot.y + 19.0)
            );
        }
        for (part, text) in y.iter().flat_map(|(range, _)| range.ticks()) {
            let mark = self.place(0.0, part);
            rules.move_to(mark);
            rules.line_to(self.place(1.0, part));
            labels += &format!(
                "<text x=\"{}\" y=\"{}\" text-anchor=\"end\">{text}</text>\n",
                Px(mark.x - 7.0),
                Px(mark.y + 5.0)
            );
        }
        let foot = self.place(0.5, 0.0);
        labels += &format!(
            "<text x=\"{}\" y=\"{}\" text-anchor=\"middle\">{}</text>\n",
            Px(foot.x),
            Px(foot.y + 42.0),
            escape(x.1, ACROSS)
        );
        if let Some((_, label)) = y {
            labels += &format!(
                "<text transform=\"translate(17 {}) rotate(-90)\" text-anchor=\"middle\">{}</text>\n",
                Px(self.place(0.0, 0.5).y),
                escape(label, ACROSS)
            );
        }
        let corner = self.place(0.0, 1.0);
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {height}\" width=\"{WIDTH}\" height=\"{height}\" \
             role=\"img\" font-family=\"{}\" font-size=\"{TEXT}\" fill=\"{}\">\n\
             <title>{title}</title>\n<desc>{description}</desc>\n\
             <rect width=\"{WIDTH}\" height=\"{height}\" fill=\"#fff\"/>\n\
             <text x=\"{LEFT}\" y=\"22\" font-size=\"16\" font-weight=\"600\">{title}</text>\n{}{}{drawn}\
             <rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"1.2\"/>\n{labels}</svg>\n",
            super::margin::FONT,
            ink::TEXT,
            self.legend,
            rules.element("stroke=\"#d5dbe1\" stroke-width=\"0.8\" fill=\"none\""),
            Px(corner.x),
            Px(corner.y),
            Px(RIGHT - self.left),
            Px(self.height),
            ink::TEXT,
        )
    }
}
