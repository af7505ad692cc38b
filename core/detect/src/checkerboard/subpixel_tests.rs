use super::*;

#[test]
fn the_error_function_is_right_to_seven_digits() {
    // Abramowitz & Stegun 1964, table 7.1.
    for (x, erf) in [(0.0, 0.0), (0.5, 0.5204998778), (1.0, 0.8427007929), (2.0, 0.9953222650), (-1.0, -0.8427007929)] {
        let (value, slope) = erf_and_slope(x);
        assert!((value - erf).abs() < 2e-7, "erf({x}) = {value}");
        let h = 1e-3;
        let numeric = (erf_and_slope(x + h).0 - erf_and_slope(x - h).0) / (2.0 * h);
        assert!((slope - numeric).abs() < 5e-4, "erf'({x}) = {slope}, not {numeric}");
    }
}
