use common::geometry::Shapes;
use glam::DVec2;

use super::{
    bands::Levels,
    cells::BelievedHazard,
    motion::{self, Motion},
    movers::{self, Movers},
    page::{PLOT_LEFT, PLOT_SIDE, PLOT_TOP, Path, Px, View, ink, round_up, text},
    streamlines::arrowhead,
    world::Outline,
};

pub(super) struct Legend<'a> {
    pub view: &'a View,
    pub levels: Option<Levels>,
    pub guidance: bool,
    /// Whether the target is unreachable from some free cells of the map.
    pub isolated: bool,
    pub hazard: Option<&'a BelievedHazard>,
    pub world: &'a Shapes,
    pub motion: &'a Motion<'a>,
    pub movers: &'a Movers<'a>,
}

const COLUMN: f64 = PLOT_LEFT + PLOT_SIDE + 30.0;
const ROW: f64 = 25.0;
/// Middle of the symbols and start of their text in a column.
const SYMBOL: f64 = 19.0;
const WORDS: f64 = 50.0;

impl Legend<'_> {
    pub(super) fn layer(&self) -> String {
        let mut column = Column { at: DVec2::new(COLUMN, PLOT_TOP + 10.0), text: String::new() };
        self.motion_rows(&mut column);
        self.hazard_rows(&mut column);
        self.field_rows(&mut column);
        column.text + &self.scale_bar()
    }

    fn field_rows(&self, column: &mut Column) {
        if self.guidance {
            column.heading("Field of that belief");
            column.row("guidance E", guidance_symbol);
        }
        if self.isolated {
            let style =
                format!("fill=\"{}\" stroke=\"{}\" stroke-width=\"0.6\"", ink::NOWHERE, ink::QUIET);
            column.row("no path to the target", |at| patch(at, &style));
        }
        if let Some(levels) = self.levels {
            column.text += &colour_bar(levels, column.at);
            column.at.y += COLOUR_BAR;
        }
    }

    fn motion_rows(&self, column: &mut Column) {
        column.heading("Motion");
        let line = |style: String| move |at: DVec2| line(at, &style);
        let circle = |style: String| {
            move |at: DVec2| {
                let mut path = Path::default();
                path.circle(at, 9.0);
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
            column.row(&format!("robot, every {seconds} s"), body(motion::BODY.to_owned()));
        }
        if self.motion.has_truth() || self.motion.has_belief() {
            column.row("robot at the end", body(motion::final_body()));
        }
        if self.motion.has_covariance() {
            column.row("95 % of the believed end", circle(motion::region_style()));
        }
        if !self.movers.is_empty() {
            column.row("path of what moves", line(movers::line()));
        }
        if let Some(seconds) = self.movers.period_s() {
            column.row(&format!("it and the robot at {seconds} s"), |at| {
                circle(movers::disc())(at) + &movers::number(at, seconds)
            });
        }
        column.row("start", motion::start_mark);
        column.row("target, tolerance", |at| motion::target(at, 9.5));
    }

    fn hazard_rows(&self, column: &mut Column) {
        let cell = |colour: &'static str| move |at: DVec2| patch(at, &format!("fill=\"{colour}\""));
        if let Some(hazard) = self.hazard {
            column.heading("Believed hazardous");
            for (colour, words, area) in hazard.0.iter().rev() {
                if !area.is_empty() {
                    column.row(words, cell(colour));
                }
            }
        }
        if !self.world.is_empty() {
            column.heading("Really there");
            for outline in Outline::ALL.into_iter().filter(|outline| outline.is_in(self.world)) {
                column.row(outline.name(), |at| patch(at, &outline.solid()));
            }
        }
    }

    /// Draws a round length, a sixth to a third of the plot.
    fn scale_bar(&self) -> String {
        let length = round_up(self.view.side_m / 8.0);
        let (y, right) = (PLOT_TOP + PLOT_SIDE - 4.0, COLUMN + self.view.px(length));
        let mut bar = Path::default();
        let corners = [(COLUMN, y - 8.0), (COLUMN, y), (right, y), (right, y - 8.0)];
        bar.polyline(corners.map(DVec2::from));
        bar.element(&format!("fill=\"none\" stroke=\"{}\" stroke-width=\"1.6\"", ink::TEXT))
            + &text(
                DVec2::new((COLUMN + right) / 2.0, y - 7.0),
                " text-anchor=\"middle\"",
                &format!("{length} m"),
            )
    }
}

struct Column {
    /// Place of the next row.
    at: DVec2,
    text: String,
}

impl Column {
    fn heading(&mut self, words: &str) {
        // The first group starts at the plot's top, the others below a gap.
        if !self.text.is_empty() {
            self.at.y += 14.0;
        }
        self.text += &text(self.at, " font-size=\"14\" font-weight=\"600\"", words);
        self.at.y += ROW;
    }

    fn row(&mut self, words: &str, symbol: impl FnOnce(DVec2) -> String) {
        self.text += &symbol(self.at + DVec2::new(SYMBOL, -4.0));
        self.text += &text(self.at + DVec2::X * WORDS, "", words);
        self.at.y += ROW;
    }
}

fn patch(at: DVec2, style: &str) -> String {
    let mut path = Path::default();
    let size = DVec2::new(30.0, 15.0);
    path.rectangle(at - size / 2.0, size);
    path.element(style)
}

fn line(at: DVec2, style: &str) -> String {
    let mut path = Path::default();
    path.polyline([at - DVec2::X * 17.0, at + DVec2::X * 17.0]);
    path.element(style)
}

fn guidance_symbol(at: DVec2) -> String {
    let mut head = Path::default();
    head.polygon(arrowhead(at, DVec2::X));
    let colour = ink::GUIDANCE;
    line(at, &format!("stroke=\"{colour}\" stroke-width=\"1\""))
        + &head.element(&format!("fill=\"{colour}\""))
}

const COLOUR_BAR: f64 = 80.0;

fn colour_bar(levels: Levels, corner: DVec2) -> String {
    const LENGTH: f64 = 216.0;
    let bands = levels.count + 1;
    let width = LENGTH / f64::from(bands);
    let edge = |nth: u32| corner.x + LENGTH - f64::from(nth) * width;
    let at = |x: f64, down: f64| DVec2::new(x, corner.y + down);
    let mut bar = text(
        corner,
        "",
        "log<tspan font-size=\"9\" dy=\"3\">2</tspan>\
         <tspan dx=\"3\" dy=\"-3\">u, where u is the chance that</tspan>",
    );
    bar += &text(at(corner.x, 17.0), "", "a random walk meets the");
    bar += &text(at(corner.x, 34.0), "", "target before a hazard");
    for nth in 0..bands {
        bar += &format!(
            "<rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"13\" fill=\"{}\"/>\n",
            Px(edge(nth + 1)),
            Px(corner.y + 45.0),
            Px(width),
            levels.colour(nth)
        );
    }
    // Labels are spaced for the longest one.
    let longest = format!("-{}", levels.step * f64::from(levels.count)).len() as f64;
    let apart = ((longest * 7.0 + 14.0) / width).ceil().max(1.0) as usize;
    let style = format!(" font-size=\"11\" text-anchor=\"middle\" fill=\"{}\"", ink::QUIET);
    for nth in (0..=levels.count).step_by(apart) {
        let value = 0.0 - levels.step * f64::from(nth);
        bar += &text(at(edge(nth), 72.0), &style, &value.to_string());
    }
    bar
}
