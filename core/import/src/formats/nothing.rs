//! The report for a recording without a series of poses: what its files contain instead, and what to do.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::reader::{Reader, content};
use super::{Content, Encoding, File, of_ending};
use crate::folder;
use handeye_wording::Text;
use handeye_wording::text;

/// Most text files that are reported.
const MOST_REPORTED: usize = 5;
/// Most groups of files that are searched for those, and most bytes of one: the user waits for the answer.
const MOST_LOOKED_AT: usize = 200;
const LARGEST: u64 = 1 << 20;

/// Why nothing came of each of the files that are likeliest to have poses, and what to do with those that are not read.
pub(crate) fn reasons(reader: &Reader<'_>, files: &[PathBuf]) -> Vec<Text> {
    let mut stated: Vec<(Likely, Text)> = Vec::new();
    for members in folder::groups(files, true).iter().take(MOST_LOOKED_AT) {
        let Some((first, _)) = members.first().filter(|_| !reader.budget.is_spent()) else { continue };
        let Some((likely, why)) = reason(first, reader) else { continue };
        let shown = folder::shown(members.iter().map(|(file, _)| file.as_path()));
        let name = if members.len() == 1 { first.display().to_string() } else { shown };
        stated.push((likely, text!("{name} has {why}", name = name, why = why)));
    }
    stated.sort_by_key(|(likely, _)| *likely);
    let mut reasons: Vec<Text> = stated.into_iter().take(MOST_REPORTED).map(|(_, why)| why).collect();
    let not_read: BTreeMap<String, Text> =
        files.iter().filter_map(|file| not_read(file)).map(|why| (why.to_string(), why)).collect();
    reasons.extend(not_read.into_values());
    reasons
}

/// How likely a file was meant as poses.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Likely {
    Poses,
    Numbers,
    Neither,
}

/// Advice for a file of a format that is not read.
fn not_read(file: &Path) -> Option<Text> {
    Some(match folder::ending(file).as_str() {
        "mat" => text!("files of MATLAB (.mat) are not read: save the poses as csv, npz or json"),
        "pkl" | "pickle" => {
            text!("pickles (.pkl) are not read, as reading one runs it: save the poses as csv, npz or json")
        }
        "xls" | "xlsx" | "ods" => text!("spreadsheets are not read: save the sheet as csv"),
        "zdf" => text!("files of Zivid (.zdf) are not read: save the images as png and the poses as csv"),
        "h5" | "hdf5" => text!("files of HDF5 (.h5) are not read: save the poses as csv, npz or json"),
        _ => return None,
    })
}

/// What a file has in place of a series; `None` for one that is not of a format with poses.
fn reason(file: &Path, reader: &Reader<'_>) -> Option<(Likely, Text)> {
    let path = reader.root.join(file);
    let is_small = std::fs::metadata(&path).is_ok_and(|found| found.len() <= LARGEST);
    let (format, encoding) = of_ending(file).filter(|_| is_small)?;
    let content = match encoding {
        Encoding::Own | Encoding::Bag => Content::Unread,
        _ => match content(encoding, folder::text(&path).ok()?) {
            Ok(Some(content)) => content,
            Ok(None) => {
                let why = text!("nothing that is read as records: elements of one name with six numbers or more");
                return Some((Likely::Neither, why));
            }
            Err(why) => return Some((Likely::Numbers, text!("something else than its name says: {why}", why = why))),
        },
    };
    format.instead(&File { path: file.to_path_buf(), number: None, content }, reader)
}

#[cfg(test)]
mod tests {
    use crate::{Settings, Sights, judge, open};
    use handeye_geometry::progress::CancelToken;
    use std::fs;

    fn reported(files: &[(&str, &str)]) -> String {
        let folder = tempfile::tempdir().expect("a folder");
        for (name, text) in files {
            fs::write(folder.path().join(name), text).expect("written");
        }
        let recording = open(folder.path()).expect("a recording");
        judge(&recording, &Sights::default(), &Settings::default(), &CancelToken::default())
            .expect_err("no poses")
            .to_string()
    }

    #[test]
    fn every_file_that_was_looked_at_is_named_with_what_it_has() {
        let why = reported(&[
            ("corners.txt", "1 2 3\n4 5 6\n7 8 9\n1 1 1\n"),
            ("angles.csv", "1,2,3,4,5,6,7\n2,2,3,4,5,6,7\n2,2,3,4,5,6,8\n"),
            ("pose.json", r#"{"position": [1, 2, 3], "orientation": [0, 0, 0, 1]}"#),
            ("broken.yaml", "a: [1, 2\nb: }"),
            ("Notes.txt", "we took twenty images\n"),
            ("LICENSE", "all rights\n"),
            ("CMakeLists.txt", "project(x)\n"),
        ]);
        assert!(!why.contains("LICENSE"), "{why}");
        assert_eq!(why.matches(" has ").count(), 5, "{why}");
        for part in [
            "corners.txt has 4 rows of 3 numbers",
            "angles.csv has 3 rows of 7 numbers that are no poses: if they are joint values, name the arm",
            "pose.json has one pose, and three make a series",
            "broken.yaml has something else than its name says",
            "CMakeLists.txt has no rows of numbers",
        ] {
            assert!(why.contains(part), "{part}: {why}");
        }
    }

    #[test]
    fn at_most_five_are_named_and_formats_that_are_not_read_are_always() {
        let names: Vec<String> = "abcdefg".chars().map(|c| format!("{c}.txt")).collect();
        let mut files: Vec<(&str, &str)> = names.iter().map(|name| (name.as_str(), "nothing")).collect();
        files.extend([("poses.mat", "x"), ("poses.pkl", "x"), ("z.xlsx", "x")]);
        let why = reported(&files);
        assert_eq!(why.matches("no rows of numbers").count(), 5, "{why}");
        assert!(why.contains(".mat) are not read") && why.contains(".pkl) are not read"), "{why}");
        assert!(why.contains("csv, npz or json") && why.contains("spreadsheets"), "{why}");
    }
}
