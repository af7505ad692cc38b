//! The message that turns the frame that a page has into the present one.

use std::collections::HashMap;

use egui::TextureFilter;
use serde::Serialize;

use super::chunks::Chunk;
use super::frame::{Frame, Typing};
use super::textures::deflated;

/// The highest bit of an entry: chunks of the previous frame, from an index on.
const COPY: u32 = 1 << 31;

/// What a page has.
#[derive(Default)]
pub struct Shown {
    /// Hashes of the chunks of its frame.
    chunks: Vec<u64>,
    /// Versions of its textures.
    textures: HashMap<u32, u64>,
}

/// The head of a message.
#[derive(Serialize)]
struct Head<'a> {
    number: u64,
    size: [f32; 2],
    pixels_per_point: f32,
    cursor: &'a str,
    typing: Option<Typing>,
    /// Bytes of the deflated list of chunks.
    chunks: usize,
    textures: Vec<TextureHead>,
    free: Vec<u32>,
}

/// A texture, or a part of one, after the head.
#[derive(Serialize)]
struct TextureHead {
    id: u32,
    at: Option<[usize; 2]>,
    size: [usize; 2],
    nearest: bool,
    jpeg: bool,
    bytes: usize,
}

impl Shown {
    /// The message; afterwards what is shown is this frame.
    pub fn message(&mut self, number: u64, frame: &Frame) -> Vec<u8> {
        let chunks = deflated(&self.list(&frame.chunks));
        self.chunks = frame.chunks.iter().map(|chunk| chunk.hash).collect();
        let (news, free) = frame.textures.news(&mut self.textures);
        let textures = news.iter().map(|(id, part)| {
            let encoded = part.encoded();
            TextureHead {
                id: *id,
                at: part.at,
                size: part.image.size,
                nearest: part.options.magnification == TextureFilter::Nearest,
                jpeg: encoded.jpeg,
                bytes: encoded.bytes.len(),
            }
        });
        let head = Head {
            number,
            size: frame.size,
            pixels_per_point: frame.pixels_per_point,
            cursor: frame.cursor,
            typing: frame.typing,
            chunks: chunks.len(),
            textures: textures.collect(),
            free,
        };
        // Only numbers and strings: serialization cannot fail.
        let head = serde_json::to_vec(&head).unwrap_or_default();
        let all: usize = news.iter().map(|(_, part)| part.encoded().bytes.len()).sum();
        let mut message = Vec::with_capacity(4 + head.len() + chunks.len() + all);
        message.extend(u32::try_from(head.len()).unwrap_or(u32::MAX).to_le_bytes());
        message.extend(head);
        message.extend(chunks);
        for (_, part) in &news {
            message.extend(&*part.encoded().bytes);
        }
        message
    }

    /// The chunks: runs of the previous frame, and those that were not in it.
    fn list(&self, chunks: &[Chunk]) -> Vec<u8> {
        let mut places: HashMap<u64, usize> = HashMap::with_capacity(self.chunks.len());
        for (place, hash) in self.chunks.iter().enumerate() {
            places.entry(*hash).or_insert(place);
        }
        let mut list = Vec::new();
        let word = |list: &mut Vec<u8>, word: usize| {
            list.extend(u32::try_from(word).unwrap_or(0).to_le_bytes());
        };
        let mut index = 0;
        while let Some(chunk) = chunks.get(index) {
            let Some(&start) = places.get(&chunk.hash) else {
                word(&mut list, chunk.bytes.len());
                list.extend(&*chunk.bytes);
                index += 1;
                continue;
            };
            let same = self.chunks[start..].iter().zip(&chunks[index..]);
            let count = same.take_while(|(before, now)| **before == now.hash).count();
            word(&mut list, count | COPY as usize);
            word(&mut list, start);
            index += count;
        }
        list
    }
}

#[cfg(test)]
mod tests {
    use std::io::Read as _;

    use super::*;

    fn chunk(name: u8) -> Chunk {
        Chunk { hash: u64::from(name), bytes: vec![name; 4 * usize::from(name)].into() }
    }

    fn frame(names: &[u8]) -> Frame {
        Frame { chunks: names.iter().map(|name| chunk(*name)).collect(), ..Frame::default() }
    }

    /// The result of a message on a page.
    fn applied(before: &[Vec<u8>], message: &[u8]) -> Vec<Vec<u8>> {
        let word = |bytes: &[u8]| u32::from_le_bytes(bytes[..4].try_into().expect("four bytes"));
        let end = 4 + word(message) as usize;
        let head: serde_json::Value = serde_json::from_slice(&message[4..end]).expect("JSON");
        let length = head["chunks"].as_u64().expect("a length") as usize;
        let mut list = Vec::new();
        flate2::read::DeflateDecoder::new(&message[end..end + length]).read_to_end(&mut list).expect("deflated");
        let (mut now, mut at) = (Vec::new(), 0);
        while at < list.len() {
            let entry = word(&list[at..]);
            at += 4;
            if entry & COPY == 0 {
                now.push(list[at..at + entry as usize].to_vec());
                at += entry as usize;
            } else {
                let start = word(&list[at..]) as usize;
                now.extend_from_slice(&before[start..start + (entry & !COPY) as usize]);
                at += 4;
            }
        }
        now
    }

    #[test]
    fn a_page_that_applies_the_messages_has_every_frame() {
        let mut shown = Shown::default();
        let mut page: Vec<Vec<u8>> = Vec::new();
        let frames: [&[u8]; 7] = [
            &[1, 2, 3, 4, 5],
            &[1, 2, 9, 4, 5],
            &[4, 5, 1, 2],
            &[],
            &[7, 7, 7, 8, 7, 7],
            &[7, 7, 7, 7, 8, 8],
            &[8, 7, 6, 5, 4, 3, 2, 1],
        ];
        for (number, names) in frames.into_iter().enumerate() {
            let frame = frame(names);
            page = applied(&page, &shown.message(number as u64, &frame));
            let expected: Vec<Vec<u8>> = frame.chunks.iter().map(|chunk| chunk.bytes.to_vec()).collect();
            assert_eq!(page, expected, "frame {number}");
        }
    }

    #[test]
    fn a_frame_that_did_not_change_is_one_entry() {
        let mut shown = Shown::default();
        let frame = frame(&(1..=200).collect::<Vec<u8>>());
        let first = shown.message(1, &frame).len();
        let list = shown.list(&frame.chunks);
        assert_eq!(list.len(), 8);
        assert!(shown.message(2, &frame).len() < first);
    }
}
