//! A chart's sheet of fixed width, ranges with round ticks, axes, legend.

use glam::DVec2;

use super::page::{Path, Px, escape, ink, round_up};

/// Text is readable on a telephone, and as large as the text in a column of print.
const WIDTH: f64 = 620.0;
const LEFT: f64 = 70.0;
const RIGHT: f64 = WIDTH - 20.0;
const TEXT: f64 = 14.0;
/// A character is about as wide.
const CHARACTER: f64 = 8.6;
const ROW: f64 = 21.0;
/// Room of a symbol, and from one entry to the next.
const SYMBOL: f64 = 38.0;
const APART: f64 = 24.0;
const BELOW: f64 = 52.0;
/// They surely fit across the sheet.
const ACROSS: usize = 70;

#[derive(Clone, Copy, Debug)]
pub(super) struct Range {
    low: f64,
    high: f64,
    step: f64,
}

impl Range {
    /// Round numbers; 0 to 1 around none.
    pub(super) fn around(values: impl Iterator<Item = f64>) -> Self {
        let finite = values.filter(|value| value.is_finite());
        let bounds = finite.fold(None, |bounds: Option<(f64, f64)>, value| {
            let (low, high) = bounds.unwrap_or((value, value));
            Some((low.min(value), high.max(value)))
        });
        let (low, high) = bounds.unwrap_or((0.0, 1.0));
        let (low, high) = (low.max(-1e12), high.min(1e12));
        let step = round_up((high - low).max(1e-9 * high.abs().max(1e-3)) / 5.0);
        let (low, high) = ((low / step).floor() * step, (high / step).ceil() * step);
        let high = if high > low { high } else { low + step };
        Self { low, high, step }
    }

    /// 0 at the low end, 1 at the high one; NaN if it has no place.
    pub(super) fn part(&self, value: f64) -> f64 {
        let part = (value - self.low) / (self.high - self.low);
        if part.is_finite() { part.clamp(0.0, 1.0) } else { f64::NAN }
    }

    fn ticks(&self) -> Vec<(f64, String)> {
        let digits = (-self.step.log10().floor()).clamp(0.0, 9.0) as usize;
        let first = (self.low / self.step - 1e-6).ceil();
        (0..40)
            .map(|nth| (first + f64::from(nth)) * self.step + 0.0)
            .take_while(|value| *value <= self.high + self.step * 1e-6)
            .map(|value| {
                let text = format!("{value:.digits$}");
                ((value - self.low) / (self.high - self.low), text)
            })
            .collect()
    }
}

/// A function draws the symbol about a place; its words stand beside it.
pub(super) type Entry = (Box<dyn Fn(DVec2) -> String>, String);

pub(super) struct Plot {
    title: String,
    top: f64,
    height: f64,
    legend: String,
}

impl Plot {
    /// The plot is `height` high, below `title` and the legend.
    pub(super) fn new(title: &str, height: f64, entries: &[Entry]) -> Self {
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
        Self { title: title.to_owned(), top: at.y + below, height, legend }
    }

    /// Shares of both ranges.
    pub(super) fn place(&self, x: f64, y: f64) -> DVec2 {
        DVec2::new(LEFT + x * (RIGHT - LEFT), self.top + (1.0 - y) * self.height)
    }

    pub(super) fn svg(
        &self,
        x: (&Range, &str),
        y: (&Range, &str),
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
        for (part, text) in y.0.ticks() {
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
        labels += &format!(
            "<text transform=\"translate(17 {}) rotate(-90)\" text-anchor=\"middle\">{}</text>\n",
            Px(self.place(0.0, 0.5).y),
            escape(y.1, ACROSS)
        );
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
            Px(RIGHT - LEFT),
            Px(self.height),
            ink::TEXT,
        )
    }
}
