//! What is drawn in the 3D pane, sorted so that what is nearer covers what is farther.

use egui::epaint::{Mesh, Vertex};
use egui::{Align2, Color32, FontId, Painter, Pos2, Shape, Stroke};
use nalgebra::{Isometry3, Point3, Vector3};

use super::eye::{Eye, ScreenPoint};

/// Number of sides of round shapes.
const SIDES: usize = 20;
/// Share of its colour that a face keeps when it is turned away from the light.
const SHADOW: f32 = 0.45;
/// Direction of the light in the axes of the eye: from the left, above and behind it.
const LIGHT: [f64; 3] = [-0.42, 0.62, -0.66];

/// Something with the distance by which it is sorted.
struct Item {
    depth_m: f64,
    shape: Shape,
}

/// Words next to a point.
struct Words {
    at: Pos2,
    text: String,
    colour: Color32,
}

/// Collects shapes in the base and draws them from back to front.
pub struct Canvas {
    /// From where it is seen.
    pub eye: Eye,
    /// Colour of what is in shadow.
    shadow: Color32,
    ground: Vec<Shape>,
    items: Vec<Item>,
    words: Vec<Words>,
    light: Vector3<f64>,
}

/// A straight round body.
pub struct Cylinder {
    /// The middles of both ends.
    pub ends: [Point3<f64>; 2],
    /// Its radius \[m\].
    pub radius_m: f64,
    /// Whether its ends can be seen; those of a tube are inside of other bodies.
    pub closed: bool,
}

impl Canvas {
    /// Nothing yet. What is in shadow fades to a colour.
    pub fn new(eye: Eye, shadow: Color32) -> Self {
        let light = eye.axes().iter().zip(LIGHT).map(|(axis, part)| axis * part).sum::<Vector3<f64>>().normalize();
        Self { eye, shadow, ground: Vec::new(), items: Vec::new(), words: Vec::new(), light }
    }

    fn push(&mut self, depth_m: f64, shape: impl Into<Shape>) {
        self.items.push(Item { depth_m, shape: shape.into() });
    }

    /// A line under everything.
    pub fn ground_line(&mut self, ends: [Point3<f64>; 2], stroke: Stroke) {
        if let Some(ends) = self.eye.segment(ends) {
            self.ground.push(Shape::line_segment(ends.map(|end| end.at), stroke));
        }
    }

    /// A straight line.
    pub fn line(&mut self, ends: [Point3<f64>; 2], stroke: Stroke) {
        if let Some(ends) = self.eye.segment(ends) {
            self.push(mean_depth_m(&ends), Shape::line_segment(ends.map(|end| end.at), stroke));
        }
    }

    /// A straight line on a face of about this size \[m\], which does not hide it; dashed if wanted.
    pub fn line_on_face(&mut self, ends: [Point3<f64>; 2], stroke: Stroke, dashed: bool, size_m: f64) {
        if let Some(ends) = self.eye.segment(ends) {
            let points = ends.map(|end| end.at);
            let shape = if dashed {
                Shape::Vec(Shape::dashed_line(&points, stroke, 5.0, 4.0))
            } else {
                Shape::line_segment(points, stroke)
            };
            self.push(mean_depth_m(&ends) - size_m, shape);
        }
    }

    /// A flat convex face.
    pub fn face(&mut self, corners: &[Point3<f64>], fill: Color32) {
        let seen = self.eye.polygon(corners);
        if seen.len() >= 3 {
            self.push(mean_depth_m(&seen), polygon(&seen, fill));
        }
    }

    /// Flat faces in one plane, drawn over each other in this order.
    pub fn faces(&mut self, faces: impl IntoIterator<Item = (Vec<Point3<f64>>, Color32)>) {
        let mut depth_m = None;
        let mut shapes = Vec::new();
        for (corners, fill) in faces {
            let seen = self.eye.polygon(&corners);
            if seen.len() >= 3 {
                depth_m.get_or_insert(mean_depth_m(&seen));
                shapes.push(polygon(&seen, fill));
            }
        }
        if let Some(depth_m) = depth_m {
            self.push(depth_m, Shape::Vec(shapes));
        }
    }

    /// A dot of a size on the screen.
    pub fn dot(&mut self, point: &Point3<f64>, radius: f32, colour: Color32) {
        if let Some(seen) = self.eye.point(point) {
            self.push(seen.depth_m, Shape::circle_filled(seen.at, radius, colour));
        }
    }

    /// The axes of a frame, x, y and z in their colours.
    pub fn axes(&mut self, base_from_frame: &Isometry3<f64>, length_m: f64, width: f32, colours: [Color32; 3]) {
        let origin = base_from_frame * Point3::origin();
        for (axis, colour) in [Vector3::x(), Vector3::y(), Vector3::z()].into_iter().zip(colours) {
            let end = base_from_frame * Point3::from(axis * length_m);
            self.line([origin, end], Stroke::new(width, colour));
        }
    }

    /// Words over everything, next to a point.
    pub fn words(&mut self, point: &Point3<f64>, text: impl Into<String>, colour: Color32) {
        if let Some(seen) = self.eye.point(point) {
            self.words.push(Words { at: seen.at, text: text.into(), colour });
        }
    }

    /// A colour in the light that falls on a surface with this normal.
    fn lit(&self, colour: Color32, normal: &Vector3<f64>) -> Color32 {
        let light = normal.dot(&self.light).max(0.0) as f32;
        self.shadow.lerp_to_gamma(colour, SHADOW + (1.0 - SHADOW) * light)
    }

    /// A round body, not drawn while a part of it is behind the eye.
    pub fn cylinder(&mut self, body: &Cylinder, colour: Color32) {
        let [from, to] = body.ends;
        let Some(axis) = (to - from).try_normalize(1e-9) else { return };
        let across = perpendicular(&axis);
        let beside = axis.cross(&across);
        let normals: Vec<Vector3<f64>> = (0..SIDES)
            .map(|side| {
                let (sin, cos) = (side as f64 / SIDES as f64 * std::f64::consts::TAU).sin_cos();
                across * cos + beside * sin
            })
            .collect();
        let ring = |middle: Point3<f64>| -> Option<Vec<Pos2>> {
            let on_screen = |normal| self.eye.point(&(middle + normal * body.radius_m)).map(|seen| seen.at);
            normals.iter().map(on_screen).collect()
        };
        let (Some(first), Some(second)) = (ring(from), ring(to)) else { return };
        let mut mesh = Mesh::default();
        let colours: Vec<Color32> = normals.iter().map(|normal| self.lit(colour, normal)).collect();
        for side in 0..SIDES {
            let next = (side + 1) % SIDES;
            let normal = normals[side] + normals[next];
            if self.eye.faces(&(from + normal * (0.5 * body.radius_m)), &normal) {
                let corners = [(first[side], side), (first[next], next), (second[next], next), (second[side], side)];
                fan(&mut mesh, corners.iter().map(|&(at, vertex)| (at, colours[vertex])));
            }
        }
        if body.closed {
            for (ring, middle, outwards) in [(&first, from, -axis), (&second, to, axis)] {
                if self.eye.faces(&middle, &outwards) {
                    let colour = self.lit(colour, &outwards);
                    fan(&mut mesh, ring.iter().map(|&at| (at, colour)));
                }
            }
        }
        // At most half of a body is visible, and its outline hides the steps at the edge of a mesh.
        let outline = convex_hull(first.into_iter().chain(second).collect());
        let edge = Stroke::new(1.2, self.shadow.lerp_to_gamma(colour, 0.42));
        let middle = nalgebra::center(&from, &to);
        let depth_m = (middle - self.eye.at()).norm() - if body.closed { body.radius_m } else { 0.0 };
        self.push(depth_m, Shape::Vec(vec![Shape::mesh(mesh), Shape::closed_line(outline, edge)]));
    }

    /// The round end of a body, not drawn behind the eye.
    pub fn ball(&mut self, middle: &Point3<f64>, radius_m: f64, colour: Color32) {
        let [right, up, forward] = self.eye.axes();
        let Some(seen) = self.eye.point(middle) else { return };
        let mut mesh = Mesh::default();
        mesh.colored_vertex(seen.at, self.lit(colour, &-forward));
        for side in 0..SIDES {
            let (sin, cos) = (side as f64 / SIDES as f64 * std::f64::consts::TAU).sin_cos();
            let normal = right * cos + up * sin;
            let Some(edge) = self.eye.point(&(middle + normal * radius_m)) else { return };
            mesh.colored_vertex(edge.at, self.lit(colour, &normal));
            mesh.add_triangle(0, 1 + side as u32, 1 + ((side + 1) % SIDES) as u32);
        }
        self.push((middle - self.eye.at()).norm(), Shape::mesh(mesh));
    }

    /// Draws everything.
    pub fn paint(mut self, painter: &Painter) {
        painter.extend(self.ground);
        self.items.sort_by(|a, b| b.depth_m.total_cmp(&a.depth_m));
        painter.extend(self.items.into_iter().map(|item| item.shape));
        for Words { at, text, colour } in self.words {
            painter.text(at, Align2::CENTER_CENTER, text, FontId::proportional(12.0), colour);
        }
    }

    /// The depths of the shapes in the order in which they are drawn, for tests.
    #[cfg(test)]
    pub(crate) fn depths_m(&self) -> Vec<f64> {
        let mut depths: Vec<f64> = self.items.iter().map(|item| item.depth_m).collect();
        depths.sort_by(|a, b| b.total_cmp(a));
        depths
    }
}

fn mean_depth_m(seen: &[ScreenPoint]) -> f64 {
    seen.iter().map(|seen| seen.depth_m).sum::<f64>() / seen.len().max(1) as f64
}

/// A face on the screen, with smooth edges where it is not so slim that they would become spikes.
fn polygon(seen: &[ScreenPoint], fill: Color32) -> Shape {
    let points: Vec<Pos2> = seen.iter().map(|seen| seen.at).collect();
    if is_blunt(&points) {
        return Shape::convex_polygon(points, fill, Stroke::NONE);
    }
    let mut mesh = Mesh::default();
    fan(&mut mesh, points.into_iter().map(|at| (at, fill)));
    Shape::mesh(mesh)
}

/// Whether all corners of a polygon are wider than about 20°.
fn is_blunt(points: &[Pos2]) -> bool {
    const LEAST_SINE: f32 = 0.35;
    let count = points.len();
    (0..count).all(|index| {
        let corner = points[index];
        let back = (points[(index + count - 1) % count] - corner).normalized();
        let forth = (points[(index + 1) % count] - corner).normalized();
        (back.x * forth.y - back.y * forth.x).abs() > LEAST_SINE || back.dot(forth) < 0.0
    })
}

/// A convex polygon with a colour at each corner.
fn fan(mesh: &mut Mesh, corners: impl Iterator<Item = (Pos2, Color32)>) {
    let first = mesh.vertices.len() as u32;
    mesh.vertices.extend(corners.map(|(at, colour)| Vertex::untextured(at, colour)));
    let last = mesh.vertices.len() as u32;
    for corner in first + 1..last.saturating_sub(1) {
        mesh.add_triangle(first, corner, corner + 1);
    }
}

/// Some unit vector across another one.
fn perpendicular(axis: &Vector3<f64>) -> Vector3<f64> {
    let other = if axis.x.abs() < 0.8 { Vector3::x() } else { Vector3::y() };
    axis.cross(&other).normalize()
}

/// The convex outline of points: Andrew's monotone chain.
fn convex_hull(mut points: Vec<Pos2>) -> Vec<Pos2> {
    points.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    let turns = |a: Pos2, b: Pos2, c: Pos2| (b - a).x * (c - a).y - (b - a).y * (c - a).x;
    let half = |points: &mut dyn Iterator<Item = Pos2>| {
        let mut chain: Vec<Pos2> = Vec::new();
        for point in points {
            while chain.len() >= 2 && turns(chain[chain.len() - 2], chain[chain.len() - 1], point) <= 0.0 {
                chain.pop();
            }
            chain.push(point);
        }
        chain.pop();
        chain
    };
    let mut hull = half(&mut points.iter().copied());
    hull.extend(half(&mut points.iter().rev().copied()));
    hull
}

#[cfg(test)]
mod tests {
    use egui::{Rect, pos2, vec2};

    use super::*;
    use handeye_workbench::model::SceneView;

    fn canvas() -> Canvas {
        let room = Rect::from_min_size(pos2(0.0, 0.0), vec2(600.0, 400.0));
        Canvas::new(Eye::new(&SceneView::default(), room), Color32::BLACK)
    }

    #[test]
    fn what_is_farther_is_drawn_first_in_whatever_order_it_came() {
        let mut canvas = canvas();
        let [_, _, forward] = canvas.eye.axes();
        let at = canvas.eye.at();
        for depth_m in [1.0, 3.0, 2.0] {
            canvas.dot(&(at + forward * depth_m), 2.0, Color32::WHITE);
        }
        canvas.dot(&(at - forward), 2.0, Color32::WHITE);
        let depths = canvas.depths_m();
        assert_eq!(depths.len(), 3, "what is behind the eye is not drawn");
        for (depth_m, expected) in depths.into_iter().zip([3.0, 2.0, 1.0]) {
            assert!((depth_m - expected).abs() < 1e-9);
        }
    }

    #[test]
    fn half_of_the_sides_of_a_body_and_one_end_are_seen() {
        let mut canvas = canvas();
        let [right, _, forward] = canvas.eye.axes();
        let middle = canvas.eye.at() + forward * 2.0;
        let ends = [middle - right * 0.2, middle + right * 0.2 - forward * 0.1];
        canvas.cylinder(&Cylinder { ends, radius_m: 0.05, closed: true }, Color32::WHITE);
        let Shape::Vec(shapes) = &canvas.items[0].shape else { panic!("a mesh and its outline") };
        let Shape::Mesh(mesh) = &shapes[0] else { panic!("a mesh") };
        let sides = (mesh.vertices.len() - SIDES) / 4;
        assert!((SIDES / 2 - 1..=SIDES / 2).contains(&sides), "{sides}");
        assert!(mesh.is_valid());
    }

    #[test]
    fn a_body_through_the_eye_or_without_length_is_left_out() {
        let mut canvas = canvas();
        let (at, [_, _, forward]) = (canvas.eye.at(), canvas.eye.axes());
        for ends in [[at - forward, at + forward], [at + forward, at + forward]] {
            canvas.cylinder(&Cylinder { ends, radius_m: 0.05, closed: true }, Color32::WHITE);
        }
        assert!(canvas.items.is_empty());
    }

    #[test]
    fn a_face_seen_from_its_edge_is_drawn_without_spikes() {
        let square = [pos2(0.0, 0.0), pos2(9.0, 0.0), pos2(9.0, 9.0), pos2(0.0, 9.0)];
        assert!(is_blunt(&square));
        let slim = [pos2(0.0, 0.0), pos2(60.0, 0.0), pos2(30.0, 2.0)];
        assert!(!is_blunt(&slim));
        let seen = slim.map(|at| ScreenPoint { at, depth_m: 1.0 });
        assert!(matches!(polygon(&seen, Color32::WHITE), Shape::Mesh(_)));
    }

    #[test]
    fn a_line_on_a_face_is_drawn_after_it_also_at_its_far_edge() {
        let mut canvas = canvas();
        let [right, up, forward] = canvas.eye.axes();
        let middle = canvas.eye.at() + forward * 2.0;
        let corner = |x: f64, y: f64| middle + right * x + (up * 0.3 + forward) * y;
        let sheet = [corner(-0.1, -0.1), corner(0.1, -0.1), corner(0.1, 0.1), corner(-0.1, 0.1)];
        canvas.face(&sheet, Color32::WHITE);
        canvas.line_on_face([sheet[2], sheet[3]], Stroke::new(1.0, Color32::RED), false, 0.2);
        let [face, line] = &canvas.items[..] else { panic!("two items") };
        assert!(line.depth_m < face.depth_m);
    }

    #[test]
    fn the_outline_goes_once_around_all_points() {
        let square = [pos2(0.0, 0.0), pos2(4.0, 0.0), pos2(4.0, 4.0), pos2(0.0, 4.0)];
        let inside = [pos2(1.0, 1.0), pos2(2.0, 3.0), pos2(2.0, 0.0)];
        let hull = convex_hull(square.into_iter().chain(inside).collect());
        assert_eq!(hull.len(), 4);
        assert!(square.iter().all(|corner| hull.contains(corner)));
    }
}
