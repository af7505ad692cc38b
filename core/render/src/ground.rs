//! The short way for floors and tables, which fill most of most images.
//!
//! The same colours as by [`super::shade::SurfaceShade`], but the place on the surface comes from linear forms of the ray, and
//! the averaging width of the pattern is that of the middle of a run of pixels instead of each pixel's own.

use super::Finish;
use super::rays::Ray;
use super::shade::{Lamp, SurfaceShade, misty};
use super::shapes::{Facet, Vec3, dot, scale_add};
use super::texture::{WoodAt, tiles};

/// Shadows are soft, so they are computed for one pixel in this many and interpolated.
const SHADOW_STEP: usize = 4;

/// A flat piece with a pattern under a lamp that is everywhere the same.
#[derive(Debug, Clone)]
pub(super) struct Ground {
    inverse_depth: Vec3,
    /// The ray `d` hits at `depth · (x·d, y·d)` in pattern coordinates, metres.
    x: Vec3,
    y: Vec3,
    finish: Finish,
    colour: [f32; 3],
    /// Brightness in full shadow, and what the lamp adds.
    shade: f32,
    lamp: f32,
    /// Unit vector to the lamp.
    pub towards: Vec3,
    fade: Option<[f64; 2]>,
}

impl Ground {
    /// `None` where colours need the long way.
    pub fn new(facet: &Facet, coat: &SurfaceShade, lamp: &Lamp) -> Option<Self> {
        if !(coat.is_ground() && lamp.is_uniform()) {
            return None;
        }
        let c = *facet.inverse_depth();
        let (x, y) = coat.pattern_axes();
        let form = |(axis, origin): (Vec3, f64)| scale_add(origin, &c, &axis);
        let towards = lamp.towards(&[0.0; 3]);
        let shade = lamp.brightness(&facet.normal, &towards, 0.0);
        Some(Self {
            inverse_depth: c,
            x: form(x),
            y: form(y),
            finish: coat.finish(),
            colour: coat.colour(),
            shade,
            lamp: lamp.brightness(&facet.normal, &towards, 1.0) - shade,
            towards,
            fade: coat.fade(),
        })
    }

    /// Depths and colours of `count` neighbouring pixels that all hit this piece. `sunlit` gives the part of the lamp
    /// that reaches a point; `None` when nothing blocks the light.
    pub fn paint(
        &self,
        count: usize,
        ray_at: impl Fn(usize) -> Ray,
        background: [f32; 3],
        sunlit: Option<&dyn Fn(&Vec3) -> f32>,
        mut put: impl FnMut(f64, [f32; 3]),
    ) {
        let middle = ray_at(count / 2);
        let half = self.half_widths(&middle);
        let wood = WoodAt::new(half);
        let light_at = |i: usize| {
            sunlit.map_or(1.0, |sunlit| {
                let d = ray_at(i.min(count - 1)).direction();
                sunlit(&d.map(|c| c / dot(&self.inverse_depth, &d)))
            })
        };
        let (mut light, mut light_step) = (light_at(0), 0.0);
        for i in 0..count {
            if i % SHADOW_STEP == 0 {
                let steps = SHADOW_STEP.min(count - 1 - i).max(1);
                light_step = (light_at(i + steps) - light) / steps as f32;
            }
            let d = ray_at(i).direction();
            let depth = 1.0 / dot(&self.inverse_depth, &d);
            let (x, y) = (depth * dot(&self.x, &d), depth * dot(&self.y, &d));
            let pattern = match self.finish {
                Finish::Tiles { pitch_m, joint_m } => tiles([x, y], half, pitch_m, joint_m),
                _ => wood.tone(x, y),
            };
            let tone = pattern * (self.shade + self.lamp * light);
            light += light_step;
            let mut colour = self.colour.map(|c| c * tone);
            if let Some(fade) = self.fade {
                colour = misty(colour, background, fade, depth);
            }
            put(depth, colour);
        }
    }

    fn half_widths(&self, ray: &Ray) -> [f64; 2] {
        let d = ray.direction();
        let depth = 1.0 / dot(&self.inverse_depth, &d);
        let [x_by_u, x_by_v, y_by_u, y_by_v] = ray.by_pixel.map(f64::from);
        [&self.x, &self.y].map(|form| {
            let value = depth * dot(form, &d);
            let by_x = depth * (form[0] - value * self.inverse_depth[0]);
            let by_y = depth * (form[1] - value * self.inverse_depth[1]);
            0.5 * ((by_x * x_by_u + by_y * y_by_u).abs() + (by_x * x_by_v + by_y * y_by_v).abs())
        })
    }
}
