//! ROS map as a world, in which every cell not known to be free is solid.
//!
//! Only solid cells beside ground connected to the start matter. They are merged into boxes along
//! runs of cells.

use std::{f64::consts::PI, path::Path};

use common::geometry::Shapes;
use glam::DVec2;
use maps::{MOST_BOXES, MapError, PlacedMap};

use super::{ends::Ends, files::malformed, shapes::boxes};
use simulation::Random;

use crate::error::Result;

/// Maximum side of a map: that of the check whether it can be crossed.
const LARGEST_M: f64 = 95.0;
const DRAWN_M: [f64; 2] = [3.0, 15.0];
const MOST_STARTS: usize = 50;

#[derive(Debug)]
pub struct Floor {
    map: PlacedMap,
}

impl Floor {
    pub fn load(file: &Path) -> Result<Self> {
        let map = maps::load_placed(file)?;
        let side_m = map.map.cols.max(map.map.rows) as f64 * map.cell_m;
        if side_m > LARGEST_M {
            let problem = format!(
                "the map is {side_m:.0} m on a side, above the limit of {LARGEST_M:.0} m; crop it"
            );
            return Err(malformed(file, problem));
        }
        Ok(Self { map })
    }

    pub fn shapes(&self, file: &Path, start: DVec2) -> Result<Shapes> {
        let map = &self.map.map;
        let mut wanted = vec![false; map.blocked.len()];
        for cell in self.beside(&self.connected(&self.free(), self.cell(start))) {
            wanted[cell] = true;
        }
        let found: Vec<_> = self.map.boxes(&map.blocked, wanted).take(MOST_BOXES + 1).collect();
        if found.len() > MOST_BOXES {
            return Err(MapError::too_many_boxes(file).into());
        }
        Ok(boxes(found))
    }

    fn free(&self) -> Vec<bool> {
        self.map.map.blocked.iter().map(|it| !it).collect()
    }

    /// Draws a start per stream, and a target 3 to 15 m away, reachable with `swept_m` around the
    /// body's centre. Returns fewer if there are hardly any.
    pub fn draw(&self, streams: impl Iterator<Item = Random>, swept_m: f64) -> Vec<Ends> {
        let roomy = self.roomy(swept_m);
        let places: Vec<usize> = (0..roomy.len()).filter(|&at| roomy[at]).collect();
        streams.map_while(|mut random| self.draw_one(&mut random, &roomy, &places)).collect()
    }

    fn draw_one(&self, random: &mut Random, roomy: &[bool], places: &[usize]) -> Option<Ends> {
        for _ in 0..MOST_STARTS {
            let start = *places.get(random.below(places.len()))?;
            let connected = self.connected(roomy, Some(start));
            let at = self.centre(start);
            let fits = |place: usize| {
                let distance = self.centre(place).distance(at);
                connected[place] && (DRAWN_M[0]..=DRAWN_M[1]).contains(&distance)
            };
            let targets: Vec<usize> = places.iter().copied().filter(|&it| fits(it)).collect();
            if let Some(&target) = targets.get(random.below(targets.len())) {
                return Some(Ends {
                    start: at,
                    heading: random.within(-PI, PI),
                    target: self.centre(target),
                });
            }
        }
        None
    }

    fn cell(&self, at: DVec2) -> Option<usize> {
        let away = ((at - DVec2::from(self.map.corner_m)) / self.map.cell_m).floor();
        let size = DVec2::new(self.map.map.cols as f64, self.map.map.rows as f64);
        let inside = away.cmpge(DVec2::ZERO).all() && away.cmplt(size).all();
        let row = size.y - 1.0 - away.y;
        inside.then_some((row * size.x + away.x) as usize)
    }

    fn centre(&self, cell: usize) -> DVec2 {
        let (col, row) = (cell % self.map.map.cols, cell / self.map.map.cols);
        self.map.place(col as f64 + 0.5, row as f64 + 0.5)
    }

    /// Returns the cells connected to `from`. A map's rim is never open.
    fn connected(&self, open: &[bool], from: Option<usize>) -> Vec<bool> {
        let cols = self.map.map.cols;
        let mut connected = vec![false; open.len()];
        let mut next = Vec::from_iter(from);
        while let Some(cell) = next.pop() {
            if open[cell] && !connected[cell] {
                connected[cell] = true;
                next.extend([cell - 1, cell + 1, cell - cols, cell + cols]);
            }
        }
        connected
    }

    fn roomy(&self, swept_m: f64) -> Vec<bool> {
        let reach = (swept_m / self.map.cell_m + 0.5).ceil() as usize;
        let mut roomy = self.free();
        for solid in self.beside(&roomy.clone()) {
            for (cell, [dx, dy]) in self.around(solid, reach) {
                roomy[cell] &= dx * dx + dy * dy > reach * reach;
            }
        }
        roomy
    }

    fn around(&self, cell: usize, reach: usize) -> impl Iterator<Item = (usize, [usize; 2])> {
        let (cols, rows) = (self.map.map.cols, self.map.map.rows);
        let (col, row) = (cell % cols, cell / cols);
        let near =
            move |at: usize, end: usize| at.saturating_sub(reach)..=(at + reach).min(end - 1);
        near(row, rows).flat_map(move |y| {
            near(col, cols).map(move |x| (y * cols + x, [x.abs_diff(col), y.abs_diff(row)]))
        })
    }

    fn beside(&self, ground: &[bool]) -> Vec<usize> {
        let blocked = &self.map.map.blocked;
        let touches = |cell: usize| self.around(cell, 1).any(|(cell, _)| ground[cell]);
        (0..blocked.len()).filter(|&cell| blocked[cell] && touches(cell)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::worlds::testing::drawn;

    /// Returns the floor of a drawing: `#` is solid, cells of half a metre, the lower left corner
    /// at (-1, 2).
    fn floor(map: &str) -> Floor {
        let folder = drawn(map, "resolution: 0.5\norigin: [-1.0, 2.0, 0.0]");
        Floor::load(&folder.path().join("hall.yaml")).unwrap()
    }

    #[test]
    fn every_solid_cell_beside_the_ground_is_in_a_box_and_no_free_one_is() {
        let floor = floor(
            "##########\n\
             #...#..???\n\
             #.#.#..###\n\
             #...#....#\n\
             #.##...#.#\n\
             #....#...#\n\
             ##########",
        );
        let start = floor.centre(11);
        assert_eq!(start, DVec2::new(-0.25, 4.75));
        let shapes = floor.shapes(Path::new("a.yaml"), start).unwrap();
        let inside = |cell| shapes.clearance(floor.centre(cell)) < 0.0;
        let free = floor.free();
        assert!((0..free.len()).all(|cell| !free[cell] || !inside(cell)));
        assert!(floor.beside(&free).into_iter().all(inside));
        assert!(shapes.boxes.len() < 14, "{}", shapes.boxes.len());
    }

    #[test]
    fn what_no_robot_can_come_near_is_left_out() {
        let floor = floor("#######\n#.###.#\n#######");
        let shapes = floor.shapes(Path::new("a.yaml"), floor.centre(8)).unwrap();
        let greatest = shapes.pieces().map(|piece| piece.bounds().1.x).fold(f64::MIN, f64::max);
        assert_eq!(greatest, 0.5);
        assert!(floor.shapes(Path::new("a.yaml"), DVec2::ZERO).unwrap().is_empty());
    }

    #[test]
    fn drawn_ends_are_connected_for_the_body_and_follow_from_the_seed() {
        let floor = floor(
            "##################\n\
             #................#\n\
             #................#\n\
             #................#\n\
             ##################\n\
             #................#\n\
             ##################",
        );
        let draw = |seed| floor.draw([Random::of_world(seed, 7, 0)].into_iter(), 0.24)[0];
        assert_eq!(draw(1), draw(1));
        assert_ne!(draw(1), draw(2));
        for seed in 0..20 {
            let Ends { start, target, .. } = draw(seed);
            assert!((3.0..=15.0).contains(&start.distance(target)));
            let middle = 4.25;
            assert_eq!((start.y, target.y), (middle, middle), "the lower one is too narrow");
        }
    }

    #[test]
    fn a_map_of_a_town_is_refused_with_its_size() {
        let folder = drawn(&(".".repeat(200) + "\n").repeat(2), "resolution: 1\norigin: [0, 0, 0]");
        let file = folder.path().join("hall.yaml");
        let refused = Floor::load(&file).unwrap_err().to_string();
        let named = file.to_str().unwrap();
        assert!(refused.starts_with(named) && refused.contains("is 200 m on a side"), "{refused}");
    }
}
