//! The files of a recording, within bounds.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use super::error::ImportError;
pub(super) use super::naming::{groups, naming, shown};
use super::recording::{ImageFile, Stream};
use handeye_files::bounds::Bounds;
use handeye_files::budget::Budget;
use handeye_files::own_folder::DESCRIPTION;
use handeye_geometry::natural_order;
use handeye_wording::Text;
use handeye_wording::one_line;
use handeye_wording::text;

/// Most files that are listed.
const MAX_FILES: usize = 20_000;
/// Folders below the one that was named.
const MAX_DEPTH: usize = 4;
/// Most bytes of a file of text: ten thousand poses are two million.
const MAX_TEXT_BYTES: u64 = 1 << 26;
/// Images of one naming that make a stream.
const LEAST_IMAGES: usize = 3;

const IMAGES: [&str; 6] = ["png", "jpg", "jpeg", "bmp", "tif", "tiff"];

/// The files of a folder and of those in it, in natural order, as paths below it. Hidden ones are left out. For a named
/// file: it, as the last one, and the files next to it that `belongs_to` accepts.
///
/// Links that lead out of the bounds are not among them; they are reported in `warnings`.
pub(super) fn list(
    path: &Path,
    belongs_to: impl Fn(&Path, &Path) -> bool,
    bounds: &Bounds,
    budget: &Budget<'_>,
    warnings: &mut Vec<Text>,
) -> Result<(PathBuf, Vec<PathBuf>, Option<PathBuf>), ImportError> {
    let found = fs::metadata(path).map_err(|e| unreadable(path, &e))?;
    let (root, only) = if found.is_dir() {
        (path.to_path_buf(), None)
    } else {
        let root = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        (root.to_path_buf(), path.file_name().map(PathBuf::from))
    };
    let mut files = Vec::new();
    walk(&root, Path::new(""), if only.is_some() { 0 } else { MAX_DEPTH }, budget, &mut files)?;
    files.retain(|file| {
        let is_inside = bounds.has(&root.join(file));
        if !is_inside {
            warnings.push(text!(
                "{file} leads out of the folder that may be read from here and is not read",
                file = file.display()
            ));
        }
        is_inside
    });
    if let Some(only) = &only {
        // Beside a file that was named only what it may refer to counts: images, the description of a camera.
        files.retain(|file| file == only || belongs_to(file, only));
    }
    files.sort_by(|a, b| natural_order::compare(&a.to_string_lossy(), &b.to_string_lossy()));
    Ok((root, files, only))
}

fn walk(
    root: &Path,
    below: &Path,
    depth: usize,
    budget: &Budget<'_>,
    files: &mut Vec<PathBuf>,
) -> Result<(), ImportError> {
    let here = root.join(below);
    for entry in fs::read_dir(&here).map_err(|e| unreadable(&here, &e))? {
        let entry = entry.map_err(|e| unreadable(&here, &e))?;
        budget.check().map_err(|why| ImportError::stopped(root, why))?;
        let name = entry.file_name();
        if name.to_string_lossy().starts_with('.') {
            continue;
        }
        let path = below.join(&name);
        // A link to a folder may lead in a circle, and a pipe would never end.
        let Ok(found) = entry.file_type() else { continue };
        if found.is_dir() && depth > 0 {
            // Data sets are outputs of imports, some of them next to their inputs.
            if root.join(&path).join(DESCRIPTION).exists() {
                continue;
            }
            walk(root, &path, depth - 1, budget, files)?;
        } else if fs::metadata(root.join(&path)).is_ok_and(|m| m.is_file()) {
            files.push(path);
        }
        if files.len() > MAX_FILES {
            let limit = MAX_FILES as u64;
            return Err(ImportError::TooMuch { file: here, what: "has too many files", limit });
        }
    }
    Ok(())
}

/// The images in folders below the one that is named, in which the poses name them; links are not followed.
pub(super) fn images_below<'a>(
    root: &Path,
    names: impl Iterator<Item = &'a str>,
    bounds: &Bounds,
    budget: &Budget<'_>,
) -> Vec<PathBuf> {
    let mut folders: std::collections::BTreeSet<PathBuf> = std::collections::BTreeSet::new();
    for name in names {
        let path = PathBuf::from(name.trim().replace('\\', "/"));
        let Some(folder) = path.parent().filter(|folder| !folder.as_os_str().is_empty()) else { continue };
        let is_below = folder.components().all(|part| matches!(part, std::path::Component::Normal(_)));
        if is_below && folder.components().count() <= MAX_DEPTH {
            folders.insert(folder.to_path_buf());
        }
    }
    let is_folder = |folder: &PathBuf| {
        folder
            .ancestors()
            .filter(|part| !part.as_os_str().is_empty())
            .all(|part| fs::symlink_metadata(root.join(part)).is_ok_and(|found| found.is_dir()))
    };
    let mut files = Vec::new();
    for folder in folders.iter().filter(|folder| is_folder(folder)) {
        // A folder that cannot be listed has no images.
        let _left_out = walk(root, folder, 0, budget, &mut files).is_err();
    }
    files.retain(|file| is_image(file) && bounds.has(&root.join(file)));
    files.sort_by(|a, b| natural_order::compare(&a.to_string_lossy(), &b.to_string_lossy()));
    files
}

pub(super) fn unreadable(path: &Path, error: &std::io::Error) -> ImportError {
    ImportError::Unreadable { file: path.to_path_buf(), why: one_line(error) }
}

/// The ending of a name, in lower case.
pub(super) fn ending(path: &Path) -> String {
    path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default()
}

pub(super) fn is_image(path: &Path) -> bool {
    IMAGES.contains(&&*ending(path))
}

/// The bytes of a file that is not too large.
pub(super) fn bytes(path: &Path) -> Result<Vec<u8>, ImportError> {
    let found = fs::metadata(path).map_err(|e| unreadable(path, &e))?;
    if found.len() > MAX_TEXT_BYTES {
        let file = path.to_path_buf();
        return Err(ImportError::TooMuch { file, what: "has too many bytes", limit: MAX_TEXT_BYTES });
    }
    fs::read(path).map_err(|e| unreadable(path, &e))
}

/// The text of a file; bytes that are not UTF-8 become characters that are not part of a number.
pub(super) fn text(path: &Path) -> Result<String, ImportError> {
    let bytes = bytes(path)?;
    let text = match bytes.as_slice() {
        // The encoding that Windows calls Unicode.
        [0xff, 0xfe, rest @ ..] => {
            let units = rest.chunks_exact(2).map(|c| u16::from_le_bytes([c[0], c[1]]));
            char::decode_utf16(units).map(|c| c.unwrap_or('\u{fffd}')).collect()
        }
        _ => String::from_utf8_lossy(&bytes).into_owned(),
    };
    Ok(text.strip_prefix('\u{feff}').map(str::to_owned).unwrap_or(text))
}

/// The streams of images in a list of files, the largest first, and what is odd about them; of a part where the budget is spent.
pub(super) fn streams(root: &Path, files: &[PathBuf], budget: &Budget<'_>, warnings: &mut Vec<Text>) -> Vec<Stream> {
    let images: Vec<PathBuf> = files.iter().filter(|file| is_image(file)).cloned().collect();
    let mut streams = Vec::new();
    let mut single: BTreeMap<PathBuf, Vec<(PathBuf, Option<u64>)>> = BTreeMap::new();
    for members in merged(&images) {
        if members.len() >= LEAST_IMAGES {
            take(root, members, budget, &mut streams, warnings);
        } else {
            for member in members {
                let folder = member.0.parent().map(Path::to_path_buf).unwrap_or_default();
                single.entry(folder).or_default().push(member);
            }
        }
    }
    for (folder, members) in single {
        let has_stream = streams.iter().any(|s: &Stream| s.images[0].path.parent() == Some(folder.as_path()));
        if has_stream || members.len() < LEAST_IMAGES {
            let names: Vec<String> = members.iter().map(|(path, _)| path.display().to_string()).take(4).collect();
            warnings.push(text!(
                "{count} {count|image is of no series and is|images are of no series and are} not used: {names}",
                count = members.len(),
                names = names.join(", ")
            ));
        } else {
            let members = members.into_iter().map(|(path, _)| (path, None)).collect();
            take(root, members, budget, &mut streams, warnings);
        }
    }
    streams.sort_by(|a, b| a.is_depth.cmp(&b.is_depth).then(b.images.len().cmp(&a.images.len())));
    streams
}

/// Groups by naming; two endings are one series unless they count the same numbers.
fn merged(images: &[PathBuf]) -> Vec<Vec<(PathBuf, Option<u64>)>> {
    let mut out = Vec::new();
    for members in groups(images, false) {
        let mut endings: Vec<String> = members.iter().map(|(path, _)| ending(path)).collect();
        endings.sort();
        endings.dedup();
        let stems: std::collections::BTreeSet<_> = members.iter().map(|(path, _)| path.file_stem()).collect();
        if endings.len() > 1 && stems.len() < members.len() {
            for one in endings {
                out.push(members.iter().filter(|(path, _)| ending(path) == one).cloned().collect());
            }
        } else {
            out.push(members);
        }
    }
    out
}

/// Streams of one size out of images of one naming.
fn take(
    root: &Path,
    members: Vec<(PathBuf, Option<u64>)>,
    budget: &Budget<'_>,
    streams: &mut Vec<Stream>,
    warnings: &mut Vec<Text>,
) {
    let mut by_size: BTreeMap<((u32, u32), bool), Vec<ImageFile>> = BTreeMap::new();
    for (path, number) in members {
        if budget.is_spent() {
            return;
        }
        match handeye_images::image_size(&root.join(&path)) {
            Ok(size) => {
                let is_depth = is_sixteen_bits_of_grey(&root.join(&path));
                by_size.entry((size, is_depth)).or_default().push(ImageFile {
                    path,
                    number,
                    same_as: None,
                    stamp_ns: None,
                });
            }
            Err(why) => warnings.push(text!("{name}: {why}", name = path.display(), why = why)),
        }
    }
    let sizes = by_size.len();
    for ((size, is_depth), mut images) in by_size {
        images.sort_by(|a, b| natural_order::compare(&a.path.to_string_lossy(), &b.path.to_string_lossy()));
        if images.len() < LEAST_IMAGES {
            warnings.push(text!(
                "{image} has another size ({width}×{height}) than the others",
                image = images[0].shown(),
                width = size.0,
                height = size.1
            ));
            continue;
        }
        find_doubled(root, &mut images, budget, warnings);
        let mut name = shown(images.iter().map(|image| image.path.as_path()));
        if sizes > 1 {
            name = format!("{name} ({}×{})", size.0, size.1);
        }
        streams.push(Stream { name, images, size, is_depth, points: None });
    }
}

/// Depth is kept so by cameras that have both; only the header is read.
fn is_sixteen_bits_of_grey(path: &Path) -> bool {
    use image::ImageDecoder as _;
    if ending(path) != "png" {
        return false;
    }
    let Ok(file) = fs::File::open(path) else { return false };
    image::codecs::png::PngDecoder::new(std::io::BufReader::new(file))
        .is_ok_and(|decoder| decoder.color_type() == image::ColorType::L16)
}

fn find_doubled(root: &Path, images: &mut [ImageFile], budget: &Budget<'_>, warnings: &mut Vec<Text>) {
    use sha2::Digest as _;
    let mut by_length: BTreeMap<u64, Vec<usize>> = BTreeMap::new();
    for (i, image) in images.iter().enumerate() {
        let length = fs::metadata(root.join(&image.path)).map_or(0, |m| m.len());
        by_length.entry(length).or_default().push(i);
    }
    for same in by_length.into_values().filter(|same| same.len() > 1) {
        let mut seen: BTreeMap<Vec<u8>, usize> = BTreeMap::new();
        for i in same {
            if budget.is_spent() {
                return;
            }
            let Ok(bytes) = fs::read(root.join(&images[i].path)) else { continue };
            match seen.entry(sha2::Sha256::digest(&bytes).to_vec()) {
                std::collections::btree_map::Entry::Vacant(new) => {
                    new.insert(i);
                }
                std::collections::btree_map::Entry::Occupied(first) => {
                    images[i].same_as = Some(*first.get());
                    let (copy, original) = (images[i].shown(), images[*first.get()].shown());
                    warnings.push(text!(
                        "{copy} is a copy of {original}, byte by byte",
                        copy = copy,
                        original = original
                    ));
                }
            }
        }
    }
}
