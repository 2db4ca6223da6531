//! What is really there, over what was believed: dark outlines and a hatch, so that both show.

use common::geometry::Shapes;

use super::page::{Path, View, ink};

/// The hatch, to be named in `<defs>`.
pub(super) const HATCH: &str = "<pattern id=\"hatch\" width=\"6\" height=\"6\" \
     patternUnits=\"userSpaceOnUse\" patternTransform=\"rotate(45)\">\
     <path d=\"M0 0V6\" stroke=\"#27313b\" stroke-width=\"2.2\" stroke-opacity=\"0.6\"/></pattern>";

/// Attributes of everything solid.
pub(super) fn solid() -> String {
    format!(
        "fill=\"url(#hatch)\" stroke=\"{}\" stroke-width=\"1.6\" stroke-linejoin=\"round\"",
        ink::WORLD
    )
}

/// The layer.
pub(super) fn layer(view: &View, world: &Shapes) -> String {
    let mut bodies = Path::default();
    for drum in &world.drums {
        if view.shows(drum.at, drum.radius_m) {
            bodies.circle(view.place(drum.at), view.px(drum.radius_m));
        }
    }
    for block in &world.boxes {
        if view.shows(block.at, block.size_m.length()) {
            bodies.polygon(block.corners().map(|corner| view.place(corner)));
        }
    }
    let walls: String = world
        .walls
        .iter()
        .map(|wall| {
            view.line(wall.points.iter().copied()).element(&format!(
                "fill=\"none\" stroke=\"{}\" stroke-width=\"3.2\" stroke-linejoin=\"round\" \
                 stroke-linecap=\"round\"",
                ink::WORLD
            ))
        })
        .collect();
    bodies.element(&solid()) + &walls
}
