//! What is usual among numbers of which a few may be far off.

/// Standard deviation of a normal distribution over the median of the sizes of its errors, 1 / Φ⁻¹(3/4).
pub const SIGMA_PER_MEDIAN_SIZE: f64 = 1.4826;

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
}
