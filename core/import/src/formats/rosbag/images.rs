//! Images of a bag.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

use image::{DynamicImage, GrayImage, RgbImage};

use super::storage::{Message, visit};
use crate::recording::{ImageFile, Recording, Stream};
use handeye_files::budget::Budget;
use handeye_wording::Text;
use handeye_wording::foreign;
use handeye_wording::text;

/// The file of the image of a topic with a stamp.
pub(super) fn name(topic: &str, stamp: i64) -> String {
    let topic: String = topic.trim_matches('/').chars().map(|c| if c.is_alphanumeric() { c } else { '_' }).collect();
    format!("{topic}_{stamp}.png")
}

/// Writes the chosen images into a folder of this machine's temporary files, which is deleted with the recording. Those of a
/// moving robot keep their timestamps.
///
/// # Errors
/// A sentence, where nothing can be written there or the budget is spent.
pub(super) fn unpack(
    file: &str,
    parts: &[PathBuf],
    chosen: &BTreeMap<String, Vec<i64>>,
    with_stamps: bool,
    budget: &Budget<'_>,
    recording: &mut Recording,
) -> Result<(), Text> {
    if chosen.is_empty() {
        return Ok(());
    }
    let scratch = tempfile::tempdir().map_err(|e| foreign(&e))?;
    let mut streams: BTreeMap<String, Stream> = BTreeMap::new();
    let mut troubles = Vec::new();
    for part in parts {
        visit(part, budget, &mut |message| {
            let Some(stamps) = chosen.get(message.topic) else { return };
            let found = stamp_of(&message).filter(|stamp| stamps.binary_search(stamp).is_ok());
            let Some(stamp) = found else { return };
            let path = scratch.path().join(name(message.topic, stamp));
            let saved = decoded(&message).and_then(|image| image.save(&path).map(|()| image).map_err(|e| foreign(&e)));
            match saved {
                Ok(image) => {
                    // An upper bound of its size on disk.
                    let _spent = budget.unpack(image.as_bytes().len() as u64);
                    let stream = streams.entry(message.topic.to_owned()).or_insert_with(|| Stream {
                        name: message.topic.to_owned(),
                        images: Vec::new(),
                        size: (image.width(), image.height()),
                        is_depth: matches!(image, DynamicImage::ImageLuma16(_)),
                        points: None,
                    });
                    stream.images.push(ImageFile {
                        path,
                        number: None,
                        same_as: None,
                        stamp_ns: with_stamps.then_some(stamp),
                    });
                }
                Err(why) => troubles.push(text!(
                    "{file}: an image on {topic} is not used: {why}",
                    file = file,
                    topic = message.topic,
                    why = why
                )),
            }
        })?;
    }
    troubles.truncate(5);
    recording.warnings.extend(troubles);
    for mut stream in streams.into_values() {
        stream.images.sort_by(|a, b| a.path.cmp(&b.path));
        stream.images.dedup();
        recording.streams.push(stream);
    }
    recording.scratch.push(Arc::new(scratch));
    Ok(())
}

/// When an image was taken. Drivers without a clock leave the stamp at zero.
pub(super) fn stamp_of(message: &Message) -> Option<i64> {
    let stamp = message.reader()?.header()?.stamp_ns;
    Some(if stamp == 0 { message.log_ns } else { stamp })
}

fn decoded(message: &Message) -> Result<DynamicImage, Text> {
    let short = || text!("its message ends early");
    let mut reader = message.reader().ok_or_else(short)?;
    reader.header().ok_or_else(short)?;
    if message.kind.ends_with("CompressedImage") {
        reader.text().ok_or_else(short)?;
        let bytes = reader.blob().ok_or_else(short)?;
        return handeye_images::decode_bytes(bytes).map_err(Text::from);
    }
    let sizes = (reader.u32(), reader.u32());
    let (Some(height), Some(width)) = sizes else { return Err(short()) };
    let encoding = reader.text().ok_or_else(short)?;
    reader.u8().ok_or_else(short)?;
    let step = reader.u32().ok_or_else(short)? as usize;
    let bytes = reader.blob().ok_or_else(short)?;
    raw(&encoding, (width, height), step, bytes)
}

/// An image with `step` bytes per row.
fn raw(encoding: &str, (width, height): (u32, u32), step: usize, bytes: &[u8]) -> Result<DynamicImage, Text> {
    let none = || text!("its size is none");
    let channels = match encoding {
        "rgb8" | "bgr8" | "8UC3" => 3,
        "rgba8" | "bgra8" => 4,
        "mono8" | "8UC1" => 1,
        other => {
            let encoding = format!("{other:?}");
            return Err(text!(
                "its encoding is {encoding}: rgb8, bgr8, rgba8, bgra8 and mono8 are read",
                encoding = encoding
            ));
        }
    };
    let wide = width as usize * channels;
    if wide == 0 || height == 0 || step < wide {
        return Err(none());
    }
    let mut pixels = Vec::new();
    for row in 0..height as usize {
        let start = row.checked_mul(step).ok_or_else(none)?;
        let row = bytes.get(start..start.saturating_add(wide)).ok_or_else(|| text!("its message ends early"))?;
        match encoding {
            "bgr8" | "8UC3" | "bgra8" => pixels.extend(row.chunks_exact(channels).flat_map(|p| [p[2], p[1], p[0]])),
            "rgba8" => pixels.extend(row.chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]])),
            _ => pixels.extend_from_slice(row),
        }
    }
    if channels == 1 {
        GrayImage::from_raw(width, height, pixels).map(DynamicImage::ImageLuma8).ok_or_else(none)
    } else {
        RgbImage::from_raw(width, height, pixels).map(DynamicImage::ImageRgb8).ok_or_else(none)
    }
}
