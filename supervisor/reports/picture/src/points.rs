use glam::DVec2;

use super::{
    margin, motion,
    page::{PLOT_LEFT, Path, View, escape, ink, text},
};

/// Distance limit of points, metres, to keep the others visible.
const FARTHEST_M: f64 = 1e4;

/// Draws `points`, metres, around the robot's first place.
pub fn points_svg(title: &str, description: &str, points: &[DVec2]) -> String {
    let is_near = |at: &DVec2| at.abs().cmplt(DVec2::splat(FARTHEST_M)).all();
    let points: Vec<DVec2> = points.iter().copied().filter(is_near).collect();
    let view = View::around(&points);
    let mut marks = Path::default();
    points.iter().for_each(|at| marks.circle(view.place(*at), 1.7));
    let line = |y: f64, style: &str, words: &str| {
        text(DVec2::new(PLOT_LEFT, y), style, &escape(words, usize::MAX))
    };
    [
        margin::open(title, description, 0),
        line(42.0, " font-size=\"25\" font-weight=\"700\"", title),
        line(69.0, " font-size=\"15\"", description),
        marks.element(&format!("fill=\"{}\"", ink::TRUTH)),
        motion::start_mark(view.place(DVec2::ZERO)),
        margin::axes(&view),
        "</svg>\n".to_owned(),
    ]
    .concat()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_points_give_a_file_with_its_axes_and_the_far_ones_are_left_out() {
        let odd = [f64::NAN, f64::INFINITY, -1e300, 1e300, 0.0, -0.0, 1e-300];
        let odd: Vec<_> = odd.iter().flat_map(|&x| odd.map(|y| DVec2::new(x, y))).collect();
        for (points, marks) in [(odd, 9), (Vec::new(), 0), (vec![DVec2::new(1.0, 2.0)], 1)] {
            let svg = points_svg("beams & echoes", "seen at < 10 m", &points);
            assert!(svg.contains(">x, metres<") && svg.contains(">beams &amp; echoes<"), "{svg}");
            assert_eq!(svg.matches("a1.7 1.7").count(), 2 * marks, "{svg}");
            roxmltree::Document::parse(&svg).unwrap();
        }
    }
}
