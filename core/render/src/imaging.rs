//! Effects of a sensor on the ideal image: blur, noise, rounding.

use std::sync::LazyLock;

use image::RgbImage;

use super::Imaging;

/// Weight below which the tail of the blur is cut: a tenth of a grey level over a full step.
const BLUR_CUT: f64 = 4e-4;
/// Largest blur; beyond it nothing of a board is left.
const MAX_BLUR_PX: f64 = 20.0;
/// Steps of the tabulated normal distribution; the outermost are at ±4.3 standard deviations.
const QUANTILES: usize = 1 << 16;

/// Keeps the depth noise apart from the noise of the image.
const DEPTH_STREAM: u64 = 0xD1B5_4A32_D192_ED03;

/// Blur, exposure, noise and rounding of linear colours, three per pixel.
///
/// The numbers of pixel `i` are drawn from a hash of `seed` and `i`, so they do not depend on the order of work.
pub(super) fn develop(colours: Vec<f32>, width: u32, height: u32, imaging: &Imaging, seed: u64) -> RgbImage {
    let blurred = if imaging.blur_px > 0.0 { blur(&colours, width as usize, imaging.blur_px) } else { colours };
    let gain = (255.0 * imaging.exposure) as f32;
    let bytes = if imaging.noise_grey > 0.0 {
        let sigma = imaging.noise_grey as f32;
        let mut bytes = vec![0; blurred.len()];
        let key = mix(seed);
        for (i, (out, colour)) in bytes.chunks_exact_mut(3).zip(blurred.chunks_exact(3)).enumerate() {
            let bits = draw(key, i);
            for channel in 0..3 {
                out[channel] = grey(gain * colour[channel] + sigma * normal(bits >> (16 * channel)));
            }
        }
        bytes
    } else {
        blurred.iter().map(|colour| grey(gain * colour)).collect()
    };
    RgbImage::from_raw(width, height, bytes).unwrap_or_default()
}

/// Adds noise to all depths below the far plane and keeps them between the planes; the others become what is reported where
/// nothing is.
pub(super) fn disturb(depths_m: &mut [f32], near_m: f64, far_m: f64, imaging: &Imaging, seed: u64) {
    add_noise(depths_m, near_m, far_m, imaging, seed);
    if let Some(nothing_m) = imaging.depth_of_nothing_m {
        depths_m.iter_mut().filter(|depth| **depth >= far_m as f32).for_each(|depth| *depth = nothing_m as f32);
    }
}

fn add_noise(depths_m: &mut [f32], near_m: f64, far_m: f64, imaging: &Imaging, seed: u64) {
    let constant = positive(imaging.depth_noise_m);
    let quadratic = positive(imaging.depth_noise_per_m2);
    if constant == 0.0 && quadratic == 0.0 {
        return;
    }
    let (near, far) = (near_m as f32, far_m as f32);
    let key = mix(seed ^ DEPTH_STREAM);
    for (i, depth) in depths_m.iter_mut().enumerate() {
        if *depth < far {
            let sigma = constant + quadratic * *depth * *depth;
            *depth = (*depth + sigma * normal(draw(key, i))).max(near).min(far);
        }
    }
}

fn positive(value: f64) -> f32 {
    if value > 0.0 { value as f32 } else { 0.0 }
}

/// Nearest grey level, clamped. Adding 2²³ leaves the rounded number in the low bits of the float: unlike a cast
/// it compiles to vector code.
fn grey(value: f32) -> u8 {
    (value.clamp(0.0, 255.0) + 8_388_608.0).to_bits() as u8
}

/// Finaliser of SplitMix64 (Steele, Lea, Flood 2014, "Fast splittable pseudorandom number generators").
fn mix(value: u64) -> u64 {
    let mut z = value.wrapping_add(0x9E37_79B9_7F4A_7C15);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

fn draw(key: u64, index: usize) -> u64 {
    mix(key.wrapping_add((index as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15)))
}

/// The standard normal number for the low 16 bits.
fn normal(bits: u64) -> f32 {
    NORMAL[(bits & 0xFFFF) as usize]
}

/// Middles of equally probable slices of the normal distribution.
static NORMAL: LazyLock<Box<[f32; QUANTILES]>> = LazyLock::new(|| {
    let mut table = Box::new([0.0; QUANTILES]);
    for (i, value) in table.iter_mut().enumerate() {
        *value = normal_quantile((i as f64 + 0.5) / QUANTILES as f64) as f32;
    }
    table
});

/// Inverse of the normal distribution function by Acklam's rational approximation, relative error below 1.2e-9.
///
/// Reference: P. J. Acklam 2003, "An algorithm for computing the inverse normal cumulative distribution function".
fn normal_quantile(p: f64) -> f64 {
    const A: [f64; 6] = [
        -3.969683028665376e1,
        2.209460984245205e2,
        -2.759285104469687e2,
        1.38357751867269e2,
        -3.066479806614716e1,
        2.506628277459239,
    ];
    const B: [f64; 5] =
        [-5.447609879822406e1, 1.615858368580409e2, -1.556989798598866e2, 6.680131188771972e1, -1.328068155288572e1];
    const C: [f64; 6] = [
        -7.784894002430293e-3,
        -3.223964580411365e-1,
        -2.400758277161838,
        -2.549732539343734,
        4.374664141464968,
        2.938163982698783,
    ];
    const D: [f64; 4] = [7.784695709041462e-3, 3.224671290700398e-1, 2.445134137142996, 3.754408661907416];
    const TAIL: f64 = 0.02425;
    let series = |coefficients: &[f64], x: f64| coefficients.iter().fold(0.0, |sum, c| sum * x + c);
    let tail = |p: f64| {
        let q = (-2.0 * p.ln()).sqrt();
        series(&C, q) / (series(&D, q) * q + 1.0)
    };
    if p < TAIL {
        tail(p)
    } else if p > 1.0 - TAIL {
        -tail(1.0 - p)
    } else {
        let q = p - 0.5;
        let r = q * q;
        series(&A, r) * q / (series(&B, r) * r + 1.0)
    }
}

/// Weights of the discrete Gaussian from its middle outwards: `exp(-σ²) I_n(σ²)` with the modified Bessel function.
///
/// Unlike samples of the continuous bell it has the variance σ² exactly, for small σ too.
/// Reference: Lindeberg 1990, "Scale-space for discrete signals", eq. 19.
fn kernel(sigma_px: f64) -> Vec<f32> {
    let variance = sigma_px.min(MAX_BLUR_PX).powi(2);
    let weight = |n: usize| {
        // I_n(t) = Σ_k (t/2)^(2k+n) / (k! (k+n)!), each term scaled by exp(-t) through its logarithm.
        let half_ln = (0.5 * variance).ln();
        let ln_factorial = |m: usize| (2..=m).map(|i| (i as f64).ln()).sum::<f64>();
        let terms = (variance * 1.5) as usize + 40;
        (0..terms)
            .map(|k| ((2 * k + n) as f64 * half_ln - ln_factorial(k) - ln_factorial(k + n) - variance).exp())
            .sum::<f64>()
    };
    let mut weights = vec![weight(0)];
    while weights.len() < 200 {
        let next = weight(weights.len());
        if next < BLUR_CUT {
            break;
        }
        weights.push(next);
    }
    let total = weights[0] + 2.0 * weights[1..].iter().sum::<f64>();
    weights.iter().map(|w| (w / total) as f32).collect()
}

/// Separable blur of interleaved colours; the border is continued outwards.
fn blur(colours: &[f32], width: usize, sigma_px: f64) -> Vec<f32> {
    let weights = kernel(sigma_px);
    let row_length = 3 * width;
    if colours.is_empty() {
        return Vec::new();
    }
    let mut across = vec![0.0; colours.len()];
    let mut padded = vec![0.0; row_length + 6 * weights.len()];
    for (out, row) in across.chunks_exact_mut(row_length).zip(colours.chunks_exact(row_length)) {
        blur_row(row, &weights, &mut padded, out);
    }
    let rows: Vec<&[f32]> = across.chunks_exact(row_length).collect();
    let mut both = vec![0.0; colours.len()];
    for (y, out) in both.chunks_exact_mut(row_length).enumerate() {
        for (sum, value) in out.iter_mut().zip(rows[y]) {
            *sum = weights[0] * value;
        }
        for (k, weight) in weights.iter().enumerate().skip(1) {
            let above = rows[y.saturating_sub(k)];
            let below = rows[(y + k).min(rows.len() - 1)];
            for ((sum, a), b) in out.iter_mut().zip(above).zip(below) {
                *sum += weight * (a + b);
            }
        }
    }
    both
}

fn blur_row(row: &[f32], weights: &[f32], padded: &mut [f32], out: &mut [f32]) {
    let margin = 3 * weights.len();
    let (left, rest) = padded.split_at_mut(margin);
    let (middle, right) = rest.split_at_mut(row.len());
    middle.copy_from_slice(row);
    for (edge, pixel) in [(left, &row[..3]), (right, &row[row.len() - 3..])] {
        for colour in edge.chunks_exact_mut(3) {
            colour.copy_from_slice(pixel);
        }
    }
    for (sum, value) in out.iter_mut().zip(row) {
        *sum = weights[0] * value;
    }
    for (k, weight) in weights.iter().enumerate().skip(1) {
        let (before, after) = (&padded[margin - 3 * k..], &padded[margin + 3 * k..]);
        for ((sum, a), b) in out.iter_mut().zip(before).zip(after) {
            *sum += weight * (a + b);
        }
    }
}

#[cfg(test)]
#[path = "imaging_tests.rs"]
mod tests;
