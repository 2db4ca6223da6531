//! Around the plot: title, axes, legend, captions.

use common::geometry::Shapes;
use glam::DVec2;

use super::{
    bands::Levels,
    cells::BelievedHazard,
    motion::{self, Motion},
    page::{PLOT_LEFT, PLOT_SIDE, PLOT_TOP, Path, Px, View, WIDTH, escape, ink, round_up},
    scene::Scene,
    streamlines::arrowhead,
    world::{self, Outline},
};

/// Text without fonts of its own; digits of one width where the font has them.
pub(super) const FONT: &str = "system-ui, -apple-system, 'Segoe UI', Roboto, 'Helvetica Neue', Arial, \
     'DejaVu Sans', sans-serif";
/// Characters of 12 px that surely fit across the sheet.
const ACROSS: usize = 150;
/// Captions that are drawn.
const MOST_CAPTIONS: usize = 8;
/// Below the plot, before the first caption.
const BELOW: f64 = 58.0;
/// From one line of captions to the next.
const LINE: f64 = 18.0;

/// The start of the file: size, description, definitions.
pub(super) fn open(scene: &Scene<'_>) -> String {
    let lines = scene.captions.len().min(MOST_CAPTIONS) as f64;
    let height = PLOT_TOP + PLOT_SIDE + BELOW + lines * LINE;
    let name = escape(&scene.mission.name, ACROSS);
    let facts = facts(scene);
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {height}\" \
         width=\"{WIDTH}\" height=\"{height}\" role=\"img\" font-family=\"{FONT}\" \
         font-size=\"12.5\" fill=\"{}\">\n\
         <title>{name}</title>\n<desc>{facts}</desc>\n\
         {}<rect width=\"{WIDTH}\" height=\"{height}\" fill=\"#fff\"/>\n",
        ink::TEXT,
        definitions()
    )
}

/// Mission and outcome, and below them how it went.
pub(super) fn title(scene: &Scene<'_>) -> String {
    let colour = if scene.facts.reached {
        ink::TARGET
    } else {
        ink::FAILURE
    };
    format!(
        "<text x=\"{PLOT_LEFT}\" y=\"42\" font-size=\"25\" font-weight=\"700\">{}\
         <tspan dx=\"14\" font-weight=\"600\" fill=\"{colour}\">{}</tspan></text>\n\
         <text x=\"{PLOT_LEFT}\" y=\"69\" font-size=\"15\" fill=\"{}\">{}</text>\n",
        escape(&scene.mission.name, 44),
        escape(scene.facts.outcome, 24),
        ink::QUIET,
        facts(scene)
    )
}

fn facts(scene: &Scene<'_>) -> String {
    let facts = &scene.facts;
    let number = |value: f64, digits: usize| {
        if value.is_finite() {
            format!("{value:.digits$}")
        } else {
            "?".to_owned()
        }
    };
    let ratio = facts.path_length_m / facts.straight_m;
    let times = if ratio.is_finite() {
        format!(", {ratio:.2} × the straight {:.2} m", facts.straight_m)
    } else {
        String::new()
    };
    let events = match facts.safety_events {
        1 => "1 safety event".to_owned(),
        count => format!("{count} safety events"),
    };
    let mut parts = vec![
        format!("{} s", number(facts.mission_time_s, 1)),
        format!("path {} m{times}", number(facts.path_length_m, 2)),
        events,
    ];
    parts.extend(facts.seed.map(|seed| format!("seed {seed}")));
    parts.join("  ·  ")
}

/// The frame of the plot with ticks in metres.
pub(super) fn axes(view: &View) -> String {
    axes_in(view, 1.0)
}

/// The same with text `size` times as large, and as much fewer ticks.
fn axes_in(view: &View, size: f64) -> String {
    let step = round_up(view.side_m() * size / 12.0);
    let digits = (-step.log10().floor()).max(0.0) as usize;
    let low = view.low();
    let bottom = PLOT_TOP + PLOT_SIDE;
    let mut ticks = Path::default();
    let mut labels = String::new();
    for axis in 0..2 {
        let first = (low[axis] / step).ceil();
        let last = ((low[axis] + view.side_m()) / step).floor();
        // Twelve steps by construction; the bound holds however far from 0 the perimeter lies.
        for nth in (0..=20)
            .map(|nth| first + f64::from(nth))
            .take_while(|nth| *nth <= last)
        {
            let mut at = low;
            at[axis] = nth * step;
            let mark = view.place(at);
            let away = if axis == 0 { DVec2::Y } else { DVec2::NEG_X } * 6.0;
            ticks.move_to(mark);
            ticks.line_to(mark + away);
            let (x, y, anchor) = if axis == 0 {
                (mark.x, bottom + 8.0 + 12.0 * size, "middle")
            } else {
                (PLOT_LEFT - 10.0, mark.y + 4.5 * size, "end")
            };
            // Adding 0 turns -0 into 0.
            let value = nth * step + 0.0;
            labels += &format!(
                "<text x=\"{}\" y=\"{}\" text-anchor=\"{anchor}\">{value:.digits$}</text>\n",
                Px(x),
                Px(y)
            );
        }
    }
    let middle = PLOT_TOP + PLOT_SIDE / 2.0;
    let style = format!(
        "fill=\"none\" stroke=\"{}\" stroke-width=\"1.2\"",
        ink::TEXT
    );
    format!(
        "{}<rect x=\"{PLOT_LEFT}\" y=\"{PLOT_TOP}\" width=\"{PLOT_SIDE}\" height=\"{PLOT_SIDE}\" {style}/>\n\
         <g fill=\"{quiet}\" font-size=\"{}\">\n{labels}\
         <text x=\"{}\" y=\"{}\" text-anchor=\"middle\">x, metres</text>\n\
         <text transform=\"translate({} {middle}) rotate(-90)\" text-anchor=\"middle\">y, metres</text>\n\
         </g>\n",
        ticks.element(&style),
        Px(12.5 * size),
        PLOT_LEFT + PLOT_SIDE / 2.0,
        Px(bottom + 12.0 + 28.0 * size),
        Px(34.0 - 14.0 * size - 22.0 * (size - 1.0)),
        quiet = ink::QUIET
    )
}

/// Text of a figure, in that of a picture.
const LARGER: f64 = 1.75;
/// Left edge of a figure, and its width.
const FIGURE_LEFT: f64 = -32.0;
const FIGURE_WIDTH: f64 = PLOT_LEFT + PLOT_SIDE + 24.0 - FIGURE_LEFT;

/// The file of a figure: the plot, and its legend below it in two columns.
pub(super) fn figure(scene: &Scene<'_>, plot: &str, view: &View, legend: &Legend<'_>) -> String {
    let mut left = Column::at(DVec2::new(0.0, 16.0));
    legend.motion_rows(&mut left);
    legend.field_rows(&mut left);
    let mut right = Column::at(DVec2::new(252.0, 16.0));
    legend.hazard_rows(&mut right);
    let rows = left.y.max(right.y) * LARGER;
    let (top, below) = (PLOT_TOP - 16.0, PLOT_TOP + PLOT_SIDE + 78.0);
    let height = below + rows - top;
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"{FIGURE_LEFT} {top} {FIGURE_WIDTH} {height}\" \
         width=\"{FIGURE_WIDTH}\" height=\"{height}\" role=\"img\" font-family=\"{FONT}\" font-size=\"12.5\" fill=\"{}\">\n\
         <title>{}</title>\n<desc>{}</desc>\n{}\
         <rect x=\"{FIGURE_LEFT}\" y=\"{top}\" width=\"{FIGURE_WIDTH}\" height=\"{height}\" fill=\"#fff\"/>\n\
         {plot}{}<g transform=\"translate({PLOT_LEFT} {below}) scale({LARGER})\">\n{}{}</g>\n</svg>\n",
        ink::TEXT,
        escape(&scene.mission.name, ACROSS),
        facts(scene),
        definitions(),
        axes_in(view, LARGER),
        left.text,
        right.text,
    )
}

/// What the layers of the plot refer to.
fn definitions() -> String {
    format!(
        "<defs><clipPath id=\"plot\"><rect x=\"{PLOT_LEFT}\" y=\"{PLOT_TOP}\" \
         width=\"{PLOT_SIDE}\" height=\"{PLOT_SIDE}\"/></clipPath>{}</defs>\n",
        world::HATCH
    )
}

/// The lines below the plot.
pub(super) fn captions(scene: &Scene<'_>) -> String {
    let top = PLOT_TOP + PLOT_SIDE + BELOW + 6.0;
    (0..)
        .zip(scene.captions.iter().take(MOST_CAPTIONS))
        .map(|(nth, caption)| {
            format!(
                "<text x=\"{PLOT_LEFT}\" y=\"{}\" fill=\"{}\">{}</text>\n",
                Px(top + f64::from(nth) * LINE),
                ink::QUIET,
                escape(caption, ACROSS)
            )
        })
        .collect()
}

/// What the legend has to explain: only what is drawn.
pub(super) struct Legend<'a> {
    pub(super) view: &'a View,
    pub(super) levels: Option<Levels>,
    pub(super) guidance: bool,
    /// Whether from some cells that were believed free the target cannot be reached.
    pub(super) isolated: bool,
    pub(super) hazard: Option<&'a BelievedHazard>,
    pub(super) world: &'a Shapes,
    pub(super) motion: &'a Motion<'a>,
}

/// Left edge of the legend.
const COLUMN: f64 = PLOT_LEFT + PLOT_SIDE + 30.0;
/// From one row to the next.
const ROW: f64 = 25.0;
/// Middle of the symbols, and where their text starts, from the left edge of a column.
const SYMBOL: f64 = 19.0;
const WORDS: f64 = 50.0;

impl Legend<'_> {
    /// The layer.
    pub(super) fn layer(&self) -> String {
        let mut column = Column::at(DVec2::new(COLUMN, PLOT_TOP + 10.0));
        self.motion_rows(&mut column);
        self.hazard_rows(&mut column);
        self.field_rows(&mut column);
        column.text + &self.scale_bar()
    }

    fn field_rows(&self, column: &mut Column) {
        if self.guidance {
            column.heading("Field of that belief");
        }
        if self.guidance {
            column.row("guidance E", guidance_symbol);
        }
        if self.isolated {
            column.row("no way to the target", |at| {
                patch(
                    at,
                    &format!(
                        "fill=\"{}\" stroke=\"{}\" stroke-width=\"0.6\"",
                        ink::NOWHERE,
                        ink::QUIET
                    ),
                )
            });
        }
        if let Some(levels) = self.levels {
            column.text += &colour_bar(levels, column.x, column.y);
            column.y += COLOUR_BAR;
        }
    }

    fn motion_rows(&self, column: &mut Column) {
        column.heading("Motion");
        let line = |style: String| {
            move |at: DVec2| {
                let mut path = Path::default();
                path.move_to(at - DVec2::X * 17.0);
                path.line_to(at + DVec2::X * 17.0);
                path.element(&style)
            }
        };
        let body = |style: String| {
            move |at: DVec2| {
                let mut path = Path::default();
                motion::add_body(&mut path, at, 9.0, 0.0);
                path.element(&style)
            }
        };
        if self.motion.has_truth() {
            column.row("true trajectory", line(motion::truth_line()));
        }
        if self.motion.has_belief() {
            column.row("believed trajectory", line(motion::believed_line()));
        }
        if let Some(seconds) = self.motion.period_s() {
            column.row(
                &format!("robot, every {seconds} s"),
                body(motion::BODY.to_owned()),
            );
        }
        if self.motion.has_truth() || self.motion.has_belief() {
            column.row("robot at the end", body(motion::final_body()));
        }
        if self.motion.has_covariance() {
            column.row("95 % of the believed end", |at: DVec2| {
                let mut path = Path::default();
                path.circle(at, 9.0);
                path.element(&motion::region_style())
            });
        }
        column.row("start", motion::start_mark);
        column.row("target, tolerance", |at| motion::target(at, 9.5));
    }

    fn hazard_rows(&self, column: &mut Column) {
        let cell = |colour: &'static str| move |at: DVec2| patch(at, &format!("fill=\"{colour}\""));
        if let Some(hazard) = self.hazard {
            column.heading("Believed hazardous");
            if hazard.has_sensed() {
                column.row("sensed, with margin", cell(ink::SENSED));
            }
            if hazard.has_known() {
                column.row("known beforehand", cell(ink::KNOWN));
            }
            if hazard.has_perimeter() {
                column.row("perimeter", cell(ink::PERIMETER));
            }
        }
        if !self.world.is_empty() {
            column.heading("Really there");
            for outline in Outline::ALL
                .into_iter()
                .filter(|outline| outline.is_in(self.world))
            {
                column.row(outline.name(), |at| patch(at, &outline.solid()));
            }
        }
    }

    /// A round length of a sixth to a third of the plot, in the lower corner.
    fn scale_bar(&self) -> String {
        let length = round_up(self.view.side_m() / 8.0);
        let (y, right) = (PLOT_TOP + PLOT_SIDE - 4.0, COLUMN + self.view.px(length));
        let mut bar = Path::default();
        bar.move_to(DVec2::new(COLUMN, y - 8.0));
        bar.line_to(DVec2::new(COLUMN, y));
        bar.line_to(DVec2::new(right, y));
        bar.line_to(DVec2::new(right, y - 8.0));
        bar.element(&format!(
            "fill=\"none\" stroke=\"{}\" stroke-width=\"1.6\"",
            ink::TEXT
        )) + &format!(
            "<text x=\"{}\" y=\"{}\" text-anchor=\"middle\">{length} m</text>\n",
            Px((COLUMN + right) / 2.0),
            Px(y - 7.0)
        )
    }
}

/// A column of rows that grows downwards.
struct Column {
    x: f64,
    y: f64,
    text: String,
}

impl Column {
    /// An empty one.
    const fn at(corner: DVec2) -> Self {
        Self {
            x: corner.x,
            y: corner.y,
            text: String::new(),
        }
    }

    fn heading(&mut self, words: &str) {
        // The first one stands at the top of the plot, the others apart from what is above.
        if !self.text.is_empty() {
            self.y += 14.0;
        }
        self.text += &format!(
            "<text x=\"{}\" y=\"{}\" font-size=\"14\" font-weight=\"600\">{words}</text>\n",
            Px(self.x),
            Px(self.y)
        );
        self.y += ROW;
    }

    fn row(&mut self, words: &str, symbol: impl FnOnce(DVec2) -> String) {
        self.text += &symbol(DVec2::new(self.x + SYMBOL, self.y - 4.0));
        self.text += &format!(
            "<text x=\"{}\" y=\"{}\">{words}</text>\n",
            Px(self.x + WORDS),
            Px(self.y)
        );
        self.y += ROW;
    }
}

fn patch(at: DVec2, style: &str) -> String {
    let mut path = Path::default();
    let size = DVec2::new(30.0, 15.0);
    path.rectangle(at - size / 2.0, size);
    path.element(style)
}

fn guidance_symbol(at: DVec2) -> String {
    let mut line = Path::default();
    line.move_to(at - DVec2::X * 17.0);
    line.line_to(at + DVec2::X * 17.0);
    let mut head = Path::default();
    head.polygon(arrowhead(at, DVec2::X));
    let colour = ink::GUIDANCE;
    line.element(&format!("stroke=\"{colour}\" stroke-width=\"1\""))
        + &head.element(&format!("fill=\"{colour}\""))
}

/// Height of the colour bar with its words.
const COLOUR_BAR: f64 = 80.0;

/// The bands with the values between them.
fn colour_bar(levels: Levels, left: f64, y: f64) -> String {
    const LENGTH: f64 = 216.0;
    let bands = levels.count + 1;
    let width = LENGTH / f64::from(bands);
    let edge = |nth: u32| left + LENGTH - f64::from(nth) * width;
    let mut text = format!(
        "<text x=\"{left}\" y=\"{}\">log<tspan font-size=\"9\" dy=\"3\">2</tspan>\
         <tspan dx=\"3\" dy=\"-3\">u, where u is the chance that</tspan></text>\n",
        Px(y)
    );
    for (nth, words) in [
        (1.0, "a random walk meets the"),
        (2.0, "target before a hazard"),
    ] {
        text += &format!(
            "<text x=\"{left}\" y=\"{}\">{words}</text>\n",
            Px(y + nth * 17.0)
        );
    }
    let top = y + 45.0;
    for nth in 0..bands {
        text += &format!(
            "<rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"13\" fill=\"{}\"/>\n",
            Px(edge(nth + 1)),
            Px(top),
            Px(width),
            levels.colour(nth)
        );
    }
    // Labels at every so many levels: as many as their longest leaves room for.
    let longest = format!("-{}", levels.step * f64::from(levels.count)).len() as f64;
    let apart = ((longest * 7.0 + 14.0) / width).ceil().max(1.0) as usize;
    for nth in (0..=levels.count).step_by(apart) {
        let value = 0.0 - levels.step * f64::from(nth);
        text += &format!(
            "<text x=\"{}\" y=\"{}\" font-size=\"11\" text-anchor=\"middle\" fill=\"{}\">{value}</text>\n",
            Px(edge(nth)),
            Px(top + 27.0),
            ink::QUIET
        );
    }
    text
}
