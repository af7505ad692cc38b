//! Where an image is on the screen, and which pixel is where.

use egui::{Pos2, Rect, Vec2};

use handeye_workbench::model::{ImagePoint, Viewport};

/// At this zoom a pixel is as large as a thumb nail.
pub const LARGEST_ZOOM: f32 = 60.0;

/// Where an image is on the screen.
#[derive(Debug, Clone, Copy)]
pub struct Place {
    /// All of the image, which may be larger than the room.
    pub image: Rect,
    /// What can be seen of it.
    pub visible: Rect,
    /// Width and height in pixels of the colour image.
    pub size_px: Vec2,
}

impl Place {
    /// An image in a room.
    pub fn new(room: Rect, size_px: Vec2, viewport: Viewport) -> Self {
        let size_px = size_px.max(Vec2::splat(1.0));
        let zoom = viewport.zoom.clamp(1.0, LARGEST_ZOOM);
        // A window can be dragged smaller than all its bars together.
        let scale = (room.width() / size_px.x).min(room.height() / size_px.y).max(0.0) * zoom;
        let size = size_px * scale;
        let centre = held(Vec2::from(viewport.centre), room.size(), size);
        let image = Rect::from_min_size(room.center() - centre * size, size);
        Self { image, visible: image.intersect(room), size_px }
    }

    /// A place in pixels, whose whole numbers are the middles of pixels, on the screen.
    pub fn screen(&self, px: Vec2) -> Pos2 {
        self.image.min + (px + Vec2::splat(0.5)) / self.size_px * self.image.size()
    }

    /// How many points on the screen a pixel takes.
    pub fn points_per_px(&self) -> f32 {
        self.image.width() / self.size_px.x
    }

    /// The pixel at a place on the screen.
    pub fn pixel(&self, at: Pos2) -> ImagePoint {
        let part = (at - self.image.min) / self.image.size();
        let index = |part: f32, count: f32| ((part * count).max(0.0) as u32).min((count as u32).saturating_sub(1));
        ImagePoint { column: index(part.x, self.size_px.x), row: index(part.y, self.size_px.y) }
    }
}

/// The centre of the visible part, as a fraction of the image, clamped so that no room is empty while there is image to
/// fill it.
pub fn held(centre: Vec2, room: Vec2, image: Vec2) -> Vec2 {
    let hold = |centre: f32, room: f32, image: f32| {
        if image <= room || !centre.is_finite() {
            return 0.5;
        }
        let half = room / image / 2.0;
        centre.clamp(half, 1.0 - half)
    };
    Vec2::new(hold(centre.x, room.x, image.x), hold(centre.y, room.y, image.y))
}
