//! `sim.*`: how large shapes are.

use nalgebra::{Isometry3, Point3, Vector3};

use super::{Call, Outcome, Table, several};
use crate::cell::Cell;
use handeye_cell::render::Shape;
use handeye_cell::world::{Handle, Kind, WorldError};
use handeye_wire as wire;

pub(super) const FUNCTIONS: Table = &[("getShapeBB", get_shape_bb)];

/// Thickness of the sheet that the board is printed on, metres.
const SHEET_M: f64 = 0.002;

/// Lengths of the edges, and where the middle is in the frame of the shape, as CoppeliaSim has them since 4.7.
fn get_shape_bb(call: &mut Call<'_>) -> Outcome {
    let handle = call.args.handle(0)?;
    if !matches!(call.cell.world.tree.get(handle)?.kind, Kind::Shape) {
        return Err(WorldError::InvalidArguments.into());
    }
    let [min, max] = bounds(call.cell, handle);
    let (size, middle) = (max - min, nalgebra::center(&min, &max));
    let pose = [middle.x, middle.y, middle.z, 0.0, 0.0, 0.0, 1.0];
    several([wire::floats([size.x, size.y, size.z]), wire::floats(pose)])
}

/// The corners of the box about a shape along the axes of its frame, metres; both at the origin for one that is nothing but a
/// frame.
pub(super) fn bounds(cell: &Cell, handle: Handle) -> [Point3<f64>; 2] {
    let sheet = (handle == cell.stage.plane).then(|| {
        let [x, y] = cell.scene.paper_m;
        let half = Vector3::new(x, y, SHEET_M) / 2.0;
        // It is printed on its upper side, which is where its frame is.
        let middle = Vector3::new(0.0, 0.0, -SHEET_M / 2.0);
        [Point3::from(middle - half), Point3::from(middle + half)]
    });
    let solids = cell.stage.solids.iter().filter(|(of, _)| *of == handle);
    let all =
        solids.flat_map(|(_, solid)| corners(&solid.shape, &solid.world_from_shape)).chain(sheet.into_iter().flatten());
    let bounds = all.fold(None, |bounds: Option<[Point3<f64>; 2]>, corner| {
        let [min, max] = bounds.unwrap_or([corner; 2]);
        Some([min.inf(&corner), max.sup(&corner)])
    });
    bounds.unwrap_or([Point3::origin(); 2])
}

/// Points whose box is that of a solid; none for an infinite one.
fn corners(shape: &Shape, object_from_shape: &Isometry3<f64>) -> Vec<Point3<f64>> {
    let of_box = |half: Vector3<f64>| -> Vec<Point3<f64>> {
        let signs = [-1.0, 1.0];
        let all = signs.iter().flat_map(|&x| signs.iter().flat_map(move |&y| signs.map(|z| Vector3::new(x, y, z))));
        all.map(|sign| object_from_shape * Point3::from(half.component_mul(&sign))).collect()
    };
    let ball = |at: Point3<f64>, radius: f64| {
        let at = object_from_shape * at;
        [at - Vector3::repeat(radius), at + Vector3::repeat(radius)]
    };
    match *shape {
        Shape::Sphere { radius } => ball(Point3::origin(), radius).to_vec(),
        Shape::Capsule { a, b, radius } => [ball(a, radius), ball(b, radius)].concat(),
        Shape::Box { half_extents } => of_box(half_extents),
        Shape::Cylinder { radius, half_height } => of_box(Vector3::new(radius, radius, half_height)),
        Shape::Plane => Vec::new(),
    }
}
