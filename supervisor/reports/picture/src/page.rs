//! Sheet: mission frame, and the format of numbers, lines and text.

use std::fmt::{self, Display, Write};

use common::grid::GridFrame;
use glam::DVec2;

/// Lengths on the sheet are in SVG's user units, "px".
pub(super) const WIDTH: f64 = 1150.0;
pub(super) const PLOT_LEFT: f64 = 62.0;
pub(super) const PLOT_TOP: f64 = 92.0;
/// Side of the plot, a square like a mission's perimeter.
pub(super) const PLOT_SIDE: f64 = 800.0;

/// Distance outside the plot at which lines are cut.
const OVERHANG: f64 = 20.0;
/// Shortest visible step of a line.
const FINEST: f64 = 0.6;

/// Colours. Hue separates belief (orange, violet), motion (black, magenta) and others' motion
/// (red); the field below stays pale.
pub(super) mod ink {
    pub(crate) const TEXT: &str = "#1f2933";
    pub(crate) const QUIET: &str = "#5b6773";
    /// Cells without a path to the target, or without a field.
    pub(crate) const NOWHERE: &str = "#eceef0";
    pub(crate) const GUIDANCE: &str = "#3f5f86";
    pub(crate) const SENSED: &str = "#f0923b";
    pub(crate) const KNOWN: &str = "#8f78c4";
    pub(crate) const PERIMETER: &str = "#9aa5b1";
    pub(crate) const WORLD: &str = "#27313b";
    pub(crate) const TRUTH: &str = "#0b0f14";
    pub(crate) const BELIEVED: &str = "#d1126f";
    pub(crate) const MOVER: &str = "#b3261e";
    pub(crate) const TARGET: &str = "#087f4b";
    pub(crate) const FAILURE: &str = "#c0271c";
}

pub(super) struct View {
    /// Least x and y, metres.
    pub low: DVec2,
    pub side_m: f64,
}

impl View {
    pub(super) fn of(frame: &GridFrame) -> Self {
        let side_m = f64::from(frame.cells) * frame.resolution_m;
        let low = metres(frame, DVec2::splat(-0.5));
        if side_m.is_finite() && side_m > 0.0 && low.is_finite() {
            return Self { low, side_m };
        }
        // Unreachable for valid missions.
        Self { low: DVec2::splat(-0.5), side_m: 1.0 }
    }

    pub(super) fn around(points: &[DVec2]) -> Self {
        let (low, high) = points
            .iter()
            .fold((DVec2::ZERO, DVec2::ZERO), |(low, high), at| (low.min(*at), high.max(*at)));
        let side_m = 1.1 * (high - low).max_element().max(1.0);
        Self { low: (low + high - side_m) / 2.0, side_m }
    }

    pub(super) fn place(&self, point: DVec2) -> DVec2 {
        let from_low = (point - self.low) * self.px(1.0);
        DVec2::new(PLOT_LEFT + from_low.x, PLOT_TOP + PLOT_SIDE - from_low.y)
    }

    pub(super) fn px(&self, metres: f64) -> f64 {
        metres * PLOT_SIDE / self.side_m
    }

    pub(super) fn shows(&self, centre: DVec2, radius_m: f64) -> bool {
        let reach = radius_m + self.side_m / 2.0;
        (centre - self.low - DVec2::splat(self.side_m / 2.0)).abs().cmple(DVec2::splat(reach)).all()
    }

    /// Draws a line in metres, cut at the plot and broken at non-finite points.
    pub(super) fn line(&self, points: impl IntoIterator<Item = DVec2>) -> Path {
        let mut path = Path::default();
        let (mut last, mut pen) = (None, None);
        for point in points {
            let to = Some(self.place(point)).filter(|to| to.is_finite());
            if let (Some(from), Some(to)) = (last, to) {
                if to.distance(from) < FINEST {
                    continue;
                }
                if let Some((enter, leave)) = cut(from, to) {
                    if pen.replace(leave) != Some(enter) {
                        path.move_to(enter);
                    }
                    path.line_to(leave);
                }
            }
            last = to;
        }
        path
    }
}

pub(super) fn metres(frame: &GridFrame, cells: DVec2) -> DVec2 {
    let centre = DVec2::splat(f64::from(frame.centre_index()));
    frame.centre + (cells - centre) * frame.resolution_m
}

/// Clips with Liang and Barsky's method to the plot and [`OVERHANG`].
fn cut(from: DVec2, to: DVec2) -> Option<(DVec2, DVec2)> {
    let low = DVec2::new(PLOT_LEFT, PLOT_TOP) - OVERHANG;
    let high = low + PLOT_SIDE + 2.0 * OVERHANG;
    let along = to - from;
    let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
    for axis in 0..2 {
        if along[axis] == 0.0 {
            if from[axis] < low[axis] || from[axis] > high[axis] {
                return None;
            }
            continue;
        }
        let a = (low[axis] - from[axis]) / along[axis];
        let b = (high[axis] - from[axis]) / along[axis];
        enter = enter.max(a.min(b));
        leave = leave.min(a.max(b));
    }
    let ends = (from + along * enter, from + along * leave);
    // Drops lines with an overflow in `along`.
    (enter <= leave && ends.0.is_finite() && ends.1.is_finite()).then_some(ends)
}

/// Number in tenths, finer than any screen; non-finite values become 0.
pub(super) struct Px(pub(super) f64);

impl Display for Px {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let finite = if self.0.is_finite() { self.0 } else { 0.0 };
        // Adding 0 turns -0 into 0.
        let tenths = (finite.clamp(-1e7, 1e7) * 10.0).round() + 0.0;
        write!(f, "{}", tenths / 10.0)
    }
}

/// Data attribute `d` of an SVG path, in sheet coordinates.
#[derive(Clone, Default)]
pub(super) struct Path {
    data: String,
}

impl Path {
    pub(super) const fn is_empty(&self) -> bool {
        self.data.is_empty()
    }

    pub(super) const fn len(&self) -> usize {
        self.data.len()
    }

    pub(super) fn move_to(&mut self, to: DVec2) {
        self.push('M', to);
    }

    pub(super) fn line_to(&mut self, to: DVec2) {
        self.push('L', to);
    }

    pub(super) fn polyline(&mut self, points: impl IntoIterator<Item = DVec2>) {
        for (nth, point) in points.into_iter().enumerate() {
            self.push(if nth == 0 { 'M' } else { 'L' }, point);
        }
    }

    pub(super) fn polygon(&mut self, corners: impl IntoIterator<Item = DVec2>) {
        self.polyline(corners);
        self.data.push('Z');
    }

    pub(super) fn rectangle(&mut self, corner: DVec2, size: DVec2) {
        let [x, y, width, height, back] = [corner.x, corner.y, size.x, size.y, -size.x].map(Px);
        self.write(format_args!("M{x} {y}h{width}v{height}h{back}z"));
    }

    pub(super) fn circle(&mut self, centre: DVec2, radius: f64) {
        let [x, y, r] = [centre.x - radius, centre.y, radius].map(Px);
        let [there, back] = [2.0, -2.0].map(|times| Px(times * radius));
        self.write(format_args!("M{x} {y}a{r} {r} 0 1 0 {there} 0a{r} {r} 0 1 0 {back} 0z"));
    }

    fn push(&mut self, command: char, to: DVec2) {
        self.write(format_args!("{command}{} {}", Px(to.x), Px(to.y)));
    }

    fn write(&mut self, text: fmt::Arguments<'_>) {
        // Writing to a String cannot fail.
        let _ = self.data.write_fmt(text);
    }

    pub(super) fn element(&self, style: &str) -> String {
        if self.is_empty() {
            return String::new();
        }
        format!("<path d=\"{}\" {style}/>\n", self.data)
    }
}

/// Takes `words` in XML, and further attributes as `style`.
pub(super) fn text(at: DVec2, style: &str, words: &str) -> String {
    format!("<text x=\"{}\" y=\"{}\"{style}>{words}</text>\n", Px(at.x), Px(at.y))
}

pub fn escape(text: &str, limit: usize) -> String {
    let mut escaped = String::new();
    for (nth, character) in text.chars().enumerate() {
        if nth + 1 >= limit && text.chars().nth(limit).is_some() {
            escaped.push('…');
            break;
        }
        match character {
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '&' => escaped.push_str("&amp;"),
            '"' => escaped.push_str("&quot;"),
            // XML 1.0 cannot represent these, even as references.
            '\u{fffe}' | '\u{ffff}' => escaped.push(' '),
            other if other.is_control() => escaped.push(' '),
            other => escaped.push(other),
        }
    }
    escaped
}

pub(super) fn ticks(low: f64, high: f64, step: f64) -> impl Iterator<Item = (f64, String)> {
    let digits = (-step.log10().floor()).clamp(0.0, 9.0) as usize;
    let first = (low / step - 1e-6).ceil();
    // About a dozen ticks fit; the bound ends the loop at any distance from 0. Adding 0 turns -0
    // into 0.
    (0..40)
        .map(move |nth| (first + f64::from(nth)) * step + 0.0)
        .take_while(move |value| *value <= high + step * 1e-6)
        .map(move |value| (value, format!("{value:.digits$}")))
}

/// Returns the next of 1, 2, 5, 10, 20, ... and their fractions that is at least `least`.
pub(super) fn round_up(least: f64) -> f64 {
    if !(least.is_finite() && least > 0.0) {
        return 1.0;
    }
    let decade = 10_f64.powf(least.log10().floor());
    [1.0, 2.0, 5.0]
        .into_iter()
        .map(|digit| digit * decade)
        // The slack keeps 0.2 from rounding up to 0.5.
        .find(|candidate| *candidate >= least * (1.0 - 1e-9))
        .unwrap_or(10.0 * decade)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_round_up_to_one_two_five() {
        for (least, step) in [(0.2, 0.2), (0.21, 0.5), (1.0, 1.0), (6.0, 10.0), (130.0, 200.0)] {
            assert!((round_up(least) - step).abs() < 1e-9, "{least}");
        }
        assert_eq!([f64::NAN, 0.0].map(round_up), [1.0; 2]);
    }

    #[test]
    fn coordinates_are_short_and_always_numbers() {
        let written =
            [12.0, -0.04, 2.345, f64::NAN, f64::INFINITY, 1e300].map(|value| Px(value).to_string());
        assert_eq!(written, ["12", "0", "2.3", "0", "0", "10000000"]);
    }

    #[test]
    fn a_line_is_cut_in_two_where_it_leaves_and_at_a_pose_that_is_no_place() {
        let view = View { low: DVec2::ZERO, side_m: 8.0 };
        let away = [[4.0, 4.0], [1e6, 4.0], [1e6, 5.0], [4.0, 5.0]].map(DVec2::from);
        assert_eq!(view.line(away).data, "M462 492L882 492M882 392L462 392");
        let holed = [1.0, 2.0, f64::NAN, 3.0, 4.0].map(|x| DVec2::new(x, 8.0));
        assert_eq!(view.line(holed).data, "M162 92L262 92M362 92L462 92");
    }

    #[test]
    fn text_is_escaped_and_cut() {
        assert_eq!(escape("a<b>&\"\u{1}", 9), "a&lt;b&gt;&amp;&quot; ");
        assert_eq!(["abcdef", "abcd"].map(|text| escape(text, 4)), ["abc…", "abcd"]);
    }
}
