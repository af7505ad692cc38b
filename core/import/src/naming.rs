//! Names of files as the series that they are: what is the same in all of them, and the number that counts.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::folder::ending;

/// Files that make a series across folders.
const LEAST_FILES: usize = 3;

/// A name as its parts: what is the same in all files of a series, and the numbers.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Naming {
    folder: PathBuf,
    template: String,
    runs: usize,
}

impl Naming {
    /// The name without its numbers and without its folder.
    pub fn template(&self) -> &str {
        &self.template
    }

    /// The pattern for people: `#` means a number.
    pub fn shown(&self) -> String {
        self.folder.join(&self.template).display().to_string()
    }
}

/// A name with `#` in place of its numbers, and those.
fn template(name: &str) -> (String, Vec<u64>) {
    let (mut template, mut numbers) = (String::new(), Vec::new());
    let mut rest = name;
    while let Some(c) = rest.chars().next() {
        let digits = rest.bytes().take_while(u8::is_ascii_digit).count();
        if digits > 0 {
            // More digits than a number has are a hash, which counts nothing.
            numbers.push(rest[..digits].parse().unwrap_or(u64::MAX));
            template.push('#');
            rest = &rest[digits..];
        } else {
            template.push(c);
            rest = &rest[c.len_utf8()..];
        }
    }
    (template, numbers)
}

/// The naming of a file and the numbers in its name.
pub(super) fn naming(path: &Path, with_ending: bool) -> (Naming, Vec<u64>) {
    let (mut template, numbers) = template(&path.file_stem().unwrap_or_default().to_string_lossy());
    if with_ending {
        template.push('.');
        template.push_str(&ending(path));
    }
    let folder = path.parent().map(Path::to_path_buf).unwrap_or_default();
    (Naming { folder, template, runs: numbers.len() }, numbers)
}

/// The name pattern of a group of files, for people: `#` means a number, also in the names of their folders.
pub(super) fn shown<'a>(files: impl IntoIterator<Item = &'a Path>) -> String {
    let mut files = files.into_iter();
    let Some(first) = files.next() else { return String::new() };
    let (mut naming, _) = naming(first, true);
    if files.any(|file| file.parent() != first.parent())
        && let Some((folder, _)) = counting_folder(&naming.folder)
    {
        naming.folder = folder;
    }
    naming.shown()
}

/// A folder without the numbers in the deepest name that has some, and those numbers.
fn counting_folder(folder: &Path) -> Option<(PathBuf, Vec<u64>)> {
    let parts: Vec<_> = folder.components().map(|part| part.as_os_str().to_string_lossy().into_owned()).collect();
    let at = parts.iter().rposition(|part| part.bytes().any(|b| b.is_ascii_digit()))?;
    let (template, numbers) = template(parts.get(at)?);
    let part = |(i, part): (usize, &String)| if i == at { template.clone() } else { part.clone() };
    Some((parts.iter().enumerate().map(part).collect(), numbers))
}

/// A file of a group, and the numbers of its naming.
type Member = (PathBuf, Vec<u64>);

/// Files of one naming, each with the number that differs among them; `None` where none or several do. Files that are each
/// alone in a folder with a number, `view_07/pose.json`, are one group.
pub(super) fn groups(files: &[PathBuf], with_ending: bool) -> Vec<Vec<(PathBuf, Option<u64>)>> {
    let mut by_naming: BTreeMap<Naming, Vec<Member>> = BTreeMap::new();
    for file in files {
        let (naming, numbers) = naming(file, with_ending);
        by_naming.entry(naming).or_default().push((file.clone(), numbers));
    }
    across_folders(by_naming)
        .into_values()
        .map(|(of_folder, members)| {
            let counting = counting(&members, of_folder);
            members.into_iter().map(|(file, n)| (file, counting.and_then(|run| n.get(run).copied()))).collect()
        })
        .collect()
}

/// Groups with those that are one across folders, whose numbers come first; how many of them are those of folders.
fn across_folders(by_naming: BTreeMap<Naming, Vec<Member>>) -> BTreeMap<Naming, (usize, Vec<Member>)> {
    let mut out = BTreeMap::new();
    let mut across: BTreeMap<(Naming, usize), Vec<(Naming, Member)>> = BTreeMap::new();
    for (own, mut members) in by_naming {
        let counted = if members.len() == 1 { counting_folder(&own.folder) } else { None };
        match (counted, members.pop()) {
            (Some((folder, mut numbers)), Some((file, behind))) => {
                let of_folder = numbers.len();
                numbers.extend(behind);
                let naming = Naming { folder, template: own.template.clone(), runs: numbers.len() };
                across.entry((naming, of_folder)).or_default().push((own, (file, numbers)));
            }
            (None, Some(last)) => {
                members.push(last);
                out.insert(own, (0, members));
            }
            (_, None) => {}
        }
    }
    for ((naming, of_folder), members) in across {
        if members.len() >= LEAST_FILES {
            out.insert(naming, (of_folder, members.into_iter().map(|(_, member)| member).collect()));
        } else {
            for (own, (file, mut numbers)) in members {
                numbers.drain(..of_folder);
                out.insert(own, (0, vec![(file, numbers)]));
            }
        }
    }
    out
}

/// Which of the numbers of a group counts its files; the first `of_folder` are those of folders.
fn counting(members: &[Member], of_folder: usize) -> Option<usize> {
    let (_, first) = members.first()?;
    let differs = |run: &usize| members.iter().any(|(_, n)| n.get(*run) != first.get(*run));
    let varying: Vec<usize> = (0..first.len()).filter(differs).collect();
    // For a single file the last number is used, as most programs count at the end.
    let [run, others @ ..] = varying.as_slice() else { return first.len().checked_sub(1) };
    let is_same = |other: &usize| members.iter().all(|(_, n)| n.get(*other) == n.get(*run));
    // The number of a folder may be repeated in the name of its file, and the file may have one of its own.
    let is_of_folder = *run < of_folder && others.first().is_none_or(|next| *next >= of_folder);
    (is_of_folder || others.iter().all(is_same)).then_some(*run)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbers(names: &[&str]) -> Vec<Vec<(String, Option<u64>)>> {
        let files: Vec<PathBuf> = names.iter().map(PathBuf::from).collect();
        groups(&files, false)
            .into_iter()
            .map(|group| group.into_iter().map(|(path, n)| (path.display().to_string(), n)).collect())
            .collect()
    }

    #[test]
    fn the_number_that_counts_is_the_one_that_differs() {
        let found = numbers(&["cam0_3.png", "cam0_12.png", "other.png"]);
        assert_eq!(found[0], [("cam0_3.png".into(), Some(3)), ("cam0_12.png".into(), Some(12))]);
        assert_eq!(found[1], [("other.png".into(), None)]);
    }

    #[test]
    fn names_with_several_numbers_that_differ_count_nothing() {
        let found = numbers(&["10-01-55.png", "10-02-03.png"]);
        assert!(found[0].iter().all(|(_, number)| number.is_none()), "{found:?}");
    }
    #[test]
    fn files_that_are_alone_in_folders_that_count_are_one_series() {
        let found =
            numbers(&["a/view_07/pose.json", "a/view_7b/pose.json", "a/view_12/pose.json", "a/view_3/pose.json"]);
        assert_eq!(found.len(), 2, "{found:?}");
        let of_views = found.iter().find(|group| group.len() == 3).expect("a group");
        assert_eq!(of_views.iter().map(|(_, n)| *n).collect::<Vec<_>>(), [Some(7), Some(12), Some(3)]);
        let names = ["a/view_07/pose.json", "a/view_12/pose.json"].map(Path::new);
        assert_eq!(shown(names), "a/view_#/pose.json");
        // The number again, and another one, in the name of the file.
        let again = numbers(&["v1/image_1.png", "v2/image_2.png", "v5/image_5.png"]);
        assert_eq!(again[0].iter().map(|(_, n)| *n).collect::<Vec<_>>(), [Some(1), Some(2), Some(5)]);
        let stamped = numbers(&["v1/image_1002.png", "v2/image_1007.png", "v5/image_1023.png"]);
        assert_eq!(stamped[0].iter().map(|(_, n)| *n).collect::<Vec<_>>(), [Some(1), Some(2), Some(5)]);
    }

    #[test]
    fn two_folders_and_folders_with_series_of_their_own_stay_apart() {
        assert_eq!(numbers(&["day1/poses.csv", "day2/poses.csv"]).len(), 2);
        let found = numbers(&["1/a1.png", "1/a2.png", "2/a1.png", "2/a2.png", "3/a1.png", "3/a2.png"]);
        assert_eq!(found.len(), 3, "{found:?}");
    }
}
