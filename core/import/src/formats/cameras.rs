//! Cameras that others have calibrated: in documents, in texts, mrcal's `.cameramodel` and the TAR of ROS' calibrator.

use super::intrinsics::{brown, camera, of_document, size_of};
use super::{Content, Encoding, File, Format, text_camera};
use crate::folder;
use crate::formats::reader::Reader;
use crate::recording::FoundCamera;
use crate::value;
use handeye_geometry::camera::Distortion;
use handeye_wording::Text;
use handeye_wording::text;

pub(super) struct Cameras;

impl Format for Cameras {
    fn name(&self) -> Text {
        text!("a camera")
    }

    fn endings(&self) -> &'static [(&'static str, Encoding)] {
        &[("cameramodel", Encoding::Own), ("tar", Encoding::Own)]
    }

    fn is_of_poses(&self) -> bool {
        false
    }

    fn sniff(&self, file: &File) -> bool {
        !matches!(file.content, Content::Unread) || self.has_ending(file)
    }

    fn read(&self, file: &File, reader: &mut Reader<'_>) -> bool {
        let (path, name) = (&file.path, file.name());
        let found: Vec<FoundCamera> = match &file.content {
            Content::Document(value) => of_document(value, &name),
            Content::Text(text) => text_camera::read(text, path, reader.root).into_iter().collect(),
            Content::Unread if folder::ending(path) == "tar" => {
                let text = folder::bytes(&reader.root.join(path)).ok().and_then(|bytes| ost_in_tar(&bytes));
                let documents = text.and_then(|text| value::yaml(&text).ok()).unwrap_or_default();
                documents.iter().flat_map(|value| of_document(value, &name)).collect()
            }
            Content::Unread => reader.text(path).and_then(|text| mrcal(&text, &name)).into_iter().collect(),
        };
        reader.recording.cameras.extend(found);
        false
    }
}

/// mrcal's `.cameramodel`: a Python dictionary, which is YAML except for the comments and trailing commas.
pub(super) fn mrcal(text: &str, file: &str) -> Option<FoundCamera> {
    let value = value::yaml(text).ok()?.into_iter().next()?;
    let model = value.get("lensmodel")?.text()?.to_owned();
    let numbers = value.get("intrinsics")?.numbers(16)?;
    let (four, k) = numbers.split_first_chunk::<4>()?;
    let distortion = match (&*model, k.len()) {
        ("LENSMODEL_PINHOLE", 0) => Distortion::None,
        ("LENSMODEL_OPENCV4", 4) | ("LENSMODEL_OPENCV5", 5) | ("LENSMODEL_OPENCV8", 8) => brown(k)?,
        _ => return None,
    };
    camera(file, "a camera model of mrcal", *four, size_of(&value), distortion)
}

/// The text of `ost.yaml` in the TAR that ROS' camera calibrator writes; `None` when there is none. Only uncompressed files
/// in it are read.
fn ost_in_tar(bytes: &[u8]) -> Option<String> {
    const BLOCK: usize = 512;
    let mut at = 0;
    while let Some(header) = bytes.get(at..at + BLOCK) {
        if header[0] == 0 {
            return None;
        }
        let text = |range: std::ops::Range<usize>| {
            String::from_utf8_lossy(&header[range]).trim_matches(['\0', ' ']).to_owned()
        };
        let size = usize::from_str_radix(&text(124..136), 8).ok()?;
        let start = at + BLOCK;
        if text(0..100).ends_with("ost.yaml") {
            return bytes.get(start..start.checked_add(size)?).map(|b| String::from_utf8_lossy(b).into_owned());
        }
        at = start.checked_add(size.div_ceil(BLOCK).checked_mul(BLOCK)?)?;
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_camera_of_a_tar_is_found_behind_other_files_and_a_cut_tar_is_none() {
        let mut tar = Vec::new();
        for (name, content) in [("left-0000.png", "x".repeat(700)), ("ost.yaml", "image_width: 3\n".to_owned())] {
            let mut header = [0u8; 512];
            header[..name.len()].copy_from_slice(name.as_bytes());
            let size = format!("{:011o}\0", content.len());
            header[124..136].copy_from_slice(size.as_bytes());
            tar.extend_from_slice(&header);
            tar.extend_from_slice(content.as_bytes());
            tar.resize(tar.len().div_ceil(512) * 512, 0);
        }
        assert_eq!(ost_in_tar(&tar).as_deref(), Some("image_width: 3\n"));
        for cut in 0..tar.len() {
            let _cut = ost_in_tar(&tar[..cut]);
        }
    }
}
