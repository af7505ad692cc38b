//! The images of a data set: which there are, and that they are of one size.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::EntryList;
use super::error::{DatasetError, DatasetProblem, shown};
use handeye_geometry::natural_order;
use handeye_wording::one_line;

/// Endings of the formats that are read, in lower case.
const ENDINGS: [&str; 6] = ["png", "jpg", "jpeg", "bmp", "tif", "tiff"];
/// Folder in which sessions keep their images.
const SUBFOLDER: &str = "images";

/// Entries of a folder that are checked to determine whether it holds images.
const LOOKED_AT: usize = 1000;

/// Whether there is an image in a folder or in its folder `images`, by the ending of its name. For a folder that cannot be read,
/// or an image after more than a thousand other files, it returns false.
pub fn holds_images(folder: &Path) -> bool {
    let holds = |folder: &Path| {
        std::fs::read_dir(folder).is_ok_and(|entries| entries.take(LOOKED_AT).flatten().any(|it| is_image(&it.path())))
    };
    holds(folder) || holds(&folder.join(SUBFOLDER))
}

fn is_image(path: &Path) -> bool {
    let is_hidden = path.file_name().is_some_and(|name| name.to_string_lossy().starts_with('.'));
    !is_hidden && path.extension().is_some_and(|it| ENDINGS.iter().any(|ending| it.eq_ignore_ascii_case(ending)))
}

/// The images in a folder and in its folder `images`, in natural order; hidden files are left out.
pub(super) fn list(folder: &Path) -> Result<Vec<PathBuf>, DatasetError> {
    let mut paths = list_one(folder, Path::new(""))?;
    if folder.join(SUBFOLDER).is_dir() {
        paths.append(&mut list_one(folder, Path::new(SUBFOLDER))?);
    }
    paths.sort_by(|a, b| natural_order::compare(&a.to_string_lossy(), &b.to_string_lossy()));
    Ok(paths)
}

fn list_one(folder: &Path, sub: &Path) -> Result<Vec<PathBuf>, DatasetError> {
    let here = folder.join(sub);
    let unreadable = |e: std::io::Error| DatasetError::new(&here, None, DatasetProblem::Unreadable(one_line(&e)));
    let mut paths = Vec::new();
    for entry in std::fs::read_dir(&here).map_err(unreadable)? {
        let path = sub.join(entry.map_err(unreadable)?.file_name());
        if is_image(&path) && folder.join(&path).is_file() {
            paths.push(path);
        }
    }
    Ok(paths)
}

/// The size of every view's image, `None` where it may be absent and is.
pub(super) fn look_at(entries: &EntryList<'_>, may_be_absent: bool) -> Result<Vec<Option<(u32, u32)>>, DatasetError> {
    let mut sizes = Vec::with_capacity(entries.views.len());
    for view in &entries.views {
        let path = entries.folder.join(&view.path);
        if !path.exists() {
            if !may_be_absent {
                return Err(entries.fail(view, DatasetProblem::MissingImage(shown(&view.name))));
            }
            sizes.push(None);
            continue;
        }
        let size = handeye_images::image_size(&path).map_err(|source| {
            entries.fail(view, DatasetProblem::BadImage { name: shown(&view.name), source: Box::new(source) })
        })?;
        sizes.push(Some(size));
    }
    Ok(sizes)
}

/// The size that `[camera]` states, or that most images have; every image must have it. `None` without both.
pub(super) fn common_size(
    entries: &EntryList<'_>,
    sizes: &[Option<(u32, u32)>],
    stated: Option<(u32, u32)>,
) -> Result<Option<(u32, u32)>, DatasetError> {
    let mut counts = BTreeMap::new();
    for size in sizes.iter().flatten() {
        *counts.entry(*size).or_insert(0usize) += 1;
    }
    // The majority is right, so that the message points at the odd one out even when that comes first.
    let most_common = counts.into_iter().max_by_key(|(_, count)| *count).map(|(size, _)| size);
    let Some(need) = stated.or(most_common) else { return Ok(None) };
    let others = if stated.is_some() { "[camera] says" } else { "most images are" };
    for (view, size) in entries.views.iter().zip(sizes) {
        if let Some(got) = size.filter(|got| *got != need) {
            let problem = DatasetProblem::ImageSize { name: shown(&view.name), got, need, others };
            return Err(entries.fail(view, problem));
        }
    }
    Ok(Some(need))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_are_told_by_their_endings_and_looked_for_where_sessions_keep_them() {
        let folder = tempfile::tempdir().expect("a folder");
        let touch = |name: &str| {
            let path = folder.path().join(name);
            std::fs::create_dir_all(path.parent().expect("a folder")).expect("made");
            std::fs::write(path, "").expect("written");
        };
        let holds = |name: &str| holds_images(&folder.path().join(name));
        touch("plain/poses.csv");
        touch("plain/.hidden.png");
        touch("flat/001.JPG");
        touch("below/images/001.tiff");
        touch("deeper/left/001.png");
        assert_eq!(["plain", "flat", "below", "deeper", "nowhere"].map(holds), [false, true, true, false, false]);
    }
}
