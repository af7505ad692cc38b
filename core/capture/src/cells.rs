//! An image in a few thousand cells, to see whether it changes.

use image::GrayImage;

/// About this many cells along a row: few enough to be quick, small enough that an edge that moves by a tenth of a
/// pixel changes its cells by more than the noise of their mean.
const COLUMNS: u32 = 80;

/// Brightness may change by this factor from one image to another, as lamps and exposure make it; more is a change.
const GAIN: (f64, f64) = (0.5, 2.0);

/// Means of square cells of a grey image.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Cells {
    size: (u32, u32),
    means: Vec<f64>,
}

impl Cells {
    /// Cells at the border count with their part inside of the image.
    pub fn of(grey: &GrayImage) -> Self {
        let (width, height) = grey.dimensions();
        let side = width.div_ceil(COLUMNS).max(1);
        let columns = width.div_ceil(side) as usize;
        let rows = height.div_ceil(side) as usize;
        let mut sums = vec![0u32; columns * rows];
        for (v, line) in grey.as_raw().chunks_exact(width.max(1) as usize).enumerate() {
            let cells = &mut sums[v / side as usize * columns..][..columns];
            for (sum, part) in cells.iter_mut().zip(line.chunks(side as usize)) {
                *sum += part.iter().map(|&level| u32::from(level)).sum::<u32>();
            }
        }
        let extent = |cell: usize, of: u32| side.min(of - cell as u32 * side);
        let mean = |(i, &sum): (usize, &u32)| {
            let pixels = extent(i % columns, width) * extent(i / columns, height);
            f64::from(sum) / f64::from(pixels)
        };
        Self { size: (width, height), means: sums.iter().enumerate().map(mean).collect() }
    }

    /// Number of cells.
    pub fn count(&self) -> usize {
        self.means.len()
    }

    /// Whether both are of images of the same size.
    pub fn fits(&self, other: &Self) -> bool {
        self.size == other.size
    }

    /// Mean absolute difference in grey levels, apart from a change of brightness and contrast of the whole image:
    /// of `other − (gain · self + offset)` with gain and offset by least squares, over `√((1 + gain²) / 2)`, so that
    /// the same noise in both makes the same difference whatever the gain.
    pub fn difference(&self, other: &Self) -> f64 {
        let count = self.means.len().max(1) as f64;
        let mean = |cells: &Self| cells.means.iter().sum::<f64>() / count;
        let (a0, b0) = (mean(self), mean(other));
        let pairs = || self.means.iter().zip(&other.means).map(|(a, b)| (a - a0, b - b0));
        let (squared, crossed) = pairs().fold((0.0, 0.0), |(s, c), (a, b)| (s + a * a, c + a * b));
        let gain = if squared > 0.0 { (crossed / squared).clamp(GAIN.0, GAIN.1) } else { 1.0 };
        let share_of_noise = (0.5 * (1.0 + gain * gain)).sqrt();
        pairs().map(|(a, b)| (b - gain * a).abs()).sum::<f64>() / (count * share_of_noise)
    }
}
