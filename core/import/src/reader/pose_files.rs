//! Recordings that have a file to a pose.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::Reader;
use crate::folder;
use crate::formats::{blocks, joints, npz, single, tree, visp};
use crate::recording::{Role, Sample, Stated};
use crate::value::Value;

impl Reader<'_> {
    /// A pose to a file; whether it is so.
    pub(super) fn one_to_a_file(&mut self, read: &[(PathBuf, Option<u64>, Value)]) -> bool {
        // Files that are each a series have first poses, which are none together.
        let is_series = |value: &Value| tree::series(value, "").iter().any(|track| !track.is_still());
        let are_series = read.iter().filter(|(.., value)| is_series(value)).count() * 2 > read.len();
        let are_vectors = read.iter().filter(|(.., value)| visp::is_pose(value)).count() * 2 > read.len();
        let mut by_path: Vec<(String, Stated, Vec<Sample>)> = Vec::new();
        for (file, number, value) in read {
            let fields = tree::fields(value);
            let image = fields.image.map(|image| self.beside(file, image));
            for (path, numbers, stated) in fields.poses {
                if are_series && (path.contains('[') || path.ends_with(|c: char| c.is_ascii_digit())) {
                    continue;
                }
                let sample = Sample {
                    image: image.clone(),
                    number: number.or(fields.number),
                    place: Arc::new(single::place(file)),
                    numbers,
                    joints: fields.joints.clone(),
                };
                match by_path.iter_mut().find(|(known, ..)| *known == path) {
                    Some((.., samples)) => samples.push(sample),
                    None => by_path.push((path, stated, vec![sample])),
                }
            }
        }
        let files = folder::shown(read.iter().map(|(file, ..)| file.as_path()));
        let before = self.recording.tracks.len();
        for (path, stated, mut samples) in by_path {
            if 2 * samples.len() < read.len() {
                continue;
            }
            samples
                .sort_by(|a, b| handeye_geometry::natural_order::compare(&a.place.to_string(), &b.place.to_string()));
            let Some(mut track) = tree::track(tree::track_name(&files, &path), &path, stated, samples) else {
                continue;
            };
            if are_vectors {
                visp::know(&mut track);
            }
            self.recording.tracks.push(track);
        }
        if !are_vectors {
            let role = self.role_of(&files);
            let found = self.recording.tracks.get_mut(before..).unwrap_or_default();
            tree::call_after_files(found, &files, role);
        }
        if self.recording.tracks[before..].iter().any(|track| !track.is_still()) {
            return true;
        }
        let values = read.iter().filter_map(|(file, number, value)| {
            let fields = tree::fields(value);
            let has_alone = fields.poses.is_empty() && !fields.joints.is_empty();
            has_alone
                .then(|| joints::sample(single::place(file), fields.image, number.or(fields.number), fields.joints))
        });
        let values: Vec<_> = values.collect();
        let series =
            joints::series(files, Vec::new(), None, values).filter(|series| 2 * series.samples.len() >= read.len());
        let is_series = series.is_some();
        self.recording.joints.extend(series);
        is_series
    }

    /// What poses in files of this name are of: by the name, then by their folder, unless that is one of images.
    fn role_of(&self, files: &str) -> Role {
        let path = Path::new(files);
        let of = |name: &OsStr| tree::role_of_files(&name.to_string_lossy());
        let own = path.file_name().map_or(Role::Unknown, of);
        let has_images =
            || self.recording.streams.iter().any(|stream| Path::new(&stream.name).parent() == path.parent());
        if own != Role::Unknown || has_images() {
            return own;
        }
        path.parent().and_then(Path::file_name).map_or(Role::Unknown, of)
    }

    /// The name of an image with its folder, where it lies beside the file that names it.
    fn beside(&self, file: &Path, image: String) -> String {
        let path = file.with_file_name(&image);
        if self.root.join(&path).is_file() { path.display().to_string() } else { image }
    }

    /// A pose to a file of text; whether it is so.
    pub(super) fn one_pose_to_a_text(&mut self, texts: &[(PathBuf, Option<u64>, String)]) -> bool {
        let name = folder::shown(texts.iter().map(|(file, ..)| file.as_path()));
        let rows = texts
            .iter()
            .filter_map(|(file, number, text)| Some((None, *number, single::place(file), single::numbers(text)?)));
        let rows = joints::unnamed(&name, rows).filter(|series| 2 * series.samples.len() >= texts.len());
        self.recording.rows.extend(rows);
        let tracks = single::texts(&name, self.role_of(&name), texts);
        if !tracks.is_empty() {
            self.recording.tracks.extend(tracks);
            return true;
        }
        // Of several records a file is a series itself.
        let values = texts.iter().filter_map(|(file, number, text)| {
            let value = blocks::document(text).filter(|value| matches!(value, Value::Map(_)))?;
            Some((file.clone(), *number, value))
        });
        let values: Vec<_> = values.collect();
        2 * values.len() >= texts.len() && self.one_to_a_file(&values)
    }

    /// A pose to a file of NumPy; whether it is so.
    pub(super) fn one_pose_to_an_array(&mut self, members: &[(PathBuf, Option<u64>)]) -> bool {
        // Files of many poses are large, and looked at by themselves.
        const LARGEST: u64 = 1 << 16;
        let one = |(file, number): &'_ (PathBuf, Option<u64>)| {
            let path = self.root.join(file);
            if self.budget.is_spent() || std::fs::metadata(&path).ok()?.len() > LARGEST {
                return None;
            }
            Some((file.clone(), *number, npz::document(&folder::bytes(&path).ok()?, self.budget)?))
        };
        let read: Vec<(PathBuf, Option<u64>, Value)> = members.iter().filter_map(one).collect();
        if 2 * read.len() < members.len() {
            return false;
        }
        let name = folder::shown(read.iter().map(|(file, ..)| file.as_path()));
        let numbers = |value: &Value| value.numbers(single::MOST_NUMBERS);
        let files = read.iter().map(|(file, number, value)| (file.as_path(), *number, numbers(value)));
        let tracks = single::tracks(&name, self.role_of(&name), files);
        let is_so = !tracks.is_empty();
        self.recording.tracks.extend(tracks);
        is_so || self.one_to_a_file(&read)
    }
}
