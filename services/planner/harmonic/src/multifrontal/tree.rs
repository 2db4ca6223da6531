//! Tree of fronts: the cells that are eliminated together, and the cost.
//!
//! Cells are eliminated in stages. In a single passage, a stage is a few distances. Where loops
//! join many parallel passages, everything beyond a distance is one piece, and its fronts are as
//! wide as all passages together. There, the space between two distances, a slab, is eliminated
//! first, passage by passage. Only the separators, one distance in many, have wide fronts:
//!
//! ```text
//! target ... separator | slab: stages inwards | separator | slab ...
//!                8     <--7---6---5---4---3---      2
//! ```
//!
//! A separator follows both adjacent slabs. It then touches only the next separator inwards, a
//! bounded number of cells nearer to the target. Weights therefore stay far above the smallest
//! `f64`, as without slabs.

use std::{cmp::Reverse, ops::Range};

use super::{Job, breadth_first::BreadthFirst};
use crate::SolveError;

#[derive(Clone, Copy)]
pub(crate) struct Front {
    first: usize,
    pub own: u32,
    /// Number of cells, eliminated later, that take the update.
    pub boundary: u32,
    /// Whether a later front eliminates the boundary; otherwise the boundary is the target alone.
    pub has_parent: bool,
    first_child: u32,
    next_sibling: u32,
}

const NONE: u32 = u32::MAX;

#[derive(Clone, Copy, Debug)]
struct Shape {
    /// Distances per stage.
    thickness: usize,
    /// Distances between separators; `None` without separators.
    slab: Option<usize>,
}

impl Shape {
    fn of(pass: &BreadthFirst) -> Self {
        let passage = pass.width();
        let frontier = pass.len() as f64 / pass.levels.len() as f64;
        let many = frontier > MANY * passage;
        let (thickness, slab) = match passage {
            ..NARROW => (7, 8),
            ..MIDDLING if !many => (2, 0),
            _ => (1, 24),
        };
        Self { thickness, slab: many.then_some(slab) }
    }
}

/// Passage widths, in cells, up to which a stage takes several distances, for larger fronts.
const NARROW: f64 = 1.5;
const MIDDLING: f64 = 10.0;

/// Number of parallel passages from which slabs reduce the cost.
const MANY: f64 = 6.0;

const CHECKED_EVERY: usize = 16;

/// Fronts in order of elimination, children before their parents.
pub(crate) struct Tree {
    pub fronts: Vec<Front>,
    places: Vec<u32>,
    operations: f64,
    /// Upper limit of the weights stored for the substitution.
    pub weights: usize,
}

impl Tree {
    /// Builds the tree over all cells of `pass` except the target.
    pub(crate) fn of(pass: &BreadthFirst, job: Job<'_>) -> Result<Self, SolveError> {
        let shape = Shape::of(pass);
        job.ask(Builder::bytes(pass))?;
        let mut builder = Builder::new(pass);
        let mut stages = 0_usize;
        let distances = pass.levels.len() - 1;
        let slab = shape.slab.unwrap_or(distances);
        // Two cells at one distance from a single cell have equal parity, so they are never
        // neighbours.
        let several = pass.levels[1] > 1;
        let at = |distance: usize| pass.levels[distance.min(distances)];
        // Distance 0, the target, acts as the innermost separator.
        for inner in (0..distances).step_by(slab).rev() {
            let outer = at(inner + slab)..at(inner + slab + 1);
            builder.begin_slab();
            let mut end = (inner + slab).min(distances);
            while end > inner + 1 {
                if stages.is_multiple_of(CHECKED_EVERY) {
                    job.cancellation.check()?;
                    job.ask(builder.tree.growing_bytes())?;
                    job.ask_operations(builder.tree.operations)?;
                }
                stages += 1;
                let start = end.saturating_sub(shape.thickness).max(inner + 1);
                let next = if start > inner + 1 { STAGE } else { INNER };
                let joins = several || end - start > 1;
                builder.add_stage(&(at(start)..at(end)), Some(&outer), joins, [STAGE, next]);
                end = start;
            }
            builder.add_stage(&outer, None, several, [OUTER, INNER]);
        }
        let tree = builder.tree;
        let own = tree.fronts.iter().map(|front| front.own as usize).sum::<usize>();
        assert_eq!(own, pass.unknown().len(), "each unknown cell has one front");
        job.ask(tree.bytes(pass))?;
        job.ask_operations(tree.operations)?;
        Ok(tree)
    }

    /// Returns its own places, then those of its boundary.
    pub(crate) fn cells(&self, front: &Front) -> &[u32] {
        &self.places[front.first..front.first + (front.own + front.boundary) as usize]
    }

    /// Returns the boundary, with the outer separator last.
    pub(crate) fn boundary(&self, front: &Front) -> &[u32] {
        &self.cells(front)[front.own as usize..]
    }

    /// Returns the fronts whose boundary `front` eliminates.
    pub(super) fn children(&self, front: &Front) -> impl Iterator<Item = usize> {
        let mut next = front.first_child;
        std::iter::from_fn(move || {
            let child = (next != NONE).then_some(next as usize)?;
            next = self.fronts[child].next_sibling;
            Some(child)
        })
    }

    fn growing_bytes(&self) -> u64 {
        let fronts = self.places.len() * size_of::<u32>() + self.fronts.len() * size_of::<Front>();
        fronts as u64 + 8 * self.weights as u64
    }

    /// Returns the bytes that the factorisation allocates.
    fn bytes(&self, pass: &BreadthFirst) -> u64 {
        // The largest few fronts bound the updates that exist at once.
        let fixed = pass.len() * 12;
        let largest = self
            .fronts
            .iter()
            .map(|front| u64::from(front.own + front.boundary))
            .max()
            .unwrap_or(0);
        fixed as u64 + self.growing_bytes() + 16 * largest * largest
    }
}

/// What a front waits for: the next stage, or the separator outside or inside its slab, which may
/// be the target.
const STAGE: usize = 0;
const OUTER: usize = 1;
const INNER: usize = 2;

struct Builder<'a> {
    pass: &'a BreadthFirst,
    tree: Tree,
    pieces: Pieces,
    /// Front on whose boundary a place was last put.
    seen: Vec<u32>,
    /// Fronts without a parent, by what they wait for.
    waiting: [Vec<u32>; 3],
}

impl<'a> Builder<'a> {
    fn capacities(pass: &BreadthFirst) -> (usize, usize) {
        (pass.len() / 4, pass.len() * 3)
    }

    fn bytes(pass: &BreadthFirst) -> u64 {
        let (fronts, places) = Self::capacities(pass);
        let numbers = places + pass.len();
        (fronts * size_of::<Front>() + numbers * size_of::<u32>()) as u64
    }

    fn new(pass: &'a BreadthFirst) -> Self {
        let (fronts, places) = Self::capacities(pass);
        Self {
            pass,
            tree: Tree {
                fronts: Vec::with_capacity(fronts),
                places: Vec::with_capacity(places),
                operations: 0.0,
                weights: 0,
            },
            pieces: Pieces::default(),
            seen: vec![NONE; pass.len()],
            waiting: Default::default(),
        }
    }

    fn begin_slab(&mut self) {
        let [_, outer, inner] = &mut self.waiting;
        outer.append(inner);
    }

    /// Adds the fronts of a stage, whose children wait in `from`; they wait in `to`, but in
    /// [`OUTER`] instead of [`INNER`] if they touch `outer`.
    ///
    /// The outer separator of a slab takes the places `outer`; a separator itself has `None`.
    fn add_stage(
        &mut self,
        stage: &Range<u32>,
        outer: Option<&Range<u32>>,
        joins: bool,
        [from, to]: [usize; 2],
    ) {
        self.begin_pieces(stage, joins);
        let mut children = std::mem::take(&mut self.waiting[from]);
        self.adopt(stage, &children);
        children.clear();
        self.waiting[from] = children;
        for piece in 0..self.pieces.count() {
            let (index, touches_outer) = self.add_front(piece, stage, outer);
            let to = if to == INNER && touches_outer { OUTER } else { to };
            self.waiting[to].push(index);
        }
    }

    fn begin_pieces(&mut self, stage: &Range<u32>, joins: bool) {
        self.pieces.reset(stage.len());
        for place in stage.clone().filter(|_| joins) {
            for neighbour in self.pass.neighbours(place) {
                if neighbour > place && neighbour < stage.end {
                    self.pieces.join(place - stage.start, neighbour - stage.start);
                }
            }
        }
    }

    /// Joins the pieces of a stage by the boundaries of the waiting fronts, its children.
    fn adopt(&mut self, stage: &Range<u32>, waiting: &[u32]) {
        for &child in waiting {
            let boundary = self.tree.boundary(&self.tree.fronts[child as usize]);
            let mut here = boundary.iter().filter(|place| stage.contains(place));
            if let Some(first) = here.next() {
                for other in here {
                    self.pieces.join(first - stage.start, other - stage.start);
                }
            }
        }
        self.pieces.number();
        for &child in waiting {
            let boundary = self.tree.boundary(&self.tree.fronts[child as usize]);
            let Some(first) = boundary.iter().find(|place| stage.contains(place)) else {
                continue;
            };
            let piece = self.pieces.piece[(first - stage.start) as usize] as usize;
            let front = &mut self.tree.fronts[child as usize];
            assert!(!front.has_parent);
            front.has_parent = true;
            front.next_sibling = std::mem::replace(&mut self.pieces.first_child[piece], child);
        }
    }

    /// Adds the front of a piece of a separator, or of a stage inside the separator `outer`.
    ///
    /// Returns the index of the front and whether it touches `outer`.
    fn add_front(
        &mut self,
        piece: usize,
        stage: &Range<u32>,
        outer: Option<&Range<u32>>,
    ) -> (u32, bool) {
        // All neighbours of a separator are eliminated.
        let (inwards, outer) = outer.map_or((0, 0..0), |outer| (stage.start, outer.clone()));
        let tree = &mut self.tree;
        let index = tree.fronts.len() as u32;
        let first = tree.places.len();
        let members = self.pieces.members(piece);
        tree.places.extend(members.iter().map(|local| local + stage.start));
        let own = members.len();
        for at in first..first + own {
            for neighbour in self.pass.neighbours(tree.places[at]) {
                // Other cells farther out are already eliminated.
                let remains = neighbour < inwards || outer.contains(&neighbour);
                if remains && self.seen[neighbour as usize] != index {
                    self.seen[neighbour as usize] = index;
                    tree.places.push(neighbour);
                }
            }
        }
        let first_child = self.pieces.first_child[piece];
        let mut child = first_child;
        while child != NONE {
            let front = tree.fronts[child as usize];
            let boundary = front.first + front.own as usize;
            for at in boundary..boundary + front.boundary as usize {
                let place = tree.places[at];
                if !stage.contains(&place) && self.seen[place as usize] != index {
                    self.seen[place as usize] = index;
                    tree.places.push(place);
                }
            }
            child = front.next_sibling;
        }
        // With the next stage first and the outer separator last, the rows of an update mostly stay
        // in order up the tree.
        let boundary = &mut tree.places[first + own..];
        boundary.sort_unstable_by_key(|&place| (outer.contains(&place), Reverse(place)));
        let touches_outer = boundary.last().is_some_and(|place| outer.contains(place));
        let boundary = boundary.len();
        let (size, rest) = ((own + boundary) as f64, boundary as f64);
        // Sum of (n - k)^2 / 2 over the pivots k, and a constant per cell for the assembly.
        tree.operations += (size * size * size - rest * rest * rest) / 6.0 + 60.0 * size;
        tree.weights += (own + boundary) * (own + boundary) / 2 - boundary * boundary / 2;
        tree.fronts.push(Front {
            first,
            own: own as u32,
            boundary: boundary as u32,
            has_parent: false,
            first_child,
            next_sibling: NONE,
        });
        (index, touches_outer)
    }
}

/// Connected pieces of one stage, by union-find; reused between stages for its memory.
#[derive(Default)]
struct Pieces {
    parent: Vec<u32>,
    piece: Vec<u32>,
    ends: Vec<u32>,
    members: Vec<u32>,
    first_child: Vec<u32>,
}

impl Pieces {
    fn reset(&mut self, len: usize) {
        self.parent.clear();
        self.parent.extend(0..len as u32);
    }

    fn root(&mut self, mut at: u32) -> u32 {
        while self.parent[at as usize] != at {
            let above = self.parent[self.parent[at as usize] as usize];
            self.parent[at as usize] = above;
            at = above;
        }
        at
    }

    fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        // The smaller index becomes the root, so a root precedes its members.
        self.parent[a.max(b) as usize] = a.min(b);
    }

    fn number(&mut self) {
        let len = self.parent.len();
        self.piece.clear();
        self.piece.resize(len, 0);
        self.ends.clear();
        for at in 0..len as u32 {
            let root = self.root(at);
            if root == at {
                self.piece[at as usize] = self.ends.len() as u32;
                self.ends.push(1);
            } else {
                let piece = self.piece[root as usize];
                self.piece[at as usize] = piece;
                self.ends[piece as usize] += 1;
            }
        }
        let mut sum = 0;
        for end in &mut self.ends {
            sum += std::mem::replace(end, sum);
        }
        // Each end counts up from the start of its piece as members arrive.
        self.members.clear();
        self.members.resize(len, 0);
        for at in (0..len as u32).rev() {
            let end = &mut self.ends[self.piece[at as usize] as usize];
            self.members[*end as usize] = at;
            *end += 1;
        }
        assert_eq!(self.ends.last().map_or(0, |end| *end as usize), len);
        self.first_child.clear();
        self.first_child.resize(self.ends.len(), NONE);
    }

    fn count(&self) -> usize {
        self.ends.len()
    }

    fn members(&self, piece: usize) -> &[u32] {
        let start = if piece == 0 { 0 } else { self.ends[piece - 1] };
        &self.members[start as usize..self.ends[piece] as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cancellation::Cancellation;
    use crate::cell::Cell;
    use crate::domain::Domain;
    use crate::multifrontal::{Workspace, order, solve};
    use crate::store::Store;

    #[test]
    fn neighbours_at_one_distance_from_several_known_cells_keep_their_coupling() {
        let domain = Domain::new(60, 40, vec![false; 2400], Cell::new(7, 8)).unwrap();
        let none = Cancellation::new();
        let job = Job::new(&domain, u64::MAX, &none);
        let field = |pass: BreadthFirst, known: Option<&Store>| {
            let tree = Tree::of(&pass, job).unwrap();
            solve(job, &(pass, tree), known, &mut Workspace::default()).unwrap()
        };
        let right = field(BreadthFirst::from_target(job).unwrap(), None);
        // Cells in the middle are equally far from both ends.
        let is_known = |index: usize| !(10..50).contains(&(index % 60));
        let pass = BreadthFirst::from_known(job, is_known).unwrap();
        let found = field(pass, Some(&right));
        for index in 0..2400 {
            let (found, right) = (found.u(index), right.u(index));
            assert!((found.relative_to(right.exponent) / right.mantissa - 1.0).abs() < 1e-9);
        }
    }

    #[test]
    fn a_factorisation_without_the_memory_it_needs_is_refused_before_it_is_allocated() {
        let domain = Domain::new(60, 50, vec![false; 3000], Cell::new(7, 8)).unwrap();
        let none = Cancellation::new();
        let large = Job::new(&domain, u64::MAX, &none);
        let pass = BreadthFirst::from_target(large).unwrap();
        let needed = Tree::of(&pass, large).unwrap().bytes(&pass);
        let refused = |allowed: u64| order(Job::new(&domain, allowed, &none)).err();
        assert_eq!(refused(needed), None);
        for allowed in [100, 30_000, 60_000, 100_000, needed - 1] {
            let error = refused(allowed).unwrap();
            assert!(
                matches!(error, SolveError::TooCostly { needed: asked, width: 60, height: 50, .. }
                    if (allowed + 1..=needed).contains(&asked)),
                "{error}"
            );
            assert!(error.to_string().contains("memory_limit"), "{error}");
        }
    }
}
