//! Images of the vision sensors: rendered on request, kept until the view changes.

use std::collections::BTreeMap;
use std::sync::Arc;

use handeye_geometry::camera::Intrinsics;
use nalgebra::Isometry3;

use super::message;
use super::stage::{Stage, out_of_sight};
use handeye_cell::render::{BoardSurface, Imaging, Light, RenderScene, Renderer, Solid};
use handeye_cell::scene::ResolvedScene;
use handeye_cell::world::{Handle, Moment, Shown, VisionSensor};
use handeye_wire::axes::sensor_from_camera;

/// Sensors with different lenses whose rays are kept; the cell has one lens.
const MAX_RENDERERS: usize = 4;

/// Buffers that are kept: colour and depth of a few sensors.
const MAX_IMAGES: usize = 8;

/// One buffer of a sensor as clients get it: row by row from the bottom.
#[derive(Debug, Clone)]
pub struct Image {
    /// Its bytes: R, G, B per pixel, or one little-endian `f32` in metres.
    pub bytes: Vec<u8>,
    /// The whole reply to the plain request for it.
    pub reply: Vec<u8>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Channel {
    Colour,
    Depth,
}

/// What an image depends on.
#[derive(Debug, Clone)]
struct Source {
    intrinsics: Intrinsics,
    range_m: (f64, f64),
    /// Absent for a buffer that nothing was drawn into.
    moment: Option<Arc<Moment>>,
    /// The pass, where images have noise.
    pass: Option<u64>,
}

impl Source {
    fn is(&self, other: &Self) -> bool {
        let same_moment = match (&self.moment, &other.moment) {
            (Some(a), Some(b)) => Arc::ptr_eq(a, b),
            (None, None) => true,
            _ => false,
        };
        same_moment && self.pass == other.pass && self.range_m == other.range_m && self.intrinsics == other.intrinsics
    }
}

/// Depths without noise, as the renderer has them, that came with a colour image. A depth sensor at the same place sees the same.
#[derive(Debug)]
struct IdealDepths {
    moment: Arc<Moment>,
    world_from_sensor: Isometry3<f64>,
    intrinsics: Intrinsics,
    range_m: (f64, f64),
    metres: Vec<f32>,
}

impl IdealDepths {
    /// What a sensor saw in a moment, if it is this.
    fn of(&self, handle: Handle, sensor: &VisionSensor, moment: &Arc<Moment>) -> Option<Vec<f32>> {
        let is_same = Arc::ptr_eq(&self.moment, moment)
            && moment.pose(handle) == Some(&self.world_from_sensor)
            && self.intrinsics == sensor.intrinsics
            && self.range_m == (sensor.near_m, sensor.far_m);
        is_same.then(|| self.metres.clone())
    }
}

/// All cameras of the cell.
#[derive(Debug)]
pub struct Cameras {
    seed: u64,
    imaging: Imaging,
    light: Light,
    background: [f32; 3],
    board: BoardSurface,
    renderers: Vec<Renderer>,
    ranges_m: Vec<(f64, f64)>,
    images: BTreeMap<(Handle, Channel), (Source, Image)>,
    ideal_depths: Option<IdealDepths>,
}

impl Cameras {
    /// The cameras of a scene.
    pub fn new(scene: &ResolvedScene) -> Self {
        Self {
            seed: scene.seed,
            imaging: scene.imaging(),
            light: scene.lamp(),
            background: scene.background(),
            board: scene.board_at(out_of_sight()),
            renderers: Vec::new(),
            ranges_m: Vec::new(),
            images: BTreeMap::new(),
            ideal_depths: None,
        }
    }

    /// The colour buffer of a sensor.
    pub fn colour(&mut self, handle: Handle, sensor: &VisionSensor, stage: &Stage) -> &Image {
        let shown = sensor.shown().filter(|_| !sensor.ignore_rgb);
        let noisy = self.imaging.noise_grey > 0.0;
        self.image(handle, Channel::Colour, sensor, shown, noisy, stage)
    }

    /// The depth buffer of a sensor, metres along the optical axis.
    pub fn depth(&mut self, handle: Handle, sensor: &VisionSensor, stage: &Stage) -> &Image {
        let shown = sensor.shown().filter(|_| !sensor.ignore_depth);
        let noisy = self.imaging.depth_noise_m > 0.0 || self.imaging.depth_noise_per_m2 > 0.0;
        self.image(handle, Channel::Depth, sensor, shown, noisy, stage)
    }

    fn image(
        &mut self,
        handle: Handle,
        channel: Channel,
        sensor: &VisionSensor,
        shown: Option<&Shown>,
        noisy: bool,
        stage: &Stage,
    ) -> &Image {
        let source = Source {
            intrinsics: sensor.intrinsics,
            range_m: (sensor.near_m, sensor.far_m),
            moment: shown.map(|shown| Arc::clone(&shown.moment)),
            pass: shown.filter(|_| noisy).map(|shown| shown.pass),
        };
        let key = (handle, channel);
        let is_current = self.images.get(&key).is_some_and(|(kept, _)| kept.is(&source));
        if !is_current {
            if self.images.len() >= MAX_IMAGES {
                self.images.clear();
            }
            let bytes = self.draw(handle, channel, sensor, shown, stage);
            let size = [sensor.intrinsics.width, sensor.intrinsics.height];
            let reply = message::returned_image(&bytes, size);
            self.images.insert(key, (source.clone(), Image { bytes, reply }));
        }
        // Just inserted if it was not there, so the entry is never made here.
        &self.images.entry(key).or_insert_with(|| (source, Image { bytes: Vec::new(), reply: Vec::new() })).1
    }

    fn draw(
        &mut self,
        handle: Handle,
        channel: Channel,
        sensor: &VisionSensor,
        shown: Option<&Shown>,
        stage: &Stage,
    ) -> Vec<u8> {
        let (width, height) = (sensor.intrinsics.width as usize, sensor.intrinsics.height as usize);
        let seen = shown.and_then(|shown| Some((shown, self.scene(handle, &shown.moment, stage)?)));
        let Some((shown, scene)) = seen else {
            return match channel {
                Channel::Colour => self.background.map(|c| (c * 255.0).round() as u8).repeat(width * height),
                Channel::Depth => {
                    let nothing_m = self.imaging.depth_of_nothing_m.unwrap_or(sensor.far_m);
                    (nothing_m as f32).to_le_bytes().repeat(width * height)
                }
            };
        };
        let seed = frame_seed(self.seed, handle, shown.pass);
        let imaging = self.imaging;
        match channel {
            Channel::Colour => {
                let (image, metres) = self.renderer(sensor).render_rgb_with_ideal_depth(&scene, &imaging, seed);
                self.ideal_depths = shown.moment.pose(handle).map(|world_from_sensor| IdealDepths {
                    moment: Arc::clone(&shown.moment),
                    world_from_sensor: *world_from_sensor,
                    intrinsics: sensor.intrinsics,
                    range_m: (sensor.near_m, sensor.far_m),
                    metres,
                });
                bottom_up(image.as_raw(), 3 * width)
            }
            Channel::Depth => {
                let known = self.ideal_depths.as_ref().and_then(|ideal| ideal.of(handle, sensor, &shown.moment));
                let renderer = self.renderer(sensor);
                let depth = match known {
                    Some(ideal_m) => renderer.sense_depth(ideal_m, &imaging, seed),
                    None => renderer.render_depth(&scene, &imaging, seed),
                };
                let mut bytes = Vec::with_capacity(4 * depth.len());
                for row in depth.chunks_exact(width.max(1)).rev() {
                    bytes.extend(row.iter().flat_map(|metres| metres.to_le_bytes()));
                }
                bytes
            }
        }
    }

    /// What there was to see from a sensor; `None` if the sensor was not there yet.
    fn scene(&self, handle: Handle, moment: &Moment, stage: &Stage) -> Option<RenderScene> {
        let world_from_camera = moment.pose(handle)? * sensor_from_camera().isometry();
        let mut board = self.board.clone();
        if let Some(world_from_plane) = moment.seen(stage.plane) {
            board.world_from_target = world_from_plane * stage.plane_from_target;
        }
        let placed = |(object, solid): &(Handle, Solid)| {
            let world_from_shape = moment.seen(*object)? * solid.world_from_shape;
            Some(Solid { world_from_shape, ..solid.clone() })
        };
        let solids = stage.solids.iter().filter_map(placed).collect();
        Some(RenderScene { world_from_camera, board, solids, light: self.light, background: self.background })
    }

    fn renderer(&mut self, sensor: &VisionSensor) -> &Renderer {
        let range_m = (sensor.near_m, sensor.far_m);
        let known = self
            .renderers
            .iter()
            .zip(&self.ranges_m)
            .position(|(renderer, range)| *renderer.intrinsics() == sensor.intrinsics && *range == range_m);
        let at = known.unwrap_or_else(|| {
            if self.renderers.len() >= MAX_RENDERERS {
                self.renderers.clear();
                self.ranges_m.clear();
            }
            self.renderers.push(Renderer::new(sensor.intrinsics, sensor.near_m, sensor.far_m));
            self.ranges_m.push(range_m);
            self.renderers.len() - 1
        });
        &self.renderers[at]
    }
}

/// Turns an image upside down: the renderer starts at the top, the API at the bottom.
fn bottom_up(bytes: &[u8], row_bytes: usize) -> Vec<u8> {
    let mut turned = Vec::with_capacity(bytes.len());
    bytes.chunks_exact(row_bytes.max(1)).rev().for_each(|row| turned.extend_from_slice(row));
    turned
}

/// A separate seed for every frame of every sensor. Steele, Lea, Flood 2014, "Fast splittable pseudorandom number
/// generators", the finaliser of SplitMix64.
fn frame_seed(seed: u64, handle: Handle, pass: u64) -> u64 {
    let mix = |mut z: u64| {
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    };
    mix(mix(mix(seed).wrapping_add(handle.unsigned_abs())).wrapping_add(pass))
}
