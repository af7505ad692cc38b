//! The textures that pages need, with what each page lacks.
//!
//! A texture is replaced as a whole (a live image) or in parts (the letters of the fonts, as they are first needed). Each
//! change has a version, so that a page gets exactly what came after its own.

use std::collections::{BTreeMap, HashMap};
use std::io::Write as _;
use std::sync::{Arc, OnceLock};

use egui::epaint::textures::TexturesDelta;
use egui::{ColorImage, ImageData, TextureFilter, TextureOptions};
use flate2::Compression;
use flate2::write::DeflateEncoder;

use super::chunks;
use handeye_workbench::jpeg::{self, ColorType};

/// From this width and height an image without transparency is sent as JPEG.
const JPEG_FROM: usize = 128;

/// Quality of images that are seen at about their size. With it, corners of a board have no visible blocks.
const JPEG_QUALITY: u8 = 85;

/// Parts that are kept one by one; beyond it, a new page gets the texture as a whole.
const MOST_PARTS: usize = 64;

/// A texture or a part of one, as it is sent. It is encoded once, for all pages.
pub struct Part {
    /// Left and top; `None` for the whole texture.
    pub at: Option<[usize; 2]>,
    /// The pixels.
    pub image: Arc<ColorImage>,
    /// How it is sampled.
    pub options: TextureOptions,
    encoded: OnceLock<Encoded>,
}

/// The bytes of a part.
#[derive(Debug, Clone)]
pub struct Encoded {
    /// Whether it is a JPEG; otherwise deflated RGBA with premultiplied alpha.
    pub jpeg: bool,
    pub bytes: Arc<[u8]>,
}

impl Part {
    fn new(at: Option<[usize; 2]>, image: Arc<ColorImage>, options: TextureOptions) -> Arc<Self> {
        Arc::new(Self { at, image, options, encoded: OnceLock::new() })
    }

    /// Its encoded bytes.
    pub fn encoded(&self) -> &Encoded {
        self.encoded.get_or_init(|| self.encode())
    }

    fn encode(&self) -> Encoded {
        let [width, height] = self.image.size;
        // At high zoom the exact pixels have to be visible.
        let is_seen_closely = self.options.magnification == TextureFilter::Nearest;
        if self.at.is_none()
            && width.min(height) >= JPEG_FROM
            && !is_seen_closely
            && is_opaque(&self.image)
            && let Ok(bytes) = jpeg::encoded(self.image.as_raw(), ColorType::Rgba, (width, height), JPEG_QUALITY)
        {
            return Encoded { jpeg: true, bytes: bytes.into() };
        }
        Encoded { jpeg: false, bytes: deflated(self.image.as_raw()).into() }
    }
}

/// Without an early exit from the loop, so that many pixels are compared in one instruction.
fn is_opaque(image: &ColorImage) -> bool {
    image.pixels.iter().fold(u8::MAX, |all, pixel| all & pixel.a()) == u8::MAX
}

/// Deflated without a header, `deflate-raw` in browsers.
pub fn deflated(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = DeflateEncoder::new(Vec::with_capacity(bytes.len() / 4), Compression::fast());
    // Writing into memory does not fail.
    let _written = encoder.write_all(bytes).is_ok();
    encoder.finish().unwrap_or_default()
}

/// A texture with its latest changes.
#[derive(Clone)]
pub struct Texture {
    whole: Arc<Part>,
    whole_version: u64,
    /// Changes after it.
    parts: Vec<(u64, Arc<Part>)>,
}

impl Texture {
    /// The version of its last change.
    fn version(&self) -> u64 {
        self.parts.last().map_or(self.whole_version, |(version, _)| *version)
    }

    /// The whole texture with its parts in it.
    fn joined(&self) -> Arc<ColorImage> {
        let mut image = ColorImage::clone(&self.whole.image);
        for (_, part) in &self.parts {
            let Some([left, top]) = part.at else { continue };
            let [width, height] = part.image.size;
            for row in 0..height {
                let (to, from) = ((top + row) * image.size[0] + left, row * width);
                if let (Some(to), Some(from)) =
                    (image.pixels.get_mut(to..to + width), part.image.pixels.get(from..from + width))
                {
                    to.copy_from_slice(from);
                }
            }
        }
        Arc::new(image)
    }
}

/// All textures at an instant. A copy does not copy pixels.
#[derive(Clone, Default)]
pub struct Textures {
    textures: BTreeMap<u32, Texture>,
    version: u64,
}

impl Textures {
    /// Grows with every change.
    pub fn version(&self) -> u64 {
        self.version
    }

    /// Takes over what a frame changed.
    #[expect(clippy::iter_over_hash_type, reason = "textures do not depend on one another")]
    pub fn change(&mut self, delta: &mut TexturesDelta) {
        for (id, changes) in delta.set.drain() {
            for change in changes {
                self.version += 1;
                let ImageData::Color(image) = change.image;
                self.set(chunks::number(id), Part::new(change.pos, image, change.options));
            }
        }
        for id in delta.free.drain() {
            self.version += 1;
            self.textures.remove(&chunks::number(id));
        }
    }

    fn set(&mut self, id: u32, part: Arc<Part>) {
        let version = self.version;
        if part.at.is_none() {
            self.textures.insert(id, Texture { whole: part, whole_version: version, parts: Vec::new() });
            return;
        }
        // egui only changes textures that it has created.
        let Some(texture) = self.textures.get_mut(&id) else { return };
        texture.parts.push((version, part));
        if texture.parts.len() > MOST_PARTS {
            let (image, options) = (texture.joined(), texture.whole.options);
            // A page that lacks only the last parts gets the whole once more.
            *texture = Texture { whole: Part::new(None, image, options), whole_version: version, parts: Vec::new() };
        }
    }

    /// What a page with these versions needs, in the order in which it has to be applied; and the textures that it need
    /// not keep. The versions are then updated.
    pub fn news(&self, has: &mut HashMap<u32, u64>) -> (Vec<(u32, Arc<Part>)>, Vec<u32>) {
        let gone: Vec<u32> = has.keys().filter(|id| !self.textures.contains_key(id)).copied().collect();
        for id in &gone {
            has.remove(id);
        }
        let mut news = Vec::new();
        for (id, texture) in &self.textures {
            let before = has.insert(*id, texture.version());
            if before == Some(texture.version()) {
                continue;
            }
            let whole_is_new = before.is_none_or(|before| before < texture.whole_version);
            if whole_is_new {
                news.push((*id, Arc::clone(&texture.whole)));
            }
            let parts = texture.parts.iter().filter(|(version, _)| whole_is_new || before < Some(*version));
            news.extend(parts.map(|(_, part)| (*id, Arc::clone(part))));
        }
        (news, gone)
    }
}

#[cfg(test)]
mod tests {
    use egui::epaint::ImageDelta;
    use egui::{Color32, TextureId};

    use super::*;

    fn image(size: [usize; 2], grey: u8) -> Arc<ColorImage> {
        Arc::new(ColorImage::filled(size, Color32::from_gray(grey)))
    }

    fn changed(textures: &mut Textures, id: u64, delta: ImageDelta) {
        let mut all = TexturesDelta::default();
        all.push(TextureId::Managed(id), delta);
        textures.change(&mut all);
    }

    #[test]
    fn a_page_gets_what_it_has_not_and_nothing_twice() {
        let mut textures = Textures::default();
        let options = TextureOptions::LINEAR;
        changed(&mut textures, 0, ImageDelta::full(image([8, 8], 0), options));
        changed(&mut textures, 0, ImageDelta::partial([2, 3], image([2, 1], 9), options));
        let (mut early, mut late) = (HashMap::new(), HashMap::new());
        assert_eq!(textures.news(&mut early).0.len(), 2, "the whole and the part");
        assert!(textures.news(&mut early).0.is_empty());
        changed(&mut textures, 0, ImageDelta::partial([0, 0], image([1, 1], 7), options));
        changed(&mut textures, 1, ImageDelta::full(image([4, 4], 1), options));
        let (news, _) = textures.news(&mut early);
        assert_eq!(news.iter().map(|(id, part)| (*id, part.at)).collect::<Vec<_>>(), [(0, Some([0, 0])), (1, None)]);
        assert_eq!(textures.news(&mut late).0.len(), 4);

        let mut freed = TexturesDelta::default();
        freed.free(TextureId::Managed(1));
        textures.change(&mut freed);
        assert_eq!(textures.news(&mut early).1, [1]);
        assert_eq!(textures.news(&mut early).1, [] as [u32; 0]);
    }

    #[test]
    fn many_parts_become_one_whole_with_all_of_them() {
        let mut textures = Textures::default();
        let options = TextureOptions::LINEAR;
        changed(&mut textures, 0, ImageDelta::full(image([100, 2], 0), options));
        let mut has = HashMap::new();
        textures.news(&mut has);
        for at in 0..=MOST_PARTS {
            changed(&mut textures, 0, ImageDelta::partial([at, 1], image([1, 1], 200), options));
        }
        let (news, _) = textures.news(&mut has);
        let [(0, whole)] = news.as_slice() else { panic!("{} parts", news.len()) };
        let lit = whole.image.pixels.iter().filter(|pixel| pixel.r() == 200).count();
        assert_eq!((whole.at, lit), (None, MOST_PARTS + 1));
        assert_eq!(whole.image.pixels[100], Color32::from_gray(200), "second row, first column");
    }

    #[test]
    fn large_images_are_photographs_and_small_or_transparent_ones_are_exact() {
        let part = |size, colour, options| {
            let image = Arc::new(ColorImage::filled(size, colour));
            Part::new(None, image, options).encoded().jpeg
        };
        let opaque = Color32::from_rgb(90, 120, 40);
        assert!(part([640, 480], opaque, TextureOptions::LINEAR));
        assert!(!part([64, 48], opaque, TextureOptions::LINEAR));
        assert!(!part([640, 480], Color32::from_rgba_premultiplied(1, 1, 1, 128), TextureOptions::LINEAR));
        assert!(!part([640, 480], opaque, TextureOptions::NEAREST), "looked at pixel by pixel");
    }
}
