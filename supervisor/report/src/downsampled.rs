//! A bounded number of samples of a longer sequence.

/// Most samples of a kind.
const MOST: usize = 20_000;

/// Drop every second sample, from the second one on.
pub(crate) fn drop_every_second<T>(items: &mut Vec<T>) {
    let mut nth = 0;
    items.retain(|_| {
        nth += 1;
        nth % 2 == 1
    });
}

/// Samples in order. When there are too many, every second one is dropped, and from then on only every second one is taken.
#[derive(Clone, Debug)]
pub(crate) struct Downsampled<T> {
    items: Vec<T>,
    seen: usize,
    stride: usize,
}

impl<T> Default for Downsampled<T> {
    fn default() -> Self {
        Self { items: Vec::new(), seen: 0, stride: 1 }
    }
}

impl<T> Downsampled<T> {
    pub(crate) fn push(&mut self, item: T) {
        if self.items.len() == MOST {
            drop_every_second(&mut self.items);
            self.stride = self.stride.saturating_mul(2);
        }
        if self.seen.is_multiple_of(self.stride) {
            self.items.push(item);
        }
        self.seen = self.seen.saturating_add(1);
    }

    pub(crate) fn items(&self) -> &[T] {
        &self.items
    }

    /// Samples of the sequence for each stored one.
    pub(crate) const fn stride(&self) -> usize {
        self.stride
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_very_many_samples_a_bounded_number_is_kept_at_equal_steps() {
        let mut kept = Downsampled::default();
        (0..1_000_000).for_each(|nth| kept.push(nth));
        assert!((MOST / 2..=MOST).contains(&kept.items().len()));
        let step = kept.stride();
        assert!(kept.items().windows(2).all(|pair| pair[1] - pair[0] == step));
    }
}
