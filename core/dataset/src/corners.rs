//! Corner tables: points of the target that were detected elsewhere.

use std::collections::BTreeMap;
use std::path::PathBuf;

use nalgebra::Vector2;

use super::error::{DatasetError, DatasetProblem, shown};
use super::text::{Table, TextFile};
use handeye_geometry::targets::TargetSpec;
use handeye_geometry::targets::observation::Corner;

/// How far outside of the image a corner may be, in pixels: room for a pixel origin at the corner of the pixel and for
/// a refinement that slid over the border.
const BORDER_PX: f64 = 1.0;

/// All corners of one image.
pub(super) struct ImageCorners {
    /// The image as the table names it.
    pub name: String,
    /// Line and corner, in the order of the table.
    points: Vec<(usize, Corner)>,
}

impl ImageCorners {
    /// Line of the first corner.
    pub fn line(&self) -> Option<usize> {
        self.points.first().map(|(line, _)| *line)
    }

    /// The corners sorted by their index, after a look at the image that they are in.
    pub fn inside(&self, file: &TextFile, size: (u32, u32)) -> Result<Vec<Corner>, DatasetError> {
        let is_inside = |px: f64, side: u32| (-BORDER_PX..=f64::from(side) - 1.0 + BORDER_PX).contains(&px);
        for (line, corner) in &self.points {
            if !(is_inside(corner.px.x, size.0) && is_inside(corner.px.y, size.1)) {
                let problem = DatasetProblem::OutsideImage { u_px: corner.px.x, v_px: corner.px.y, size };
                return Err(DatasetError::new(&file.path, Some(*line), problem));
            }
        }
        let mut corners: Vec<Corner> = self.points.iter().map(|(_, corner)| *corner).collect();
        corners.sort_by_key(|c| c.index);
        Ok(corners)
    }
}

/// Corners by image, keyed by the path of the image in the data set.
pub(super) type CornerTable = BTreeMap<PathBuf, ImageCorners>;

/// Reads a table `image,column,row,u,v`. No point of an image is there twice.
pub(super) fn read_corners(file: &TextFile, target: &TargetSpec) -> Result<CornerTable, DatasetError> {
    let header = vec!["image", "column", "row", "u", "v"];
    let table = Table::parse(file, &[header], "one row per corner and image is needed")?;
    let grid = target.grid();
    let mut first_rows = BTreeMap::new();
    let mut images = CornerTable::new();
    for row in &table.rows {
        let name = row.text(0);
        let path = table.image_path(row, 0)?;
        let (at_column, at_row) = (table.index(row, 1)?, table.index(row, 2)?);
        if at_column >= grid.columns || at_row >= grid.rows {
            let (columns, rows) = (grid.columns, grid.rows);
            return Err(table.fail(row, DatasetProblem::OffGrid { column: at_column, row: at_row, columns, rows }));
        }
        let index = at_row * grid.columns + at_column;
        if let Some(first_row) = first_rows.insert((path.clone(), index), row.line) {
            let what = format!("column {at_column}, row {at_row} of image {:?}", shown(name));
            return Err(table.fail(row, DatasetProblem::Duplicate { what, first_row }));
        }
        let corner = Corner::new(index, Vector2::from(table.numbers::<2>(row, 3)?));
        let image = images.entry(path).or_insert_with(|| ImageCorners { name: name.to_owned(), points: Vec::new() });
        image.points.push((row.line, corner));
    }
    Ok(images)
}
