//! Numbers that look random and are the same every time.

/// SplitMix64 (Steele, Lea, Flood 2014, "Fast splittable pseudorandom number generators"): small, and good enough to shuffle
/// and to draw from a few thousand views.
pub struct Draw(u64);

impl Draw {
    /// Starts from a seed; any number will do.
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Uniform between 0 and 1, both excluded.
    pub fn even(&mut self) -> f64 {
        ((self.next() >> 11) as f64 + 0.5) / (1u64 << 53) as f64
    }

    /// From a normal distribution with mean 0 and variance 1 (Box & Muller 1958).
    pub fn normal(&mut self) -> f64 {
        let (length, angle) = (self.even(), self.even());
        (-2.0 * length.ln()).sqrt() * (std::f64::consts::TAU * angle).cos()
    }

    /// A number below `bound`; the bias of the remainder is below one in 2⁵⁰ for any number of views.
    pub fn below(&mut self, bound: usize) -> usize {
        (self.next() % bound.max(1) as u64) as usize
    }

    /// `most` different numbers below `count`, or all of them.
    pub fn distinct(&mut self, count: usize, most: usize) -> Vec<usize> {
        let mut drawn: Vec<usize> = Vec::with_capacity(most);
        while drawn.len() < most.min(count) {
            let index = self.below(count);
            if !drawn.contains(&index) {
                drawn.push(index);
            }
        }
        drawn
    }
}
