//! The picture a run ends with: one SVG file that needs nothing but itself. And the picture of a field on a map.
//!
//! From the bottom of the page to its top, everything in the mission frame (metres, y up):
//!
//! | module | draws |
//! |---|---|
//! | [`bands`] | log2 u of the final belief, in bands between level sets |
//! | [`streamlines`] | lines of the guidance field E |
//! | [`cells`] | what was believed hazardous |
//! | [`world`] | what is really there |
//! | [`motion`] | trajectories, the robot at regular times, start, target |
//! | [`margin`] | title, axes, legend, captions |
//! | [`page`], [`lattice`] | the sheet all of them draw on, and how cells lie on it |
//!
//! [`map`] draws the field of a bare map with the same bands and lines, [`raster`] makes it a PNG.
//!
//! A picture is made of what came in until the end, however the end came: every layer but the frame
//! may be missing, and no input makes a file that cannot be read.

mod bands;
mod cells;
mod lattice;
mod map;
mod margin;
mod motion;
mod page;
mod raster;
mod streamlines;
#[cfg(test)]
mod tests;
mod world;

use common::{
    grid::{CellState, GridFrame},
    kinematics::Pose2,
    mission::Mission,
    samples::FieldCell,
};

pub use self::{
    map::{FieldOnMap, map_svg},
    raster::png,
};

use self::{
    bands::Bands,
    cells::BelievedHazard,
    lattice::Lattice,
    margin::Legend,
    motion::Motion,
    page::{PLOT_LEFT, PLOT_SIDE, PLOT_TOP, View, ink},
};

/// What there is to draw.
pub struct Scene<'a> {
    /// The mission: target, world, body, perimeter.
    pub mission: &'a Mission,
    /// The final belief: one [`common::grid::CellState`] byte a cell, row-major.
    pub grid: Option<(GridFrame, &'a [u8])>,
    /// The field of that belief, row-major.
    pub field: Option<(GridFrame, &'a [FieldCell])>,
    /// Where dead reckoning put the robot, at equal steps of mission time from its beginning.
    pub believed: &'a [Pose2],
    /// Where the robot really was, likewise; empty with a real robot.
    pub truth: &'a [Pose2],
    /// How the run went.
    pub facts: Facts<'a>,
    /// Lines below the picture; each is cut where the page ends.
    pub captions: &'a [String],
}

/// The numbers of the title line.
#[derive(Clone, Copy, Debug)]
pub struct Facts<'a> {
    /// In a word: reached, unreachable, timeout, ...
    pub outcome: &'a str,
    /// Whether that is what was wanted.
    pub reached: bool,
    /// Mission time, seconds.
    pub mission_time_s: f64,
    /// Length of the way driven, metres.
    pub path_length_m: f64,
    /// From start to target as the crow flies, metres.
    pub straight_m: f64,
    /// Range samples that put a hazard on the map.
    pub safety_events: u64,
    /// Seed of the simulation; none with a real robot.
    pub seed: Option<u64>,
}

/// Whether any cell believed free cannot reach the target.
fn has_isolated_cells(
    grid: Option<(GridFrame, &[u8])>,
    field: Option<(GridFrame, &[FieldCell])>,
) -> bool {
    let (Some((grid_frame, states)), Some((field_frame, policy))) = (grid, field) else {
        return false;
    };
    // The field follows the grid: at the end of a run it may be one version behind, never elsewhere.
    grid_frame == field_frame
        && states.iter().zip(policy).any(|(&state, policy)| {
            !CellState::from_byte(state).is_hazard() && policy.log2_u == f32::NEG_INFINITY
        })
}

/// `scene` as the text of an SVG file.
pub fn svg(scene: &Scene<'_>) -> String {
    let view = View::of(&scene.mission.grid_frame());
    let field = scene
        .field
        .filter(|(frame, cells)| cells.len() == frame.area());
    let grid = scene
        .grid
        .filter(|(frame, cells)| cells.len() == frame.area());

    let lattice = |frame| Lattice::of_mission(&frame, &view);
    let bands = field.and_then(|(frame, cells)| Bands::of(&lattice(frame), cells, &bands::MISSION));
    let lines = field
        .map(|(frame, cells)| streamlines::layer(&lattice(frame), cells, &streamlines::MISSION));
    let hazard = grid.map(|(frame, cells)| BelievedHazard::of(&lattice(frame), cells));
    let motion = Motion::of(scene);
    let legend = Legend {
        view: &view,
        levels: bands.as_ref().map(Bands::levels),
        guidance: lines.is_some(),
        isolated: has_isolated_cells(grid, field),
        hazard: hazard.as_ref(),
        world: !scene.mission.world.is_empty(),
        motion: &motion,
    };

    let layers = [
        bands.as_ref().map(Bands::layer),
        lines,
        hazard.as_ref().map(BelievedHazard::layer),
        Some(world::layer(&view, &scene.mission.world)),
        Some(motion.layer(&view)),
    ];
    let drawn: String = layers.into_iter().flatten().collect();
    let plot = format!(
        "<g clip-path=\"url(#plot)\">\n\
         <rect x=\"{PLOT_LEFT}\" y=\"{PLOT_TOP}\" width=\"{PLOT_SIDE}\" height=\"{PLOT_SIDE}\" fill=\"{}\"/>\n\
         {drawn}</g>\n",
        ink::NOWHERE
    );
    [
        margin::open(scene),
        plot,
        margin::title(scene),
        margin::axes(&view),
        legend.layer(),
        margin::captions(scene),
        "</svg>\n".to_owned(),
    ]
    .concat()
}
