//! A bounded number of samples of a longer sequence.

/// Drop every second sample, from the second one on.
pub fn drop_every_second<T>(items: &mut Vec<T>) {
    let mut nth = 0;
    items.retain(|_| {
        nth += 1;
        nth % 2 == 1
    });
}

/// Samples in order. When there are more than `MOST`, every second one is dropped, and only every second one is taken from then on.
#[derive(Clone, Debug)]
pub struct Downsampled<T, const MOST: usize> {
    items: Vec<T>,
    seen: usize,
    stride: usize,
}

impl<T, const MOST: usize> Default for Downsampled<T, MOST> {
    fn default() -> Self {
        Self { items: Vec::new(), seen: 0, stride: 1 }
    }
}

impl<T, const MOST: usize> Downsampled<T, MOST> {
    pub fn push(&mut self, item: T) {
        if self.items.len() == MOST {
            drop_every_second(&mut self.items);
            self.stride = self.stride.saturating_mul(2);
        }
        if self.seen.is_multiple_of(self.stride) {
            self.items.push(item);
        }
        self.seen = self.seen.saturating_add(1);
    }

    pub fn items(&self) -> &[T] {
        &self.items
    }

    /// Samples of the sequence for each stored one.
    pub const fn stride(&self) -> usize {
        self.stride
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_very_many_samples_a_bounded_number_is_kept_at_equal_steps() {
        const MOST: usize = 1000;
        let mut kept = Downsampled::<_, MOST>::default();
        (0..1_000_000).for_each(|nth| kept.push(nth));
        assert!((MOST / 2..=MOST).contains(&kept.items().len()));
        let step = kept.stride();
        assert!(kept.items().windows(2).all(|pair| pair[1] - pair[0] == step));
    }
}
