//! Orders of the views taken by chance, the same ones every time.

use crate::handeye::draw::Draw;

/// Random orders that an observed one is compared with; the smallest probability they can show is one in this many plus
/// one.
pub const ORDERS: usize = 499;

/// Start of the sequence. Any number does; that it is fixed makes the same data give the same answer.
const SEED: u64 = 0x5eed_0f0a_5e71_0001;

/// Share of random orders of `0..count` for which `statistic` is at least the observed one, that one included.
pub fn p_value(count: usize, observed: f64, mut statistic: impl FnMut(&[usize]) -> f64) -> f64 {
    let mut random = Draw::new(SEED);
    let mut order: Vec<usize> = (0..count).collect();
    // Statistics of like orders differ in their last digits only; they are as large as the observed one.
    let threshold = observed - 1e-9 * observed.abs();
    let mut as_large = 1;
    for _ in 0..ORDERS {
        for i in (1..count).rev() {
            order.swap(i, random.below(i + 1));
        }
        as_large += usize::from(statistic(&order) >= threshold);
    }
    as_large as f64 / (ORDERS + 1) as f64
}
