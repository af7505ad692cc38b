//! Points that fill a space evenly, the same ones every time.

use super::super::MAX_JOINTS;

/// One for each joint that an arm may have.
const PRIMES: [u32; MAX_JOINTS] = [2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37];
/// The first points are left out: there, coordinates of large primes increase together.
const SKIPPED: u32 = 40;

/// Coordinate `joint` of point `n` of the sequence, in (0, 1).
///
/// # Reference
/// Halton 1960, "On the efficiency of certain quasi-random sequences of points in evaluating multi-dimensional integrals".
pub(super) fn coordinate(n: u32, joint: usize) -> f64 {
    let base = PRIMES[joint];
    let (mut rest, mut place, mut value) = (n + SKIPPED, 1.0, 0.0);
    while rest > 0 {
        place /= f64::from(base);
        value += place * f64::from(rest % base);
        rest /= base;
    }
    value
}
