//! Pictures of runs and of fields on maps, as self-contained SVG files.
//!
//! Layers from bottom to top, in the mission frame (metres, y up): `bands` of log2 u of the final
//! belief, `streamlines` of E, hazard `cells`, the real `world`, `motion`, `movers`, then `margin`
//! and `legend`. `map` draws the field of a bare map, `points` the points that a robot saw.
//!
//! Only the frame layer is mandatory, and every input gives a valid file.

mod bands;
mod cells;
mod lattice;
mod legend;
mod map;
mod margin;
mod motion;
mod movers;
mod page;
mod points;
mod scene;
mod streamlines;
#[cfg(test)]
mod tests;
mod world;

use common::{
    grid::{CellState, GridFrame},
    samples::FieldCell,
};

pub use self::{
    map::{FieldOnMap, map_svg},
    page::escape,
    points::points_svg,
    scene::{Facts, Scene, Trail},
};

use self::{
    bands::Bands,
    cells::BelievedHazard,
    lattice::Lattice,
    legend::Legend,
    motion::Motion,
    movers::Movers,
    page::{PLOT_LEFT, PLOT_SIDE, PLOT_TOP, View, ink},
};

fn has_isolated_cells(
    grid: Option<(GridFrame, &[u8])>,
    field: Option<(GridFrame, &[FieldCell])>,
) -> bool {
    let (Some((grid_frame, states)), Some((field_frame, policy))) = (grid, field) else {
        return false;
    };
    // At the end of a run the field may lag by one grid version, in the same frame.
    grid_frame == field_frame
        && states.iter().zip(policy).any(|(&state, policy)| {
            !CellState::from_byte(state).is_hazard() && policy.log2_u == f32::NEG_INFINITY
        })
}

pub fn svg(scene: &Scene<'_>) -> String {
    let view = View::of(&scene.mission.grid_frame());
    let field = scene.field.filter(|(frame, cells)| cells.len() == frame.area());
    let grid = scene.grid.filter(|(frame, cells)| cells.len() == frame.area());

    let lattice = |frame| Lattice::of_mission(&frame, &view);
    let bands = field.and_then(|(frame, cells)| Bands::of(&lattice(frame), cells, &bands::MISSION));
    let lines = field
        .map(|(frame, cells)| streamlines::layer(&lattice(frame), cells, &streamlines::MISSION));
    let hazard = grid.map(|(frame, cells)| BelievedHazard::of(&lattice(frame), cells));
    let motion = Motion::of(scene);
    let movers = Movers::of(scene, &motion);
    let legend = Legend {
        view: &view,
        levels: bands.as_ref().map(|bands| bands.levels),
        guidance: lines.is_some(),
        isolated: has_isolated_cells(grid, field),
        hazard: hazard.as_ref(),
        world: &scene.mission.world,
        motion: &motion,
        movers: &movers,
    };

    let drawn: String = [
        bands.as_ref().map(Bands::layer),
        lines,
        hazard.as_ref().map(BelievedHazard::layer),
        Some(world::layer(&view, &scene.mission.world)),
        Some(motion.layer(&view)),
        Some(movers.layer(&view)),
    ]
    .into_iter()
    .flatten()
    .collect();
    let plot = format!(
        "<g clip-path=\"url(#plot)\">\n\
         <rect x=\"{PLOT_LEFT}\" y=\"{PLOT_TOP}\" width=\"{PLOT_SIDE}\" height=\"{PLOT_SIDE}\" fill=\"{}\"/>\n\
         {drawn}</g>\n",
        ink::NOWHERE
    );
    [
        margin::open(&scene.mission.name, &margin::facts(scene), scene.captions.len()),
        plot,
        margin::title(scene),
        margin::axes(&view),
        legend.layer(),
        margin::captions(scene),
        "</svg>\n".to_owned(),
    ]
    .concat()
}
