//! A scene as one camera sees it: surfaces in camera coordinates with their looks.

use std::sync::Arc;

use nalgebra::{Isometry3, Point3, Vector3};

use super::board::{Footprint, Pattern};
use super::ground::Ground;
use super::rays::Ray;
use super::shade::{Lamp, Spot, SurfaceShade};
use super::shadow::{self, ShadowCaster};
use super::shapes::{Facet, Rays, Surface, Vec3, dot, faces, scale_add};
use super::{BoardSurface, Imaging, PrintErrors, RenderScene, Sampling};

/// Face number of the background.
pub(super) const BACKGROUND: u16 = 0;

/// The sheet is in front of its support up to this relative difference in depth, half a micrometre at half a metre.
const SHEET_LEAD: f64 = 1.0 - 1e-6;

/// One surface with its look.
#[derive(Debug)]
struct Piece {
    surface: Surface,
    /// Number of the smooth face that it belongs to; between different faces there is a visible edge.
    face: u16,
    paint: Paint,
    /// Depth counts this many times its value when surfaces compete.
    lead: f64,
    /// The solid that it belongs to; `None` for the board.
    owner: Option<usize>,
}

#[derive(Debug)]
enum Paint {
    /// One colour, light included.
    Flat([f32; 3]),
    SurfaceShade(SurfaceShade),
    /// A coat with its short way.
    Ground(SurfaceShade, Ground),
    Print(Print),
}

/// The printed side of the board: the ray `d` meets it at `depth · (s·d, r·d)` in squares.
#[derive(Debug)]
struct Print {
    s: Vec3,
    r: Vec3,
    inverse_depth: Vec3,
    pattern: Pattern,
    errors: Option<Arc<PrintErrors>>,
    sampling: Sampling,
    dark: f32,
    white: f32,
}

/// End of a ray.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Hit {
    pub depth: f64,
    piece: Option<u16>,
}

/// A surface that a tile may see.
#[derive(Debug, Clone, Copy)]
struct Candidate {
    piece: u16,
    nearest: f64,
}

/// Contents of a tile.
#[derive(Debug, Default)]
pub(super) struct TileContent {
    /// From near to far.
    candidates: Vec<Candidate>,
    /// Indices of casters that may throw a shadow there.
    casters: Vec<u16>,
    /// The first candidate hides all else and no ray misses it.
    is_covered: bool,
}

#[derive(Debug)]
pub(super) struct Stage {
    pieces: Vec<Piece>,
    casters: Vec<ShadowCaster>,
    lamp: Lamp,
    background: [f32; 3],
    near_m: f64,
    far_m: f64,
    depth_offset_px: f64,
}

impl Stage {
    pub fn new(scene: &RenderScene, imaging: &Imaging, near_m: f64, far_m: f64) -> Self {
        let camera_from_world = scene.world_from_camera.inverse();
        let lamp = Lamp::new(&scene.light, &camera_from_world);
        let mut stage = Self {
            pieces: Vec::new(),
            casters: Vec::new(),
            lamp,
            background: scene.background,
            near_m,
            far_m,
            depth_offset_px: if imaging.depth_offset_px > 0.0 { imaging.depth_offset_px } else { 0.0 },
        };
        stage.add_board(&scene.board, &camera_from_world, imaging.sampling);
        for (owner, solid) in scene.solids.iter().enumerate() {
            let camera_from_shape = camera_from_world * solid.world_from_shape;
            let coat = SurfaceShade::new(solid, &camera_from_shape, far_m);
            for face in faces(solid, &camera_from_shape) {
                stage.add_face(face, owner, &coat);
            }
            stage.casters.extend(ShadowCaster::of_solid(owner, solid, &camera_from_shape));
        }
        stage
    }

    fn add_board(&mut self, board: &BoardSurface, camera_from_world: &Isometry3<f64>, sampling: Sampling) {
        let camera_from_target = camera_from_world * board.world_from_target;
        let half = |count: usize| 0.5 * (count as f64 - 1.0) * board.square_m;
        let middle = Point3::new(half(board.columns), half(board.rows), 0.0);
        self.casters.push(ShadowCaster::of_board(board, &middle, &camera_from_target));
        self.pieces.extend(sheet(board, &middle, &camera_from_target, &self.lamp, sampling));
    }

    fn add_face(&mut self, surfaces: Vec<Surface>, owner: usize, coat: &SurfaceShade) {
        let face = self.pieces.last().map_or(BACKGROUND, |piece| piece.face).saturating_add(1);
        for surface in surfaces {
            let paint = match &surface {
                Surface::Facet(facet) => self.facet_paint(facet, coat),
                Surface::Ball(_) | Surface::CylinderSide(_) => Paint::SurfaceShade(coat.clone()),
            };
            self.pieces.push(Piece { surface, face, paint, lead: 1.0, owner: Some(owner) });
        }
    }

    fn facet_paint(&self, facet: &Facet, coat: &SurfaceShade) -> Paint {
        if let Some(flat) = coat.flat(&self.lamp, &facet.normal) {
            Paint::Flat(flat)
        } else if let Some(ground) = Ground::new(facet, coat, &self.lamp) {
            Paint::Ground(coat.clone(), ground)
        } else {
            Paint::SurfaceShade(coat.clone())
        }
    }

    /// Surfaces that the rays of a tile may hit, without those hidden behind a face that covers the whole tile.
    pub fn survey(&self, rays: &Rays, with_shadows: bool) -> TileContent {
        let mut candidates = Vec::new();
        let mut hidden_beyond = self.far_m;
        let mut is_covered = false;
        let mut cover = None;
        for (index, piece) in self.pieces.iter().enumerate() {
            let Some(reach) = piece.surface.reach(rays) else { continue };
            if let Some(farthest) = reach.covers_within
                && reach.nearest >= self.near_m
            {
                is_covered |= farthest < self.far_m;
                if farthest < hidden_beyond {
                    hidden_beyond = farthest;
                    cover = Some(piece);
                }
            }
            candidates.push(Candidate { piece: index as u16, nearest: reach.nearest });
        }
        candidates.retain(|candidate| {
            let piece = &self.pieces[candidate.piece as usize];
            candidate.nearest <= hidden_beyond && !cover.is_some_and(|cover| piece.is_behind(cover, rays))
        });
        candidates.sort_by(|a, b| a.nearest.total_cmp(&b.nearest));
        let casters = if with_shadows { self.casters_for(&candidates, rays) } else { Vec::new() };
        is_covered &= candidates.len() == 1;
        TileContent { candidates, casters, is_covered }
    }

    fn casters_for(&self, candidates: &[Candidate], rays: &Rays) -> Vec<u16> {
        let grounds = candidates.iter().filter_map(|candidate| {
            let piece = &self.pieces[candidate.piece as usize];
            match (&piece.surface, &piece.paint) {
                (Surface::Facet(facet), Paint::SurfaceShade(coat) | Paint::Ground(coat, _)) if coat.is_ground() => {
                    Some(facet)
                }
                _ => None,
            }
        });
        let patches: Vec<(Vec3, f64)> = grounds.map(|facet| rays.patch(facet.inverse_depth(), self.far_m)).collect();
        let darkens = |caster: &ShadowCaster| {
            patches.iter().any(|(middle, radius)| caster.may_darken(middle, *radius, &self.lamp.towards(middle)))
        };
        let indices = self.casters.iter().enumerate().filter(|(_, caster)| darkens(caster));
        indices.map(|(index, _)| index as u16).collect()
    }

    /// The first surface between the clipping planes along a ray.
    pub fn first_hit(&self, sight: &TileContent, ray: &Ray) -> Hit {
        let direction = ray.direction();
        let mut best = Hit { depth: self.far_m, piece: None };
        let mut bar = self.far_m;
        for candidate in &sight.candidates {
            if candidate.nearest > bar {
                break;
            }
            let piece = &self.pieces[candidate.piece as usize];
            let depth = piece.surface.hit(&direction);
            if depth >= self.near_m && depth * piece.lead < bar {
                bar = depth * piece.lead;
                best = Hit { depth, piece: Some(candidate.piece) };
            }
        }
        best
    }

    fn sunlit(&self, sight: &TileContent, receiver: &Piece, point: &Vec3, towards: &Vec3) -> f32 {
        if sight.casters.is_empty() {
            return 1.0;
        }
        let casters = sight.casters.iter().map(|&index| &self.casters[index as usize]);
        shadow::sunlit(casters, receiver.owner, point, towards)
    }

    /// Paints a run of neighbouring pixels of a tile, all of which have rays, at once where that is possible: calls
    /// `put` for each in turn with depth and colour and returns the face, or does nothing and returns `None`.
    pub fn paint_run(
        &self,
        sight: &TileContent,
        count: usize,
        ray_at: impl Fn(usize) -> Ray,
        mut put: impl FnMut(f64, [f32; 3]),
    ) -> Option<u16> {
        let Some(first) = sight.candidates.first() else {
            (0..count).for_each(|_| put(self.far_m, self.background));
            return Some(BACKGROUND);
        };
        let piece = &self.pieces[first.piece as usize];
        let (true, Surface::Facet(facet)) = (sight.is_covered, &piece.surface) else { return None };
        // Every ray hits the facet, so that its outline need not be checked.
        let depth_along = |ray: &Ray| {
            let depth = 1.0 / dot(facet.inverse_depth(), &ray.direction());
            depth + self.offset_of_depth(facet.inverse_depth(), depth, ray)
        };
        let ground = match &piece.paint {
            // Its depths come without the offset.
            Paint::Ground(..) if self.depth_offset_px > 0.0 => return None,
            Paint::Ground(_, ground) => ground,
            Paint::Flat(colour) => {
                (0..count).for_each(|i| put(depth_along(&ray_at(i)), *colour));
                return Some(piece.face);
            }
            Paint::Print(print) => {
                for ray in (0..count).map(ray_at) {
                    put(depth_along(&ray), print.colour(&ray, &piece.surface, &self.lamp));
                }
                return Some(piece.face);
            }
            Paint::SurfaceShade(_) => return None,
        };
        let sunlit = |point: &Vec3| self.sunlit(sight, piece, point, &ground.towards);
        let shadows: Option<&dyn Fn(&Vec3) -> f32> = if sight.casters.is_empty() { None } else { Some(&sunlit) };
        ground.paint(count, ray_at, self.background, shadows, put);
        Some(piece.face)
    }

    /// Depth of a hit as reported by a sensor without noise.
    pub fn sensed_depth(&self, hit: &Hit, ray: &Ray) -> f64 {
        let Some(index) = hit.piece.filter(|_| self.depth_offset_px > 0.0) else { return hit.depth };
        let surface = &self.pieces[index as usize].surface;
        let point = ray.direction().map(|c| c * hit.depth);
        let normal = surface.normal(&point);
        let tangent_plane = normal.map(|c| c / dot(&normal, &point));
        hit.depth + self.offset_of_depth(&tangent_plane, hit.depth, ray)
    }

    /// The polygon offset at a point of the plane `c · p = 1`; none at the rim of a round body, where depth falls off
    /// beyond all bounds within a pixel.
    fn offset_of_depth(&self, c: &Vec3, depth: f64, ray: &Ray) -> f64 {
        if self.depth_offset_px == 0.0 {
            return 0.0;
        }
        let [x_by_u, x_by_v, y_by_u, y_by_v] = ray.by_pixel.map(f64::from);
        let per_pixel = |x: f64, y: f64| (depth * depth * (c[0] * x + c[1] * y)).abs();
        let slope = per_pixel(x_by_u, y_by_u).max(per_pixel(x_by_v, y_by_v));
        if slope < depth { self.depth_offset_px * slope } else { 0.0 }
    }

    /// Number of the face that was hit.
    pub fn face(&self, hit: &Hit) -> u16 {
        hit.piece.map_or(BACKGROUND, |index| self.pieces[index as usize].face)
    }

    /// Whether the colour of a face depends on the whole footprint of a pixel and not on the hit alone.
    pub fn is_print(&self, hit: &Hit) -> bool {
        hit.piece.is_some_and(|index| matches!(self.pieces[index as usize].paint, Paint::Print(_)))
    }

    /// Colour of what was hit, for the footprint of one pixel around the ray.
    pub fn colour(&self, sight: &TileContent, hit: &Hit, ray: &Ray) -> [f32; 3] {
        let Some(index) = hit.piece else { return self.background };
        let piece = &self.pieces[index as usize];
        let coat = match &piece.paint {
            Paint::Flat(colour) => return *colour,
            Paint::Print(print) => return print.colour(ray, &piece.surface, &self.lamp),
            Paint::SurfaceShade(coat) | Paint::Ground(coat, _) => coat,
        };
        let direction = ray.direction();
        let point = direction.map(|c| c * hit.depth);
        let normal = piece.surface.normal(&point);
        let sunlit = if coat.is_ground() { self.sunlit(sight, piece, &point, &self.lamp.towards(&point)) } else { 1.0 };
        let spot = Spot { ray: direction, by_pixel: ray.by_pixel, point, normal, sunlit };
        coat.colour_at(&spot, &self.lamp, self.background)
    }
}

impl Piece {
    /// Whether it is flat and its part that a tile may see is behind the plane of another flat piece.
    fn is_behind(&self, cover: &Self, rays: &Rays) -> bool {
        let (Surface::Facet(back), Surface::Facet(front)) = (&self.surface, &cover.surface) else { return false };
        // Depths compete after they were multiplied by the lead.
        let [back, front] =
            [(back, self.lead), (front, cover.lead)].map(|(facet, lead)| facet.inverse_depth().map(|c| c / lead));
        rays.range(&scale_add(-1.0, &back, &front)).0 > 0.0
    }
}

/// The board's sheet of paper, the side that the camera sees.
fn sheet(
    board: &BoardSurface,
    middle: &Point3<f64>,
    camera_from_target: &Isometry3<f64>,
    lamp: &Lamp,
    sampling: Sampling,
) -> Option<Piece> {
    let turn = |v: Vector3<f64>| camera_from_target.rotation * v;
    let middle = (camera_from_target * middle).coords;
    let [half_width, half_height] = board.paper_m.map(|side| 0.5 * side);
    let facet = Facet::rectangle(&middle, &turn(Vector3::x() * half_width), &turn(Vector3::y() * half_height))?;
    let from_front = dot(&facet.normal, &turn(-Vector3::z()).into()) > 0.0;
    let paint = if from_front {
        let c = *facet.inverse_depth();
        let origin: Vec3 = camera_from_target.translation.vector.into();
        let in_squares = |axis: Vector3<f64>| {
            let axis: Vec3 = turn(axis / board.square_m).into();
            scale_add(-dot(&axis, &origin), &c, &axis)
        };
        Paint::Print(Print {
            s: in_squares(Vector3::x()),
            r: in_squares(Vector3::y()),
            inverse_depth: c,
            pattern: Pattern::new(board.columns, board.rows),
            errors: board.print.clone(),
            sampling,
            dark: board.dark,
            white: board.white,
        })
    } else {
        let coat = SurfaceShade::matt(board.back);
        coat.flat(lamp, &facet.normal).map_or_else(|| Paint::SurfaceShade(coat), Paint::Flat)
    };
    Some(Piece { surface: Surface::Facet(facet), face: BACKGROUND + 1, paint, lead: SHEET_LEAD, owner: None })
}

impl Print {
    fn colour(&self, ray: &Ray, surface: &Surface, lamp: &Lamp) -> [f32; 3] {
        let direction = ray.direction();
        let depth = 1.0 / dot(&self.inverse_depth, &direction);
        let (s, r) = (depth * dot(&self.s, &direction), depth * dot(&self.r, &direction));
        let centre = self.errors.as_ref().map_or([s, r], |errors| errors.on_grid([s, r]));
        let dark = match self.sampling {
            Sampling::Centre => self.pattern.at(centre),
            Sampling::Area => self.pattern.dark_fraction(&self.footprint(ray, depth, [s, r], centre)),
        } as f32;
        let point = direction.map(|c| c * depth);
        let light = lamp.brightness(&surface.normal(&point), &lamp.towards(&point), 1.0);
        [light * (self.white + dark * (self.dark - self.white)); 3]
    }

    /// Footprint of a pixel around a point of the print. Displacements of the print shift it: its sides change by less
    /// than a hundredth.
    fn footprint(&self, ray: &Ray, depth: f64, [s, r]: [f64; 2], centre: [f64; 2]) -> Footprint {
        let [x_by_u, x_by_v, y_by_u, y_by_v] = ray.by_pixel.map(f64::from);
        let slopes = |form: &Vec3, value: f64| {
            let by_x = depth * (form[0] - value * self.inverse_depth[0]);
            let by_y = depth * (form[1] - value * self.inverse_depth[1]);
            [by_x * x_by_u + by_y * y_by_u, by_x * x_by_v + by_y * y_by_v]
        };
        let ([s_by_u, s_by_v], [r_by_u, r_by_v]) = (slopes(&self.s, s), slopes(&self.r, r));
        Footprint { centre, by_u: [s_by_u, r_by_u], by_v: [s_by_v, r_by_v] }
    }
}
