//! The tree of fronts: which cells are eliminated together, and what that will cost.

use super::super::breadth::{ABSENT, Pass};

/// Cells that are eliminated together, followed by their neighbours nearer to the target.
pub(in super::super) struct Front {
    first: usize,
    /// Cells the front eliminates.
    pub own: u32,
    /// Cells nearer to the target it leaves an update on.
    pub boundary: u32,
    /// The front that eliminates its boundary; none if that is the target alone.
    pub parent: Option<u32>,
    first_child: Option<u32>,
    next_sibling: Option<u32>,
}

/// What an elimination takes.
#[derive(Clone, Copy, Debug, Default)]
pub(in super::super) struct Price {
    /// Multiplications.
    pub operations: f64,
    /// Weights kept for the substitution.
    pub weights: usize,
    /// Bytes, of all that is allocated.
    pub bytes: u64,
}

/// Fronts in order of elimination, children before their parents.
pub(in super::super) struct Tree {
    pub fronts: Vec<Front>,
    places: Vec<u32>,
    pub price: Price,
}

impl Tree {
    /// The tree over all cells of `pass` but the target.
    pub(in super::super) fn of(pass: &Pass) -> Self {
        let mut tree = Self {
            fronts: Vec::new(),
            places: Vec::new(),
            price: Price::default(),
        };
        let distances = pass.levels.len() - 1;
        let thickness = DISTANCES_PER_FRONT;
        let mut pieces = Pieces::default();
        // Fronts of the chunk before, farther out, whose boundary lies in this one.
        let mut waiting: Vec<u32> = Vec::new();
        let mut chunk = (distances - 1) / thickness;
        loop {
            let nearest = (chunk * thickness).max(1);
            let farthest = ((chunk + 1) * thickness).min(distances);
            if nearest < farthest {
                let places = pass.levels[nearest]..pass.levels[farthest];
                waiting = tree.add_chunk(pass, places, &waiting, &mut pieces);
            }
            if chunk == 0 {
                break;
            }
            chunk -= 1;
        }
        tree.price.bytes = tree.bytes(pass);
        tree
    }

    /// Places of the cells of a front: its own, farthest first, then its boundary.
    pub(in super::super) fn cells(&self, front: &Front) -> &[u32] {
        &self.places[front.first..front.first + (front.own + front.boundary) as usize]
    }

    /// Places of the boundary of a front.
    pub(in super::super) fn boundary(&self, front: &Front) -> &[u32] {
        &self.cells(front)[front.own as usize..]
    }

    /// The fronts whose boundary front `index` eliminates.
    pub(super) fn children(&self, index: usize) -> impl Iterator<Item = usize> {
        std::iter::successors(self.fronts[index].first_child, |&child| {
            self.fronts[child as usize].next_sibling
        })
        .map(|child| child as usize)
    }

    /// Adds the fronts of one chunk of places; returns their indices.
    fn add_chunk(
        &mut self,
        pass: &Pass,
        chunk: std::ops::Range<u32>,
        waiting: &[u32],
        pieces: &mut Pieces,
    ) -> Vec<u32> {
        pieces.reset(chunk.len());
        for place in chunk.clone() {
            for neighbour in pass.neighbours(pass.order[place as usize]) {
                if chunk.contains(&neighbour) && neighbour > place {
                    pieces.join(place - chunk.start, neighbour - chunk.start);
                }
            }
        }
        for &child in waiting {
            let boundary = self.boundary(&self.fronts[child as usize]);
            for pair in boundary.windows(2) {
                pieces.join(pair[0] - chunk.start, pair[1] - chunk.start);
            }
        }

        let first_front = self.fronts.len() as u32;
        let members = pieces.members(first_front);
        for own in members {
            let first = self.places.len();
            self.places
                .extend(own.iter().rev().map(|local| local + chunk.start));
            let own = own.len();
            for at in first..first + own {
                let cell = pass.order[self.places[at] as usize];
                for neighbour in pass.neighbours(cell) {
                    if neighbour != ABSENT && neighbour < chunk.start {
                        self.places.push(neighbour);
                    }
                }
            }
            // The nearest own cells alone touch the boundary, so this list is short.
            let boundary = &mut self.places[first + own..];
            boundary.sort_unstable();
            let unique = dedup(boundary);
            self.places.truncate(first + own + unique);
            self.price.add_front(own, unique);
            self.fronts.push(Front {
                first,
                own: own as u32,
                boundary: unique as u32,
                parent: None,
                first_child: None,
                next_sibling: None,
            });
        }
        for &child in waiting {
            // A boundary of the target alone has no parent: the target is never eliminated.
            let Some(&place) = self.boundary(&self.fronts[child as usize]).first() else {
                continue;
            };
            let parent = pieces.front_of(place - chunk.start);
            let elder = self.fronts[parent as usize].first_child.replace(child);
            let front = &mut self.fronts[child as usize];
            front.parent = Some(parent);
            front.next_sibling = elder;
        }
        (first_front..self.fronts.len() as u32).collect()
    }

    fn bytes(&self, pass: &Pass) -> u64 {
        // Places of the pass and slots, updates alive at once bounded by the largest few fronts.
        let fixed = pass.order.len() * 12 + self.places.len() * 4 + self.fronts.len() * 64;
        let largest = self
            .fronts
            .iter()
            .map(|front| (front.own + front.boundary) as u64)
            .max()
            .unwrap_or(0);
        fixed as u64 + 8 * self.price.weights as u64 + 16 * largest * largest
    }
}

impl Price {
    fn add_front(&mut self, own: usize, boundary: usize) {
        let size = (own + boundary) as f64;
        let rest = boundary as f64;
        // The sum of (n - k)^2 / 2 over the pivots k, and a constant a cell for the assembly.
        self.operations += (size * size * size - rest * rest * rest) / 6.0 + 60.0 * size;
        self.weights += (own + boundary) * (own + boundary) / 2 - boundary * boundary / 2;
    }
}

/// Distances a front takes at once. Cells of one distance are never neighbours, so more of them only save the front's own
/// cost, and where loops join many passages into one front the dense work of a thicker one outweighs that.
const DISTANCES_PER_FRONT: usize = 1;

/// Removes repeated values from a sorted slice; returns how many remain at its start.
fn dedup(sorted: &mut [u32]) -> usize {
    let mut kept = 0;
    for at in 0..sorted.len() {
        if kept == 0 || sorted[at] != sorted[kept - 1] {
            sorted[kept] = sorted[at];
            kept += 1;
        }
    }
    kept
}

/// Connected pieces of one chunk, by union and find; kept between chunks for its memory.
#[derive(Default)]
struct Pieces {
    parent: Vec<u32>,
    piece: Vec<u32>,
    members: Vec<Vec<u32>>,
    first_front: u32,
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
        // The smaller becomes the root, so a root comes before its members.
        self.parent[a.max(b) as usize] = a.min(b);
    }

    /// The members of each piece in ascending order, pieces in order of their first member.
    fn members(&mut self, first_front: u32) -> &[Vec<u32>] {
        self.first_front = first_front;
        self.piece.clear();
        self.piece.resize(self.parent.len(), 0);
        let mut count = 0;
        for at in 0..self.parent.len() as u32 {
            let root = self.root(at);
            if root == at {
                self.piece[at as usize] = count as u32;
                if count == self.members.len() {
                    self.members.push(Vec::new());
                }
                self.members[count].clear();
                count += 1;
            } else {
                self.piece[at as usize] = self.piece[root as usize];
            }
            self.members[self.piece[at as usize] as usize].push(at);
        }
        &self.members[..count]
    }

    fn front_of(&self, at: u32) -> u32 {
        self.first_front + self.piece[at as usize]
    }
}
