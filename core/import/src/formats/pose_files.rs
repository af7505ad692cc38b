//! Recordings with one file per pose.

use std::ffi::OsStr;
use std::path::Path;
use std::sync::Arc;

use super::{Content, File, Format, blocks, joints, npz, single, tree};
use crate::folder;
use crate::formats::reader::Reader;
use crate::recording::{Role, Sample, Stated, Track};
use crate::value::Value;
use handeye_wording::Text;
use handeye_wording::text;

pub(super) struct PoseFiles;

impl Format for PoseFiles {
    fn name(&self) -> Text {
        text!("one file per pose")
    }

    fn sniff(&self, file: &File) -> bool {
        !matches!(file.content, Content::Unread) || npz::NumPy.sniff(file)
    }

    fn read_together(&self, files: &[File], reader: &mut Reader<'_>) -> bool {
        if files.len() < tree::LEAST_POSES {
            return false;
        }
        match files[0].content {
            Content::Document(_) => of_documents(files, reader),
            Content::Text(_) => of_texts(files, reader),
            Content::Unread => of_arrays(files, reader),
        }
    }
}

/// The series of documents that have a pose each, one for every place at which most of them have one.
pub(super) fn tracks(files: &[File], reader: &Reader<'_>) -> Vec<Track> {
    // Where each file is a series, their first poses together are not one.
    let is_series = |value: &Value| tree::series(value, "").iter().any(|track| !track.is_still());
    let are_series = files.iter().filter_map(File::value).filter(|value| is_series(value)).count() * 2 > files.len();
    let mut by_path: Vec<(String, Stated, Vec<Sample>)> = Vec::new();
    for file in files {
        let Some(fields) = file.value().map(tree::fields) else { continue };
        let image = fields.image.map(|image| next_to(reader.root, &file.path, image));
        for (path, numbers, stated) in fields.poses {
            if are_series && (path.contains('[') || path.ends_with(|c: char| c.is_ascii_digit())) {
                continue;
            }
            let sample = Sample {
                image: image.clone(),
                number: file.number.or(fields.number),
                place: Arc::new(single::place(&file.path)),
                numbers,
                joints: fields.joints.clone(),
            };
            match by_path.iter_mut().find(|(known, ..)| *known == path) {
                Some((.., samples)) => samples.push(sample),
                None => by_path.push((path, stated, vec![sample])),
            }
        }
    }
    let name = shown(files);
    let track = |(path, stated, mut samples): (String, Stated, Vec<Sample>)| {
        samples.sort_by(|a, b| handeye_geometry::natural_order::compare(&a.place.to_string(), &b.place.to_string()));
        (2 * samples.len() >= files.len())
            .then(|| tree::track(tree::track_name(&name, &path), &path, stated, samples))
            .flatten()
    };
    by_path.into_iter().filter_map(track).collect()
}

fn of_documents(files: &[File], reader: &mut Reader<'_>) -> bool {
    let name = shown(files);
    let mut tracks = tracks(files, reader);
    tree::call_after_files(&mut tracks, &name, role_of(&name, reader));
    let is_series = tracks.iter().any(|track| !track.is_still());
    reader.recording.tracks.extend(tracks);
    if is_series {
        return true;
    }
    let values = files.iter().filter_map(|file| {
        let fields = tree::fields(file.value()?);
        let has_alone = fields.poses.is_empty() && !fields.joints.is_empty();
        let number = file.number.or(fields.number);
        has_alone.then(|| joints::sample(single::place(&file.path), fields.image, number, fields.joints))
    });
    let series = joints::series(name, Vec::new(), None, values.collect());
    let series = series.filter(|series| 2 * series.samples.len() >= files.len());
    let is_series = series.is_some();
    reader.recording.joints.extend(series);
    is_series
}

fn of_texts(files: &[File], reader: &mut Reader<'_>) -> bool {
    let name = shown(files);
    let numbers = |file: &File| single::numbers(file.text()?);
    let rows = files.iter().filter_map(|file| Some((None, file.number, single::place(&file.path), numbers(file)?)));
    let rows = joints::unnamed(&name, rows).filter(|series| 2 * series.samples.len() >= files.len());
    reader.recording.rows.extend(rows);
    let of_files = files.iter().map(|file| (file.path.as_path(), file.number, numbers(file)));
    let tracks = single::tracks(&name, role_of(&name, reader), of_files);
    if !tracks.is_empty() {
        reader.recording.tracks.extend(tracks);
        return true;
    }
    // A file with several records is a series itself.
    let document = |file: &File| {
        let value = blocks::document(file.text()?).filter(|value| matches!(value, Value::Map(_)))?;
        Some(File { content: Content::Document(value), ..file.clone() })
    };
    let documents: Vec<File> = files.iter().filter_map(document).collect();
    2 * documents.len() >= files.len() && of_documents(&documents, reader)
}

fn of_arrays(files: &[File], reader: &mut Reader<'_>) -> bool {
    // Files of many poses are large, and are read separately.
    const LARGEST: u64 = 1 << 16;
    let one = |file: &File| {
        let path = reader.root.join(&file.path);
        if reader.budget.is_spent() || std::fs::metadata(&path).ok()?.len() > LARGEST {
            return None;
        }
        let value = npz::document(&folder::bytes(&path).ok()?, reader.budget)?;
        Some(File { content: Content::Document(value), ..file.clone() })
    };
    let documents: Vec<File> = files.iter().filter_map(one).collect();
    if 2 * documents.len() < files.len() {
        return false;
    }
    let name = shown(&documents);
    let numbers = |file: &File| file.value()?.numbers(single::MOST_NUMBERS);
    let of_files = documents.iter().map(|file| (file.path.as_path(), file.number, numbers(file)));
    let tracks = single::tracks(&name, role_of(&name, reader), of_files);
    let is_series = !tracks.is_empty();
    reader.recording.tracks.extend(tracks);
    is_series || of_documents(&documents, reader)
}

fn shown(files: &[File]) -> String {
    folder::shown(files.iter().map(|file| file.path.as_path()))
}

/// What poses in files of this name belong to: by the name, then by their folder, unless that is a folder of images.
fn role_of(files: &str, reader: &Reader<'_>) -> Role {
    let path = Path::new(files);
    let of = |name: &OsStr| tree::role_of_files(&name.to_string_lossy());
    let own = path.file_name().map_or(Role::Unknown, of);
    let has_images = || reader.recording.streams.iter().any(|stream| Path::new(&stream.name).parent() == path.parent());
    if own != Role::Unknown || has_images() {
        return own;
    }
    path.parent().and_then(Path::file_name).map_or(Role::Unknown, of)
}

/// The name of an image with its folder, where it is next to the file that names it.
fn next_to(root: &Path, file: &Path, image: String) -> String {
    let path = file.with_file_name(&image);
    if root.join(&path).is_file() { path.display().to_string() } else { image }
}
