//! Order of names as people count: 2 before 10.

use std::cmp::Ordering;

/// Compares runs of digits by their value and everything else letter by letter. A total order: names of equal value
/// (`a1`, `a01`) are ordered letter by letter.
pub fn compare(a: &str, b: &str) -> Ordering {
    let (mut left, mut right) = (a, b);
    loop {
        let (run_a, rest_a) = first_run(left);
        let (run_b, rest_b) = first_run(right);
        if run_a.is_empty() || run_b.is_empty() {
            return run_a.len().cmp(&run_b.len()).then_with(|| a.cmp(b));
        }
        let order = match (value(run_a), value(run_b)) {
            (Some(x), Some(y)) => x.len().cmp(&y.len()).then_with(|| x.cmp(y)),
            _ => run_a.cmp(run_b),
        };
        if order != Ordering::Equal {
            return order;
        }
        (left, right) = (rest_a, rest_b);
    }
}

/// Splits off the digits, or the one other letter, that a name starts with.
fn first_run(name: &str) -> (&str, &str) {
    let digits = name.bytes().take_while(u8::is_ascii_digit).count();
    let length = if digits > 0 { digits } else { name.chars().next().map_or(0, char::len_utf8) };
    name.split_at(length)
}

/// Digits without leading zeros; `None` for other text.
fn value(run: &str) -> Option<&str> {
    run.starts_with(|c: char| c.is_ascii_digit()).then(|| run.trim_start_matches('0'))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_comes_before_ten_and_every_name_has_its_place() {
        let sorted = ["", "a", "a01", "a1", "a2", "a10", "a10b2", "a10b10", "b1", "image-9.png", "image-10.png", "é2"];
        for (i, a) in sorted.iter().enumerate() {
            for (j, b) in sorted.iter().enumerate() {
                assert_eq!(compare(a, b), i.cmp(&j), "{a:?} {b:?}");
            }
        }
    }

    #[test]
    fn numbers_of_any_length_compare_by_value() {
        let long = "9".repeat(60);
        assert_eq!(compare(&format!("x{long}"), &format!("x1{}", "0".repeat(60))), Ordering::Less);
    }
}
