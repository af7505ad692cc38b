//! A choice of views for work that grows with their square.

/// Most views that go into work over all pairs of views: 11 175 pairs, which take the slowest closed form a few
/// hundredths of a second. Their results are refined with all views.
pub const MOST_VIEWS: usize = 150;

/// Fractional part of the golden ratio: its multiples fill a circle evenly and never match a period.
const GOLDEN: f64 = 0.618_033_988_749_894_8;

/// `most` of the indices below `count`, in order; all of them when there are no more.
///
/// The choice is the same every time and even over the whole session. It takes the indices whose multiple of the golden
/// ratio has the smallest fractional part, so it does not match the period of a session that visits its poses in turn,
/// as every n-th view would.
pub fn spread(count: usize, most: usize) -> Vec<usize> {
    if count <= most {
        return (0..count).collect();
    }
    let mut order: Vec<(f64, usize)> = (0..count).map(|i| ((i as f64 * GOLDEN).fract(), i)).collect();
    order.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut chosen: Vec<usize> = order.into_iter().take(most).map(|(_, i)| i).collect();
    chosen.sort_unstable();
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_sets_are_taken_whole() {
        assert_eq!(spread(5, 5), [0, 1, 2, 3, 4]);
        assert_eq!(spread(0, 5), [0usize; 0]);
    }

    #[test]
    fn a_session_that_visits_its_poses_in_turn_has_all_of_them_in_the_choice() {
        for period in 2..=12 {
            let chosen = spread(1000, 150);
            assert_eq!(chosen.len(), 150);
            let mut count = vec![0; period];
            for i in chosen {
                count[i % period] += 1;
            }
            // An even share for every pose, within a third.
            let share = 150 / period;
            assert!(count.iter().all(|&c| c * 3 >= share * 2 && c * 3 <= share * 4 + 3), "{period}: {count:?}");
        }
    }
}
