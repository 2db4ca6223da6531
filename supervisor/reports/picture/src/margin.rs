use glam::DVec2;

use super::{
    page::{
        PLOT_LEFT, PLOT_SIDE, PLOT_TOP, Path, Px, View, WIDTH, escape, ink, round_up, text, ticks,
    },
    scene::Scene,
    world,
};

/// Font of all text, where available with digits of equal width.
const FONT: &str = "system-ui, -apple-system, 'Segoe UI', Roboto, 'Helvetica Neue', Arial, \
     'DejaVu Sans', sans-serif";
/// Characters of 12 px that fit across the sheet.
const ACROSS: usize = 150;
const MOST_CAPTIONS: usize = 8;
/// Distance from the plot to the first caption.
const BELOW: f64 = 58.0;
const LINE: f64 = 18.0;

pub(super) fn open(name: &str, description: &str, captions: usize) -> String {
    let lines = captions.min(MOST_CAPTIONS) as f64;
    let height = PLOT_TOP + PLOT_SIDE + BELOW + lines * LINE;
    let (name, description) = (escape(name, ACROSS), escape(description, usize::MAX));
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {height}\" \
         width=\"{WIDTH}\" height=\"{height}\" role=\"img\" font-family=\"{FONT}\" \
         font-size=\"12.5\" fill=\"{}\">\n\
         <title>{name}</title>\n<desc>{description}</desc>\n\
         <defs><clipPath id=\"plot\"><rect x=\"{PLOT_LEFT}\" y=\"{PLOT_TOP}\" \
         width=\"{PLOT_SIDE}\" height=\"{PLOT_SIDE}\"/></clipPath>{}</defs>\n\
         <rect width=\"{WIDTH}\" height=\"{height}\" fill=\"#fff\"/>\n",
        ink::TEXT,
        world::HATCH
    )
}

pub(super) fn title(scene: &Scene<'_>) -> String {
    let colour = if scene.facts.reached { ink::TARGET } else { ink::FAILURE };
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

pub(super) fn facts(scene: &Scene<'_>) -> String {
    let facts = &scene.facts;
    let number = |value: f64, digits: usize| {
        if value.is_finite() { format!("{value:.digits$}") } else { "?".to_owned() }
    };
    let ratio = facts.path_length_m / facts.straight_m;
    let times = if ratio.is_finite() {
        format!(", {ratio:.2} × the straight {:.2} m", facts.straight_m)
    } else {
        String::new()
    };
    let mut parts = vec![
        format!("{} s", number(facts.mission_time_s, 1)),
        format!("path {} m{times}", number(facts.path_length_m, 2)),
        format!("hazards mapped {} times", facts.safety_events),
    ];
    parts.extend(facts.seed.map(|seed| format!("seed {seed}")));
    parts.join("  ·  ")
}

pub(super) fn axes(view: &View) -> String {
    let step = round_up(view.side_m / 12.0);
    let low = view.low;
    let bottom = PLOT_TOP + PLOT_SIDE;
    let mut marks = Path::default();
    let mut labels = String::new();
    for axis in 0..2 {
        for (value, number) in ticks(low[axis], low[axis] + view.side_m, step) {
            let mut at = low;
            at[axis] = value;
            let mark = view.place(at);
            let away = if axis == 0 { DVec2::Y } else { DVec2::NEG_X } * 6.0;
            marks.polyline([mark, mark + away]);
            let (at, anchor) = if axis == 0 {
                (DVec2::new(mark.x, bottom + 20.0), " text-anchor=\"middle\"")
            } else {
                (DVec2::new(PLOT_LEFT - 10.0, mark.y + 4.5), " text-anchor=\"end\"")
            };
            labels += &text(at, anchor, &number);
        }
    }
    let middle = PLOT_TOP + PLOT_SIDE / 2.0;
    let style = format!("fill=\"none\" stroke=\"{}\" stroke-width=\"1.2\"", ink::TEXT);
    format!(
        "{}<rect x=\"{PLOT_LEFT}\" y=\"{PLOT_TOP}\" width=\"{PLOT_SIDE}\" height=\"{PLOT_SIDE}\" {style}/>\n\
         <g fill=\"{quiet}\" font-size=\"{}\">\n{labels}\
         <text x=\"{}\" y=\"{}\" text-anchor=\"middle\">x, metres</text>\n\
         <text transform=\"translate({} {middle}) rotate(-90)\" text-anchor=\"middle\">y, metres</text>\n\
         </g>\n",
        marks.element(&style),
        Px(12.5),
        PLOT_LEFT + PLOT_SIDE / 2.0,
        Px(bottom + 40.0),
        Px(20.0),
        quiet = ink::QUIET
    )
}

pub(super) fn captions(scene: &Scene<'_>) -> String {
    let top = PLOT_TOP + PLOT_SIDE + BELOW + 6.0;
    let style = format!(" fill=\"{}\"", ink::QUIET);
    let line = |(nth, caption): (u32, &String)| {
        let at = DVec2::new(PLOT_LEFT, top + f64::from(nth) * LINE);
        text(at, &style, &escape(caption, ACROSS))
    };
    (0..).zip(scene.captions.iter().take(MOST_CAPTIONS)).map(line).collect()
}
