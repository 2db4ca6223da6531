//! Real shapes over the robot's map, in dark outlines and a hatch.
//!
//! Shapes that do not span the robot's height have dashed outlines, glass dash-dotted ones, sound
//! absorbers dotted ones.

use common::geometry::{Light, Profile, Shapes};

use super::page::{Path, View, ink};

pub(super) const HATCH: &str = "<pattern id=\"hatch\" width=\"6\" height=\"6\" \
     patternUnits=\"userSpaceOnUse\" patternTransform=\"rotate(45)\">\
     <path d=\"M0 0V6\" stroke=\"#27313b\" stroke-width=\"2.2\" stroke-opacity=\"0.6\"/></pattern>";

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Outline {
    /// Hard, from the floor to above the robot.
    Full,
    /// Lower than that, or above the floor.
    Partial,
    Glass,
    /// Sound-absorbing, as high as the robot.
    Soft,
}

impl Outline {
    pub(super) const ALL: [Self; 4] = [Self::Full, Self::Partial, Self::Glass, Self::Soft];

    fn of(profile: Profile) -> Self {
        if profile.bottom_m > 0.0 || profile.top_m.is_finite() {
            Self::Partial
        } else if profile.light == Light::Glass {
            Self::Glass
        } else if profile.echo < 1.0 {
            Self::Soft
        } else {
            Self::Full
        }
    }

    pub(super) fn is_in(self, world: &Shapes) -> bool {
        let drums = world.drums.iter().map(|drum| drum.profile());
        let walls = world.walls.iter().map(|wall| wall.profile());
        let boxes = world.boxes.iter().map(|block| block.profile());
        drums.chain(walls).chain(boxes).any(|profile| Self::of(profile) == self)
    }

    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::Full => "drum, box, wall",
            Self::Partial => "low or overhanging",
            Self::Glass => "glass",
            Self::Soft => "absorbs sound",
        }
    }

    const fn dashes(self) -> &'static str {
        match self {
            Self::Full => "",
            Self::Partial => " stroke-dasharray=\"7 4\"",
            Self::Glass => " stroke-dasharray=\"9 3 2 3\"",
            Self::Soft => " stroke-dasharray=\"1.6 3.2\"",
        }
    }

    pub(super) fn solid(self) -> String {
        format!(
            "fill=\"url(#hatch)\" stroke=\"{}\" stroke-width=\"1.6\" stroke-linejoin=\"round\"{}",
            ink::WORLD,
            self.dashes()
        )
    }

    fn line(self) -> String {
        // Round caps would close the gaps between dots.
        let cap = if self == Self::Full { "round" } else { "butt" };
        format!(
            "fill=\"none\" stroke=\"{}\" stroke-width=\"3.2\" stroke-linejoin=\"round\" \
             stroke-linecap=\"{cap}\"{}",
            ink::WORLD,
            self.dashes()
        )
    }
}

pub(super) fn layer(view: &View, world: &Shapes) -> String {
    Outline::ALL.map(|outline| outlined(view, world, outline)).concat()
}

fn outlined(view: &View, world: &Shapes, outline: Outline) -> String {
    let mut bodies = Path::default();
    let has_it = |profile| Outline::of(profile) == outline;
    for drum in world.drums.iter().filter(|drum| has_it(drum.profile())) {
        if view.shows(drum.at, drum.radius_m) {
            bodies.circle(view.place(drum.at), view.px(drum.radius_m));
        }
    }
    for block in world.boxes.iter().filter(|block| has_it(block.profile())) {
        if view.shows(block.at, block.size_m.length()) {
            bodies.polygon(block.corners().map(|corner| view.place(corner)));
        }
    }
    let walls: String = world
        .walls
        .iter()
        .filter(|wall| has_it(wall.profile()))
        .map(|wall| view.line(wall.points.iter().copied()).element(&outline.line()))
        .collect();
    bodies.element(&outline.solid()) + &walls
}
