//! One breadth-first pass from the target over the free cells.

use crate::domain::Domain;

/// The cell has no place in the order: blocked, or cut off from the target.
pub(super) const ABSENT: u32 = u32::MAX;

/// The reachable cells in order of their distance from the target.
pub(super) struct Pass {
    /// Row-major indices of the reachable cells, the target first, by distance.
    pub order: Vec<u32>,
    /// Place in `order` of each cell of the padded map, or [`ABSENT`].
    place: Vec<u32>,
    /// Places at which a new distance starts: distance d takes `level[d] .. level[d + 1]`.
    pub levels: Vec<u32>,
    width: usize,
}

impl Pass {
    /// Visits `domain` from its target.
    pub(super) fn from_target(domain: &Domain) -> Self {
        let (width, height) = (domain.width(), domain.height());
        // One absent cell all around spares every visit the question whether a neighbour exists.
        const UNSEEN: u32 = u32::MAX - 1;
        let stride = width + 2;
        let mut place = vec![ABSENT; stride * (height + 2)];
        for (row, cells) in domain.blocked().chunks_exact(width).enumerate() {
            let start = (row + 1) * stride + 1;
            for (slot, &blocked) in place[start..start + width].iter_mut().zip(cells) {
                *slot = if blocked { ABSENT } else { UNSEEN };
            }
        }

        let target = (domain.target().row + 1) * stride + domain.target().col + 1;
        let mut order = vec![target as u32];
        place[target] = 0;
        let mut levels = vec![0, 1];
        let mut next = 0;
        while next < order.len() {
            let end = order.len();
            while next < end {
                let cell = order[next] as usize;
                next += 1;
                for neighbour in [cell - stride, cell - 1, cell + 1, cell + stride] {
                    if place[neighbour] == UNSEEN {
                        place[neighbour] = order.len() as u32;
                        order.push(neighbour as u32);
                    }
                }
            }
            if order.len() > end {
                levels.push(order.len() as u32);
            }
        }
        for slot in &mut place {
            if *slot == UNSEEN {
                *slot = ABSENT;
            }
        }
        for cell in &mut order {
            let (row, col) = (*cell as usize / stride - 1, *cell as usize % stride - 1);
            *cell = (row * width + col) as u32;
        }
        Self {
            order,
            place,
            levels,
            width,
        }
    }

    /// Places in the order of the four neighbours of the cell with row-major `index`: west, east, north, south.
    pub(super) fn neighbours(&self, index: u32) -> [u32; 4] {
        let (row, col) = (index as usize / self.width, index as usize % self.width);
        let stride = self.width + 2;
        let padded = (row + 1) * stride + col + 1;
        [padded - 1, padded + 1, padded - stride, padded + stride]
            .map(|neighbour| self.place[neighbour])
    }
}
