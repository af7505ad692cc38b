//! Which part of the image the target has been seen in.

use nalgebra::Vector2;

use handeye_geometry::targets::observation::Corner;

/// Corners counted on a grid of cells over the image, and the outline of every board.
#[derive(Debug, Clone, PartialEq)]
pub struct Coverage {
    /// Cells side by side.
    pub columns: usize,
    /// Cells above each other.
    pub rows: usize,
    /// Corners in each cell, row by row from the top left.
    pub counts: Vec<usize>,
    /// The board in every view that has corners, in the order of the views.
    pub outlines: Vec<Outline>,
}

/// Where one board is in the image.
#[derive(Debug, Clone, PartialEq)]
pub struct Outline {
    /// Name of the view.
    pub view: String,
    /// Whether the view takes part in the fit.
    pub in_fit: bool,
    /// Convex hull of the corners, pixels, clockwise on the screen; two points or one where there are no more.
    pub px: Vec<Vector2<f64>>,
}

/// A view as input to the coverage.
#[derive(Debug, Clone, Copy)]
pub struct CoveredView<'a> {
    /// Name of the view, as findings cite it.
    pub name: &'a str,
    /// The corners that were detected in it.
    pub corners: &'a [Corner],
    /// Whether its corners count; its outline is there either way.
    pub in_fit: bool,
}

impl Coverage {
    /// Counts corners on `columns` × `rows` cells of equal size over an image of `width` × `height` pixels. Corners
    /// that are outside the image or not finite are not counted; nothing is when there is no cell or no image.
    pub fn new<'a>(
        (width, height): (u32, u32),
        (columns, rows): (usize, usize),
        views: impl IntoIterator<Item = CoveredView<'a>>,
    ) -> Self {
        let mut out = Self { columns, rows, counts: vec![0; columns * rows], outlines: Vec::new() };
        // Pixel centres are whole numbers: the image begins half a pixel before the first.
        let cell = |px: f64, pixels: u32, cells: usize| {
            let at = (px + 0.5) / f64::from(pixels) * cells as f64;
            (at >= 0.0 && at < cells as f64).then_some(at as usize)
        };
        for view in views {
            let finite: Vec<Vector2<f64>> =
                view.corners.iter().map(|c| c.px).filter(|px| px.x.is_finite() && px.y.is_finite()).collect();
            if view.in_fit {
                for px in &finite {
                    if let (Some(column), Some(row)) = (cell(px.x, width, columns), cell(px.y, height, rows)) {
                        out.counts[row * columns + column] += 1;
                    }
                }
            }
            if !finite.is_empty() {
                out.outlines.push(Outline { view: view.name.to_owned(), in_fit: view.in_fit, px: hull(finite) });
            }
        }
        out
    }

    /// Corners in one cell; 0 outside the grid.
    pub fn count(&self, column: usize, row: usize) -> usize {
        if column < self.columns { self.counts.get(row * self.columns + column).copied().unwrap_or(0) } else { 0 }
    }

    /// Part of the cells with at least one corner, 0 to 1.
    pub fn covered(&self) -> f64 {
        let covered = self.counts.iter().filter(|&&n| n > 0).count();
        covered as f64 / self.counts.len().max(1) as f64
    }
}

/// Convex hull by Andrew's monotone chain (1979).
fn hull(mut points: Vec<Vector2<f64>>) -> Vec<Vector2<f64>> {
    points.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    points.dedup();
    if points.len() < 3 {
        return points;
    }
    let chain = |points: &mut dyn Iterator<Item = &Vector2<f64>>| {
        let mut side: Vec<Vector2<f64>> = Vec::new();
        for p in points {
            // Rows count downwards, so a positive turn is clockwise on the screen.
            while side.len() >= 2
                && (side[side.len() - 1] - side[side.len() - 2]).perp(&(p - side[side.len() - 1])) <= 0.0
            {
                side.pop();
            }
            side.push(*p);
        }
        side.pop();
        side
    };
    let mut out = chain(&mut points.iter());
    out.extend(chain(&mut points.iter().rev()));
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn corners(px: &[[f64; 2]]) -> Vec<Corner> {
        px.iter().enumerate().map(|(index, p)| Corner::new(index, Vector2::from(*p))).collect()
    }

    #[test]
    fn every_corner_in_the_image_is_counted_in_its_cell_and_no_other() {
        let seen = corners(&[[-0.5, -0.5], [79.4, 0.0], [79.6, 0.0], [639.4, 479.4], [640.0, 10.0], [f64::NAN, 1.0]]);
        let view = CoveredView { name: "a", corners: &seen, in_fit: true };
        let coverage = Coverage::new((640, 480), (8, 6), [view]);
        assert_eq!((coverage.count(0, 0), coverage.count(1, 0), coverage.count(7, 5)), (2, 1, 1));
        assert_eq!(coverage.counts.iter().sum::<usize>(), 4);
        assert!((coverage.covered() - 3.0 / 48.0).abs() < 1e-12);
    }

    #[test]
    fn a_view_left_out_has_an_outline_and_counts_nowhere() {
        let seen = corners(&[[10.0, 10.0], [100.0, 10.0], [100.0, 60.0], [10.0, 60.0], [50.0, 30.0], [55.0, 10.0]]);
        let coverage = Coverage::new((640, 480), (8, 6), [CoveredView { name: "a", corners: &seen, in_fit: false }]);
        assert_eq!(coverage.covered(), 0.0);
        let expected = [[10.0, 10.0], [100.0, 10.0], [100.0, 60.0], [10.0, 60.0]].map(Vector2::from);
        assert_eq!(coverage.outlines[0].px, expected, "corners inside and on an edge are no part of the outline");
        assert!(!coverage.outlines[0].in_fit);
    }

    #[test]
    fn no_image_and_no_cells_are_no_coverage_and_no_panic() {
        let seen = corners(&[[10.0, 10.0]]);
        let view = CoveredView { name: "a", corners: &seen, in_fit: true };
        assert_eq!(Coverage::new((0, 0), (8, 6), [view]).covered(), 0.0);
        assert_eq!(Coverage::new((640, 480), (0, 0), [view]).covered(), 0.0);
    }
}
