//! Which row of one list belongs to which of another: by their places, counted further, or in another order.

use std::cmp::Ordering;

use handeye_geometry::natural_order;

/// How programs order names.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Order {
    /// As people count: 1, 2, 10.
    ByNumber,
    /// Letter by letter: 1, 10, 2.
    ByLetters,
}

impl Order {
    /// The names in this order, by their places.
    pub fn sorted<S: AsRef<str>>(self, names: &[S]) -> Vec<usize> {
        let compare: fn(&str, &str) -> Ordering = match self {
            Self::ByNumber => natural_order::compare,
            Self::ByLetters => Ord::cmp,
        };
        let mut sorted: Vec<usize> = (0..names.len()).collect();
        sorted.sort_by(|a, b| compare(names[*a].as_ref(), names[*b].as_ref()));
        sorted
    }

    /// The place that every name has in this order.
    pub fn ranks<S: AsRef<str>>(self, names: &[S]) -> Vec<usize> {
        let mut ranks = vec![0; names.len()];
        for (rank, place) in self.sorted(names).into_iter().enumerate() {
            ranks[place] = rank;
        }
        ranks
    }
}

/// Which one in the order belongs to a row, counted this many further.
pub fn along(order: &[usize], row: usize, further: isize) -> Option<usize> {
    order.get(row.checked_add_signed(further)?).copied()
}

/// The image of every pose, in order, that has the least cost, given that of every image at every pose: poses and images may
/// be left out on either side. `None` where nothing is cheaper than leaving out.
pub fn aligned(poses: usize, images: usize, leave_out: f64, cost: impl Fn(usize, usize) -> f64) -> Vec<Option<usize>> {
    // The least cost of the first ones of both, up to each count.
    let mut best = vec![vec![0.0f64; images + 1]; poses + 1];
    for p in 0..=poses {
        for i in 0..=images {
            if p == 0 && i == 0 {
                continue;
            }
            let mut least = f64::INFINITY;
            if p > 0 {
                least = least.min(best[p - 1][i] + leave_out);
            }
            if i > 0 {
                least = least.min(best[p][i - 1] + leave_out);
            }
            if p > 0 && i > 0 {
                least = least.min(best[p - 1][i - 1] + cost(p - 1, i - 1));
            }
            best[p][i] = least;
        }
    }
    let mut image_of = vec![None; poses];
    let (mut p, mut i) = (poses, images);
    while p > 0 && i > 0 {
        if best[p][i] == best[p - 1][i - 1] + cost(p - 1, i - 1) {
            image_of[p - 1] = Some(i - 1);
            (p, i) = (p - 1, i - 1);
        } else if best[p][i] == best[p - 1][i] + leave_out {
            p -= 1;
        } else {
            i -= 1;
        }
    }
    image_of
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_on_both_sides_are_found_by_what_fits() {
        // Pose 2 has no image, image 4 no pose.
        let truth = [Some(0), Some(1), None, Some(2), Some(3), Some(5)];
        let cost = |pose: usize, image: usize| if truth[pose] == Some(image) { 0.01 } else { 10.0 };
        assert_eq!(aligned(6, 6, 1.0, cost), truth);
    }
}
