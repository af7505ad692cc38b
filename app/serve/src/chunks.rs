//! What a frame is made of: one chunk of triangles for each shape, as bytes that a page keeps.
//!
//! egui joins all triangles of a texture and a clip rectangle into one mesh, so that one changed digit would change a
//! mesh of thousands. A single shape rarely changes.

use std::hash::{DefaultHasher, Hasher as _};
use std::sync::Arc;

use egui::TextureId;
use egui::epaint::{ClippedPrimitive, ClippedShape, Mesh, Primitive};

/// The triangles of one shape.
#[derive(Debug, Clone)]
pub struct Chunk {
    /// Hash of the bytes; two chunks with the same hash are the same chunk.
    pub hash: u64,
    /// Little endian: clip rectangle \[points\] as `f32` left, top, right, bottom; `u32` number of the texture; `u32` count of
    /// vertices n; `u32` count of indices m; n vertices of 20 bytes: `f32` x, y \[points\], `f32` u, v in the texture, `u8` red,
    /// green, blue, alpha (multiplied by alpha); m indices, three to a triangle, as `u16`, or as `u32` where n is above 65,536;
    /// zeros up to a multiple of 4.
    pub bytes: Arc<[u8]>,
}

/// All chunks of a frame, in the order in which they are drawn.
pub fn of(ctx: &egui::Context, shapes: Vec<ClippedShape>, pixels_per_point: f32) -> Vec<Chunk> {
    let mut chunks = Vec::with_capacity(shapes.len());
    for shape in shapes {
        for ClippedPrimitive { clip_rect, primitive } in ctx.tessellate(vec![shape], pixels_per_point) {
            match primitive {
                Primitive::Mesh(mesh) if !mesh.indices.is_empty() => chunks.push(chunk(clip_rect, &mesh)),
                // Nothing here draws on a graphics card by itself: it would not be visible in a browser.
                Primitive::Mesh(_) | Primitive::Callback(_) => {}
            }
        }
    }
    chunks
}

/// The number of a texture; egui counts them from zero.
pub fn number(id: TextureId) -> u32 {
    match id {
        TextureId::Managed(number) => u32::try_from(number).unwrap_or(u32::MAX),
        TextureId::User(_) => u32::MAX,
    }
}

#[cfg(target_endian = "big")]
compile_error!("chunks are written as they stand in memory, and pages read little endian");

fn chunk(clip: egui::Rect, mesh: &Mesh) -> Chunk {
    let small = mesh.vertices.len() <= 1 << 16;
    let index_bytes = if small { 2 } else { 4 };
    let mut bytes = Vec::with_capacity(28 + mesh.vertices.len() * 20 + mesh.indices.len() * index_bytes + 2);
    for edge in [clip.min.x, clip.min.y, clip.max.x, clip.max.y] {
        bytes.extend(edge.to_le_bytes());
    }
    let count = |length: usize| u32::try_from(length).unwrap_or(u32::MAX).to_le_bytes();
    bytes.extend(number(mesh.texture_id).to_le_bytes());
    bytes.extend(count(mesh.vertices.len()));
    bytes.extend(count(mesh.indices.len()));
    // As in memory: every supported machine is little endian.
    bytes.extend_from_slice(bytemuck::cast_slice(&mesh.vertices));
    if small {
        let indices: Vec<u16> = mesh.indices.iter().map(|index| *index as u16).collect();
        bytes.extend_from_slice(bytemuck::cast_slice(&indices));
    } else {
        bytes.extend_from_slice(bytemuck::cast_slice(&mesh.indices));
    }
    // What follows starts at a multiple of four again.
    bytes.resize(bytes.len().next_multiple_of(4), 0);
    let mut hasher = DefaultHasher::new();
    hasher.write(&bytes);
    Chunk { hash: hasher.finish(), bytes: bytes.into() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(ctx: &egui::Context, text: &str) -> Vec<Chunk> {
        let mut chunks = Vec::new();
        // The first pass has no fonts yet.
        for _ in 0..2 {
            let input = egui::RawInput {
                screen_rect: Some(egui::Rect::from_min_size(egui::Pos2::ZERO, egui::vec2(200.0, 100.0))),
                ..egui::RawInput::default()
            };
            let mut output = ctx.run_ui(input, |ui| {
                ui.label("stays");
                ui.label(text);
            });
            output.textures_delta.clear();
            chunks = of(ctx, output.shapes, output.pixels_per_point);
        }
        chunks
    }

    #[test]
    fn what_did_not_change_has_the_same_chunk_and_what_did_another() {
        // One context: another one would place other letters at the same position of its texture.
        let ctx = egui::Context::default();
        let (one, other) = (frame(&ctx, "12.3 mm"), frame(&ctx, "12.4 mm"));
        assert_eq!(one.len(), other.len());
        let changed = one.iter().zip(&other).filter(|(one, other)| one.hash != other.hash).count();
        assert_eq!(changed, 1, "of {} chunks", one.len());
    }

    #[test]
    fn a_chunk_says_how_long_it_is() {
        for chunk in frame(&egui::Context::default(), "text") {
            let word = |at: usize| u32::from_le_bytes(chunk.bytes[at..at + 4].try_into().expect("four bytes")) as usize;
            let (vertices, indices) = (word(20), word(24));
            assert_eq!(chunk.bytes.len(), (28 + 20 * vertices + 2 * indices).next_multiple_of(4));
        }
    }
}
