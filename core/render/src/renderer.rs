//! From a scene to pixels.

use std::ops::Range;

use handeye_geometry::camera::Intrinsics;
use image::RgbImage;

use super::rays::{Ray, RayTable, Tile};
use super::stage::{BACKGROUND, Hit, Stage, TileContent};
use super::{Imaging, RenderScene, RenderedFrame, Sampling, imaging};

/// Rays through a pixel that an edge crosses. Their offsets are distinct in both directions, so that edges along rows
/// or columns get as many grey levels as slanted ones.
const EDGE_RAYS: u32 = 16;

/// Renders what one camera sees; keeps the ray of every pixel, so make it once per camera.
#[derive(Debug, Clone)]
pub struct Renderer {
    intrinsics: Intrinsics,
    near_m: f64,
    far_m: f64,
    table: RayTable,
}

/// Hits of the rays through the pixel centres.
struct Traced {
    depths_m: Vec<f32>,
    /// Face per pixel, and colours three per pixel; empty when only depth was requested.
    faces: Vec<u16>,
    colours: Vec<f32>,
}

impl Renderer {
    /// A renderer for one camera. What is nearer than `near_m` or not nearer than `far_m` along the optical axis is
    /// not drawn, as in any rasteriser.
    ///
    /// Pixels that the lens model does not reach show the background; so does the whole image when the
    /// intrinsics are not usable, see [`Intrinsics::validate`].
    pub fn new(intrinsics: Intrinsics, near_m: f64, far_m: f64) -> Self {
        Self { intrinsics, near_m, far_m, table: RayTable::new(&intrinsics) }
    }

    /// The camera.
    pub fn intrinsics(&self) -> &Intrinsics {
        &self.intrinsics
    }

    /// Image and depth. The same arguments give the same bytes; give each frame its own `seed`.
    pub fn render(&self, scene: &RenderScene, imaging: &Imaging, seed: u64) -> RenderedFrame {
        let mut traced = self.trace(scene, imaging, true);
        let depth_m = self.finish_depth(std::mem::take(&mut traced.depths_m), imaging, seed);
        RenderedFrame { rgb: self.finish_rgb(traced, imaging, seed), depth_m }
    }

    /// The image of [`Self::render`] alone, bit for bit.
    pub fn render_rgb(&self, scene: &RenderScene, imaging: &Imaging, seed: u64) -> RgbImage {
        self.finish_rgb(self.trace(scene, imaging, true), imaging, seed)
    }

    /// The light of every pixel as it is before the sensor: red, green and blue, neither blurred nor rounded.
    pub fn render_light(&self, scene: &RenderScene) -> Vec<f32> {
        self.trace(scene, &Imaging::default(), true).colours
    }

    /// As [`Self::render_rgb`], with the depths of a sensor without noise, at no extra cost; see [`Self::sense_depth`].
    pub fn render_rgb_with_ideal_depth(
        &self,
        scene: &RenderScene,
        imaging: &Imaging,
        seed: u64,
    ) -> (RgbImage, Vec<f32>) {
        let mut traced = self.trace(scene, imaging, true);
        let depths_m = std::mem::take(&mut traced.depths_m);
        (self.finish_rgb(traced, imaging, seed), depths_m)
    }

    /// The sensor's depths from those without noise: the same, bit for bit, as [`Self::render_depth`] of their scene.
    pub fn sense_depth(&self, ideal_m: Vec<f32>, imaging: &Imaging, seed: u64) -> Vec<f32> {
        self.finish_depth(ideal_m, imaging, seed)
    }

    /// The depth of [`Self::render`] alone, bit for bit, at a fraction of its cost.
    pub fn render_depth(&self, scene: &RenderScene, imaging: &Imaging, seed: u64) -> Vec<f32> {
        self.finish_depth(self.trace(scene, imaging, false).depths_m, imaging, seed)
    }

    fn finish_rgb(&self, traced: Traced, imaging: &Imaging, seed: u64) -> RgbImage {
        imaging::develop(traced.colours, self.intrinsics.width, self.intrinsics.height, imaging, seed)
    }

    fn finish_depth(&self, mut depths_m: Vec<f32>, imaging: &Imaging, seed: u64) -> Vec<f32> {
        imaging::disturb(&mut depths_m, self.near_m, self.far_m, imaging, seed);
        depths_m
    }

    fn trace(&self, scene: &RenderScene, imaging: &Imaging, with_colour: bool) -> Traced {
        let stage = Stage::new(scene, imaging, self.near_m, self.far_m);
        let pixels = self.table.width * self.table.height;
        let coloured = if with_colour { pixels } else { 0 };
        let mut traced = Traced {
            depths_m: vec![self.far_m as f32; pixels],
            faces: vec![BACKGROUND; coloured],
            colours: vec![0.0; 3 * coloured],
        };
        let sights: Vec<TileContent> = self
            .table
            .tiles
            .iter()
            .map(|tile| {
                let sight = tile.rays.as_ref().map(|rays| stage.survey(rays, with_colour)).unwrap_or_default();
                self.trace_tile(&stage, tile, &sight, with_colour, &mut traced);
                sight
            })
            .collect();
        if with_colour && imaging.sampling == Sampling::Area {
            for (tile, sight) in self.table.tiles.iter().zip(&sights) {
                self.smooth_edges(&stage, tile, sight, &mut traced);
            }
        }
        traced
    }

    fn trace_tile(&self, stage: &Stage, tile: &Tile, sight: &TileContent, with_colour: bool, traced: &mut Traced) {
        for y in tile.rows.clone() {
            if with_colour && self.trace_run(stage, tile, y, sight, traced) {
                continue;
            }
            for x in tile.columns.clone() {
                let i = y * self.table.width + x;
                let ray = self.table.ray(x, y);
                let hit = stage.first_hit(sight, &ray);
                traced.depths_m[i] = stage.sensed_depth(&hit, &ray) as f32;
                if with_colour {
                    traced.faces[i] = stage.face(&hit);
                    traced.colours[3 * i..3 * i + 3].copy_from_slice(&stage.colour(sight, &hit, &ray));
                }
            }
        }
    }

    /// The short way for one row of a tile; false where there is none.
    fn trace_run(&self, stage: &Stage, tile: &Tile, y: usize, sight: &TileContent, traced: &mut Traced) -> bool {
        if !tile.is_complete {
            return false;
        }
        let Range { start, end } = tile.columns;
        let pixels = y * self.table.width + start..y * self.table.width + end;
        let depths = traced.depths_m[pixels.clone()].iter_mut();
        let mut out = depths.zip(traced.colours[3 * pixels.start..3 * pixels.end].chunks_exact_mut(3));
        let put = |depth: f64, colour: [f32; 3]| {
            if let Some((depth_out, colour_out)) = out.next() {
                *depth_out = depth as f32;
                colour_out.copy_from_slice(&colour);
            }
        };
        match stage.paint_run(sight, end - start, |i| self.table.ray(start + i, y), put) {
            Some(face) => {
                traced.faces[pixels].fill(face);
                true
            }
            None => false,
        }
    }

    /// Gives the pixels on the border between two faces the mean colour of their area.
    fn smooth_edges(&self, stage: &Stage, tile: &Tile, sight: &TileContent, traced: &mut Traced) {
        let (width, height) = (self.table.width, self.table.height);
        for y in tile.rows.clone() {
            for x in tile.columns.clone() {
                let i = y * width + x;
                let face = traced.faces[i];
                let faces = &traced.faces;
                let on_edge = (x > 0 && faces[i - 1] != face)
                    || (x + 1 < width && faces[i + 1] != face)
                    || (y > 0 && faces[i - width] != face)
                    || (y + 1 < height && faces[i + width] != face);
                if on_edge {
                    let ray = self.table.ray(x, y);
                    if ray.exists() {
                        traced.colours[3 * i..3 * i + 3].copy_from_slice(&mean_colour(stage, sight, &ray));
                    }
                }
            }
        }
    }
}

/// The colour of each face that the pixel sees, by the number of rays that end on it.
fn mean_colour(stage: &Stage, sight: &TileContent, ray: &Ray) -> [f32; 3] {
    let mut seen: [Option<(u16, [f32; 3])>; 4] = [None; 4];
    let mut sum = [0.0; 3];
    for i in 0..EDGE_RAYS {
        let du = (f64::from(i) + 0.5) / f64::from(EDGE_RAYS) - 0.5;
        let dv = (f64::from(i.reverse_bits() >> 28) + 0.5) / f64::from(EDGE_RAYS) - 0.5;
        let beside = ray.beside(du, dv);
        let hit = stage.first_hit(sight, &beside);
        let face = stage.face(&hit);
        let known = seen.iter().flatten().find(|(other, _)| *other == face).map(|(_, colour)| *colour);
        let colour = known.unwrap_or_else(|| {
            let colour = face_colour(stage, sight, &hit, ray, &beside);
            if let Some(free) = seen.iter_mut().find(|slot| slot.is_none()) {
                *free = Some((face, colour));
            }
            colour
        });
        for (total, part) in sum.iter_mut().zip(colour) {
            *total += part;
        }
    }
    sum.map(|total| total / EDGE_RAYS as f32)
}

/// The print is integrated over the whole pixel, edge or no edge: its visible part then has the value that the
/// pixel would have if nothing crossed it.
fn face_colour(stage: &Stage, sight: &TileContent, hit: &Hit, pixel: &Ray, sample: &Ray) -> [f32; 3] {
    stage.colour(sight, hit, if stage.is_print(hit) { pixel } else { sample })
}
