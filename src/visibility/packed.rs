//! Binary visibility, one bit per facet and direction.

/// Binary visibility. Row `d` holds the bits of direction `d`, facet `s` in bit `s % 32` of word `s / 32`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PackedVisibility {
    pub facet_count: usize,
    pub direction_count: usize,
    pub words: Vec<u32>,
}

impl PackedVisibility {
    pub fn new(facet_count: usize, direction_count: usize) -> Self {
        Self { facet_count, direction_count, words: vec![0; facet_count.div_ceil(32) * direction_count] }
    }

    pub fn words_per_row(&self) -> usize {
        self.facet_count.div_ceil(32)
    }

    pub fn row(&self, direction: usize) -> &[u32] {
        let words = self.words_per_row();
        &self.words[direction * words..(direction + 1) * words]
    }

    pub fn row_mut(&mut self, direction: usize) -> &mut [u32] {
        let words = self.words_per_row();
        &mut self.words[direction * words..(direction + 1) * words]
    }

    pub fn is_visible(&self, direction: usize, facet: usize) -> bool {
        self.row(direction)[facet / 32] >> (facet % 32) & 1 == 1
    }

    pub fn set_blocked(&mut self, direction: usize, facet: usize) {
        self.row_mut(direction)[facet / 32] &= !(1 << (facet % 32));
    }

    pub fn set_visible(&mut self, direction: usize, facet: usize) {
        self.row_mut(direction)[facet / 32] |= 1 << (facet % 32);
    }
}
