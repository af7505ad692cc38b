//! Images of the drawing that is printed, by samples.

use nalgebra::{Rotation3, Vector2, Vector3};

use super::Scene;
use handeye_geometry::targets::TargetSpec;
use handeye_print::Drawing;

/// Samples along a side of a pixel that an outline crosses: 1/100 of a pixel's contrast at the worst.
const SAMPLES: usize = 10;
/// Buckets of shapes along a side.
const BUCKETS: usize = 96;

/// A drawing and which of its shapes are where.
pub(super) struct Drawn {
    drawing: Drawing,
    buckets: Buckets,
}

impl Drawn {
    pub fn of(target: &TargetSpec) -> Self {
        let drawing = Drawing::of(target).expect("drawn");
        let buckets = Buckets::of(&drawing);
        Self { drawing, buckets }
    }

    /// The light in every pixel before the lens blurs it.
    pub fn levels(&self, scene: &Scene, table: f64) -> Vec<f64> {
        let (width, height) = (scene.camera.width as usize, scene.camera.height as usize);
        let inverse = scene.camera_from_target.inverse();
        let eye = Eye {
            drawn: self,
            scene,
            table,
            target_from_camera: inverse.rotation.to_rotation_matrix(),
            at: inverse.translation.vector,
        };
        // Levels at the corners of pixels, shared by their neighbours.
        let across = width + 1;
        let corner = |i: usize| eye.level((i % across) as f64 - 0.5, (i / across) as f64 - 0.5);
        let corners: Vec<f64> = (0..across * (height + 1)).map(corner).collect();
        let mut levels = Vec::with_capacity(width * height);
        for v in 0..height {
            for u in 0..width {
                let first = v * across + u;
                let centre = eye.level(u as f64, v as f64);
                let around = [corners[first], corners[first + 1], corners[first + across], corners[first + across + 1]];
                let even = around.iter().all(|level| *level == centre);
                levels.push(if even { centre } else { eye.mean_level(u as f64, v as f64) });
            }
        }
        levels
    }
}

/// The camera in the frame of the target.
struct Eye<'a> {
    drawn: &'a Drawn,
    scene: &'a Scene,
    table: f64,
    target_from_camera: Rotation3<f64>,
    at: Vector3<f64>,
}

impl Eye<'_> {
    fn mean_level(&self, u: f64, v: f64) -> f64 {
        let place = |i: usize| (i as f64 + 0.5) / SAMPLES as f64 - 0.5;
        let all = (0..SAMPLES * SAMPLES).map(|i| self.level(u + place(i % SAMPLES), v + place(i / SAMPLES)));
        all.sum::<f64>() / (SAMPLES * SAMPLES) as f64
    }

    fn level(&self, u: f64, v: f64) -> f64 {
        let Some(ray) = self.scene.camera.unproject(&Vector2::new(u, v)).ok() else { return self.table };
        let Drawn { drawing, buckets } = self.drawn;
        let towards = self.target_from_camera * ray.into_inner();
        let p = (self.at - towards * (self.at.z / towards.z)).xy();
        let (low, high, quiet) = (buckets.low, buckets.high, drawing.quiet_m);
        let on_paper = p.x > low.x - quiet && p.y > low.y - quiet && p.x < high.x + quiet && p.y < high.y + quiet;
        if !on_paper {
            return self.table;
        }
        let black = buckets.at(&p).iter().any(|&i| drawing.shapes[i].contains(&p));
        if black { self.scene.dark } else { self.scene.light }
    }
}

/// Shapes by part of the drawing.
struct Buckets {
    low: Vector2<f64>,
    high: Vector2<f64>,
    all: Vec<Vec<usize>>,
}

impl Buckets {
    fn of(drawing: &Drawing) -> Self {
        let (low, high) = drawing.bounds();
        let mut out = Self { low, high, all: vec![Vec::new(); BUCKETS * BUCKETS] };
        for (index, shape) in drawing.shapes.iter().enumerate() {
            let (from, to) = shape.bounds();
            let (from, to) = (out.place(&from), out.place(&to));
            for row in from[1]..=to[1] {
                for column in from[0]..=to[0] {
                    out.all[row * BUCKETS + column].push(index);
                }
            }
        }
        out
    }

    fn place(&self, p: &Vector2<f64>) -> [usize; 2] {
        let part = (p - self.low).component_div(&(self.high - self.low));
        [part.x, part.y].map(|t| ((t * BUCKETS as f64).max(0.0) as usize).min(BUCKETS - 1))
    }

    fn at(&self, p: &Vector2<f64>) -> &[usize] {
        let [column, row] = self.place(p);
        &self.all[row * BUCKETS + column]
    }
}
