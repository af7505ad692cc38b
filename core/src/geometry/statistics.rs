//! What is usual among numbers of which a few may be far off.

/// Standard deviation of a normal distribution over the median of the sizes of its errors, 1 / Φ⁻¹(3/4).
pub const SIGMA_PER_MEDIAN_SIZE: f64 = 1.4826;

/// Squared distance of an outlier over that of the farthest view that is none, at the least: it stands twice as far out.
/// Gaussian errors never do once they are above a limit that makes them rare; where the tail of the distances falls off
/// as the fifth power only, the farthest does in one session of thirty-two.
const APART: f64 = 4.0;

/// The median: the number in the middle, or the mean of the two in the middle. What is not a number does not count;
/// infinities do. `None` where nothing is left.
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

/// Which squared distances are outliers: those above `limit` that stand apart, the smallest of them being at least
/// twice as far as the farthest of the others. By index, ascending.
///
/// A limit alone takes the noise for Gaussian. Errors of an arm that its model misses have longer tails, and then the
/// far views are the end of a crowd and no outliers; one that is wrong for a reason of its own stands outside of it.
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
        // Of either sign, wherever it stands.
        assert_eq!(median([-f64::NAN, 1.0, f64::NAN, 2.0, f64::INFINITY]), Some(2.0));
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
