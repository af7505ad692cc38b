//! What a window looks like at an instant.

use serde::Serialize;

use super::chunks::Chunk;
use super::textures::Textures;

/// A frame, with everything needed to draw it.
#[derive(Clone, Default)]
pub struct Frame {
    /// Width and height \[points\].
    pub size: [f32; 2],
    pub pixels_per_point: f32,
    /// Triangles, in the order in which they are drawn.
    pub chunks: Vec<Chunk>,
    /// The textures.
    pub textures: Textures,
    /// The shape of the pointer, as named in style sheets.
    pub cursor: &'static str,
    /// Where text is being typed.
    pub typing: Option<Typing>,
}

impl Frame {
    /// Whether it looks the same.
    pub fn is_same(&self, other: &Self) -> bool {
        self.size == other.size
            && self.pixels_per_point == other.pixels_per_point
            && self.cursor == other.cursor
            && self.typing == other.typing
            && self.textures.version() == other.textures.version()
            && self.chunks.len() == other.chunks.len()
            && self.chunks.iter().zip(&other.chunks).all(|(one, other)| one.hash == other.hash)
    }
}

/// Where text is being typed \[points\].
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Typing {
    /// Left, top, width and height of the line in which the cursor is.
    pub cursor: [f32; 4],
}

/// The name of a pointer in style sheets.
pub fn cursor_name(icon: egui::CursorIcon) -> &'static str {
    use egui::CursorIcon as Icon;
    match icon {
        Icon::Default => "default",
        Icon::None => "none",
        Icon::ContextMenu => "context-menu",
        Icon::Help => "help",
        Icon::PointingHand => "pointer",
        Icon::Progress => "progress",
        Icon::Wait => "wait",
        Icon::Cell => "cell",
        Icon::Crosshair => "crosshair",
        Icon::Text => "text",
        Icon::VerticalText => "vertical-text",
        Icon::Alias => "alias",
        Icon::Copy => "copy",
        Icon::Move => "move",
        Icon::NoDrop => "no-drop",
        Icon::NotAllowed => "not-allowed",
        Icon::Grab => "grab",
        Icon::Grabbing => "grabbing",
        Icon::AllScroll => "all-scroll",
        Icon::ResizeHorizontal => "ew-resize",
        Icon::ResizeNeSw => "nesw-resize",
        Icon::ResizeNwSe => "nwse-resize",
        Icon::ResizeVertical => "ns-resize",
        Icon::ResizeEast => "e-resize",
        Icon::ResizeSouthEast => "se-resize",
        Icon::ResizeSouth => "s-resize",
        Icon::ResizeSouthWest => "sw-resize",
        Icon::ResizeWest => "w-resize",
        Icon::ResizeNorthWest => "nw-resize",
        Icon::ResizeNorth => "n-resize",
        Icon::ResizeNorthEast => "ne-resize",
        Icon::ResizeColumn => "col-resize",
        Icon::ResizeRow => "row-resize",
        Icon::ZoomIn => "zoom-in",
        Icon::ZoomOut => "zoom-out",
    }
}
