//! Typical values of numbers of which a few may be far off.

use statrs::distribution::{ContinuousCDF as _, Normal};

/// Standard deviation of a normal distribution over the median of the sizes of its errors, 1 / Φ⁻¹(3/4).
pub const SIGMA_PER_MEDIAN_SIZE: f64 = 1.4826;

/// Least squared distance of an outlier over that of the farthest inlier: it is twice as far out. Gaussian errors never
/// are once they are above a limit that makes them rare; where the tail of the distances falls off as the fifth power
/// only, the farthest is in one session of thirty-two.
const APART: f64 = 4.0;

/// The median: the number in the middle, or the mean of the two in the middle. NaN does not count; infinities do.
/// `None` where nothing is left.
pub fn median(values: impl IntoIterator<Item = f64>) -> Option<f64> {
    let sorted = sorted(values);
    let count = sorted.len();
    (count > 0).then(|| 0.5 * (sorted[count / 2] + sorted[(count - 1) / 2]))
}

/// The median that is always one of the values: the higher of the two in the middle where their number is even, because
/// the mean of the depths of two surfaces lies on neither. Otherwise as [`median`].
pub fn median_high(values: impl IntoIterator<Item = f64>) -> Option<f64> {
    let sorted = sorted(values);
    sorted.get(sorted.len() / 2).copied()
}

/// Which squared distances are outliers: those above `limit` that are separated from the rest, the smallest of them
/// being at least twice as far as the farthest of the others. By index, ascending.
///
/// A limit alone assumes Gaussian noise. Unmodelled errors of an arm have longer tails, and then the far views are the
/// end of a continuous distribution and not outliers; one that is wrong for its own reason is separated from it.
pub fn outliers(squared: &[f64], limit: f64) -> Vec<usize> {
    let mut order: Vec<usize> = (0..squared.len()).collect();
    order.sort_by(|a, b| squared[*b].total_cmp(&squared[*a]));
    let apart = |k: &usize| {
        let (far, near) = (squared[order[*k]], order.get(k + 1).map_or(0.0, |next| squared[*next]));
        far > limit && far >= APART * near
    };
    let count = (0..order.len()).rev().find(apart).map_or(0, |last| last + 1);
    let mut outliers = order[..count].to_vec();
    outliers.sort_unstable();
    outliers
}

/// Degrees of freedom of a variance that is a sum of parts, each proportional to an estimated variance: given for every
/// part its share of the sum, and the degrees of freedom of its estimate. At least one.
///
/// # Reference
/// Satterthwaite 1946, "An approximate distribution of estimates of variance components", Biometrics Bulletin 2; for several
/// numbers at once Fai & Cornelius 1996, J. Stat. Comput. Simul. 54.
pub fn pooled_freedom(parts: impl IntoIterator<Item = (f64, f64)>) -> f64 {
    let inverse: f64 = parts.into_iter().map(|(share, freedom)| share * share / freedom.max(f64::MIN_POSITIVE)).sum();
    inverse.recip().max(1.0)
}

/// Count up to which the distribution of [`better_by_chance`] is enumerated; for more it is normal, within one percent of its
/// tail.
const COUNTED: usize = 60;

/// Probability that numbers distributed symmetrically about zero are as far above zero as these: the signed-rank test. Zeros do
/// not count.
///
/// It assumes nothing about their distribution but that symmetry, and unlike the test of a mean it detects many gains of which
/// a few are large.
///
/// # Reference
/// Wilcoxon 1945, "Individual comparisons by ranking methods", Biometrics Bulletin 1.
pub fn better_by_chance(values: &[f64]) -> f64 {
    let mut sizes: Vec<f64> = values.iter().copied().filter(|value| *value != 0.0 && !value.is_nan()).collect();
    sizes.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
    let count = sizes.len();
    if count == 0 {
        return 1.0;
    }
    let below: usize = sizes.iter().enumerate().filter(|(_, value)| **value < 0.0).map(|(rank, _)| rank + 1).sum();
    if count <= COUNTED {
        // Every choice of ranks is equally likely: this counts those with a sum as small.
        let mut ways = vec![0.0; below + 1];
        ways[0] = 1.0;
        for rank in 1..=count {
            for sum in (rank..=below).rev() {
                ways[sum] += ways[sum - rank];
            }
        }
        return ways.iter().sum::<f64>() * 0.5f64.powi(count as i32);
    }
    let n = count as f64;
    let (mean, variance) = (n * (n + 1.0) / 4.0, n * (n + 1.0) * (2.0 * n + 1.0) / 24.0);
    Normal::standard().cdf((below as f64 + 0.5 - mean) / variance.sqrt())
}

fn sorted(values: impl IntoIterator<Item = f64>) -> Vec<f64> {
    let mut sorted: Vec<f64> = values.into_iter().filter(|value| !value.is_nan()).collect();
    sorted.sort_by(f64::total_cmp);
    sorted
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_median_is_in_the_middle_of_the_numbers_and_of_nothing_there_is_none() {
        assert_eq!((median([3.0, 1.0, 2.0]), median_high([3.0, 1.0, 2.0])), (Some(2.0), Some(2.0)));
        assert_eq!((median([4.0, 1.0, 2.0, 3.0]), median_high([4.0, 1.0, 2.0, 3.0])), (Some(2.5), Some(3.0)));
        assert_eq!((median([]), median_high([f64::NAN])), (None, None));
        // NaN of either sign, at any place.
        assert_eq!(median([-f64::NAN, 1.0, f64::NAN, 2.0, f64::INFINITY]), Some(2.0));
    }

    #[test]
    fn the_signed_rank_test_has_its_published_law() {
        // Of the 1024 choices of ranks from ten, 43 have a sum of at most 10 and 10 one of at most 5.
        let of_sum = |negative: &[usize]| {
            let sign = |rank: usize| if negative.contains(&rank) { -1.0 } else { 1.0 };
            better_by_chance(&(1..=10).map(|rank| sign(rank) * rank as f64).collect::<Vec<_>>())
        };
        for (negative, ways) in [(&[10][..], 43.0), (&[1, 2, 3, 4], 43.0), (&[5], 10.0)] {
            assert!((of_sum(negative) - ways / 1024.0).abs() < 1e-12, "{negative:?}: {}", of_sum(negative));
        }
        assert!((of_sum(&[]) - 2f64.powi(-10)).abs() < 1e-15);
        // The enumerated and the normal distribution agree where they meet.
        let mixed = |count: usize| {
            (0..count).map(|k| (k as f64 + 1.0) * if k % 4 == 1 { -1.0 } else { 1.0 }).collect::<Vec<_>>()
        };
        let (counted, normal) = (better_by_chance(&mixed(60)), better_by_chance(&mixed(61)));
        assert!((counted / normal).ln().abs() < 0.4, "{counted} {normal}");
        assert_eq!((better_by_chance(&[]), better_by_chance(&[0.0])), (1.0, 1.0));
    }

    #[test]
    fn the_freedom_of_a_sum_is_that_of_its_largest_part_and_more_where_parts_are_alike() {
        let pooled = |parts: &[(f64, f64)]| pooled_freedom(parts.iter().copied());
        assert_eq!(pooled(&[(1.0, 30.0), (0.0, 4.0)]), 30.0, "a part of nothing does not count");
        assert!((pooled(&[(0.5, 8.0), (0.5, 8.0)]) - 16.0).abs() < 1e-12, "two estimates tell twice as much as one");
        assert_eq!(pooled(&[(1.0, 0.0)]), 1.0);
        // The variance of the estimate of `a + b` is `2 a² / 8 + 2 b² / 40`, that of a variance `v` on `n` degrees `2 v² / n`.
        let (a, b) = (0.8, 0.2);
        let by_moments = 2.0 / (2.0 * a * a / 8.0 + 2.0 * b * b / 40.0);
        assert!((pooled(&[(a, 8.0), (b, 40.0)]) - by_moments).abs() < 1e-12);
    }

    #[test]
    fn outliers_are_beyond_the_limit_and_apart_from_the_crowd() {
        let squared = [5.0, 90.0, 7.0, 300.0, 6.0, 10.0];
        assert_eq!(outliers(&squared, 50.0), [1, 3], "two that hide each other no more");
        assert_eq!(outliers(&squared, 200.0), [] as [usize; 0], "the gap is below the limit: 300 is not far from 90");
        assert_eq!(outliers(&[10.0, 20.0, 40.0, 80.0], 30.0), [] as [usize; 0], "the end of a crowd");
        assert_eq!(outliers(&[1.0, f64::INFINITY], 30.0), [1]);
        assert_eq!(outliers(&[], 1.0), [] as [usize; 0]);
    }
}
