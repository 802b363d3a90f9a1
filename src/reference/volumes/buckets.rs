//! Sorts depths that are spread rather evenly.

/// Memory for sorting.
#[derive(Debug, Default)]
pub(super) struct Buckets {
    ends: Vec<u32>,
    sorted: Vec<(f64, u32)>,
}

impl Buckets {
    /// Sorts by depth, and equal depths by number. Most depths are spread evenly, so buckets of few are sorted one by
    /// one.
    pub(super) fn sort(&mut self, all: &mut Vec<(f64, u32)>) {
        let low = all.iter().map(|one| one.0).fold(f64::INFINITY, f64::min);
        let high = all.iter().map(|one| one.0).fold(f64::NEG_INFINITY, f64::max);
        let count = all.len() / 4 + 1;
        let scale = count as f64 / (high - low);
        // The cast saturates, and takes NaN to 0.
        let bucket = |depth: f64| (((depth - low) * scale) as usize).min(count - 1);
        self.ends.clear();
        self.ends.resize(count + 1, 0);
        for one in &*all {
            self.ends[bucket(one.0) + 1] += 1;
        }
        for i in 0..count {
            self.ends[i + 1] += self.ends[i];
        }
        self.sorted.resize(all.len(), (0.0, 0));
        let mut first = 0;
        for one in &*all {
            let end = &mut self.ends[bucket(one.0)];
            self.sorted[*end as usize] = *one;
            *end += 1;
        }
        for &end in &self.ends[..count] {
            let end = end as usize;
            self.sorted[first..end].sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            first = end;
        }
        std::mem::swap(all, &mut self.sorted);
    }
}
