//! Which image belongs to which pose: every rule that the names and the order allow, as candidates.

use std::collections::BTreeMap;
use std::path::Path;

use super::folder;
use super::recording::{ImageFile, Sample};
use handeye_estimate::diagnose::hypotheses::pairing::{Order, along};

/// A rule, and the pairs that follow from it.
#[derive(Debug, Clone, PartialEq)]
pub struct Pairing {
    /// Value of `--set pairing=`.
    pub rule: String,
    /// It in words.
    pub text: String,
    /// The image of each pose.
    pub image_of: Vec<Option<usize>>,
    /// Found from the images themselves, not from names or order.
    pub is_by_content: bool,
}

impl Pairing {
    fn new(rule: impl Into<String>, text: impl Into<String>, image_of: Vec<Option<usize>>) -> Self {
        Self { rule: rule.into(), text: text.into(), image_of, is_by_content: false }
    }

    /// Poses that have an image.
    pub(crate) fn count(&self) -> usize {
        self.image_of.iter().flatten().count()
    }

    /// Images that no pose has.
    pub(crate) fn without_pose(&self, images: usize) -> Vec<usize> {
        (0..images).filter(|image| !self.image_of.contains(&Some(*image))).collect()
    }
}

/// Every pairing that names, numbers and order allow and that gives at least `need` pairs and half of those that the most
/// give, the most explicit first; what is the same under two rules is listed once, with both in words.
pub(super) fn pairings(samples: &[Sample], images: &[ImageFile], need: usize) -> Vec<Pairing> {
    let mut all = Vec::new();
    all.extend(by_name(samples, images));
    all.extend(by_number(samples, images));
    all.extend(by_order(samples, images));
    let mut out: Vec<Pairing> = Vec::new();
    // A rule that pairs few of those that another one pairs fits by its few.
    let most = all.iter().map(Pairing::count).max().unwrap_or(0);
    for pairing in all.into_iter().filter(|pairing| pairing.count() >= need && 2 * pairing.count() >= most) {
        match out.iter_mut().find(|known| known.image_of == pairing.image_of) {
            Some(known) => known.text = format!("{} = {}", known.text, pairing.text),
            None => out.push(pairing),
        }
    }
    out
}

/// Images by a key; a key of two images that are not copies of each other belongs to neither.
fn keyed<K: Ord>(images: &[ImageFile], key: impl Fn(&ImageFile) -> Option<K>) -> BTreeMap<K, Option<usize>> {
    let mut map: BTreeMap<K, Option<usize>> = BTreeMap::new();
    for (i, image) in images.iter().enumerate() {
        let Some(key) = key(image) else { continue };
        let value = match map.get(&key) {
            None => Some(i),
            Some(Some(first)) if image.same_as == Some(*first) => Some(*first),
            Some(_) => None,
        };
        map.insert(key, value);
    }
    map
}

/// An image belongs to one pose. Of two poses that claim it the first gets it when both are equal, and neither
/// otherwise.
fn settled(samples: &[Sample], mut image_of: Vec<Option<usize>>) -> Vec<Option<usize>> {
    let mut claimed: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for (sample, image) in image_of.iter().enumerate() {
        if let Some(image) = image {
            claimed.entry(*image).or_default().push(sample);
        }
    }
    for who in claimed.into_values().filter(|who| who.len() > 1) {
        let all_equal = who.iter().all(|s| samples[*s].numbers == samples[who[0]].numbers);
        for sample in who.into_iter().skip(usize::from(all_equal)) {
            image_of[sample] = None;
        }
    }
    image_of
}

fn lower(path: &str) -> String {
    path.trim().replace('\\', "/").to_lowercase()
}

fn by_name(samples: &[Sample], images: &[ImageFile]) -> Vec<Pairing> {
    let name = |path: &Path| path.file_name().map(|n| lower(&n.to_string_lossy()));
    let stem = |path: &Path| path.file_stem().map(|n| lower(&n.to_string_lossy()));
    let by_path = keyed(images, |image| Some(lower(&image.path.to_string_lossy())));
    let by_file = keyed(images, |image| name(&image.path));
    let by_stem = keyed(images, |image| stem(&image.path));
    // Numbers may have been filled up with zeros since.
    let counted = |path: &Path| {
        let (naming, numbers) = folder::naming(path, false);
        (!numbers.is_empty()).then(|| (lower(naming.template()), numbers))
    };
    let by_counting = keyed(images, |image| counted(&image.path));
    let find = |text: &str| -> Option<usize> {
        let path = lower(text);
        let found = by_path.get(&path).or_else(|| by_file.get(&name(Path::new(&path))?));
        // A name with another ending may have been converted since; one without an ending is a stem.
        let found = found.or_else(|| by_stem.get(&stem(Path::new(&path))?)).or_else(|| by_stem.get(&path));
        found.or_else(|| by_counting.get(&counted(Path::new(&path))?)).copied().flatten()
    };
    let mut out = Vec::new();
    if samples.iter().any(|sample| sample.image.is_some()) {
        let image_of = samples.iter().map(|sample| sample.image.as_deref().and_then(find)).collect();
        out.push(Pairing::new("name", "by the names of images that stand with the poses", settled(samples, image_of)));
    }
    // A file of a pose and an image of the same name.
    let of_file = |sample: &Sample| by_stem.get(&stem(Path::new(&sample.place.to_string()))?).copied().flatten();
    let image_of: Vec<_> = samples.iter().map(of_file).collect();
    if image_of.iter().any(Option::is_some) {
        out.push(Pairing::new("file", "by the names of files", settled(samples, image_of)));
    }
    out
}

fn by_number(samples: &[Sample], images: &[ImageFile]) -> Vec<Pairing> {
    let by_number = keyed(images, |image| image.number);
    let Some(first_image) = by_number.keys().next().copied() else { return Vec::new() };
    let at = |numbers: &[Option<u64>], offset: i128| -> Vec<Option<usize>> {
        let of = |number: &Option<u64>| {
            let number = u64::try_from(i128::from((*number)?) + offset).ok()?;
            by_number.get(&number).copied().flatten()
        };
        settled(samples, numbers.iter().map(of).collect())
    };
    let mut out = Vec::new();
    let stated: Vec<Option<u64>> = samples.iter().map(|sample| sample.number).collect();
    let rows: Vec<Option<u64>> = (0..samples.len() as u64).map(Some).collect();
    if let Some(first_stated) = stated.iter().flatten().min() {
        out.push(Pairing::new("number", "by number", at(&stated, 0)));
        let offset = i128::from(first_image) - i128::from(*first_stated);
        for (offset, text) in [
            (offset, "by number, counted from the first of each"),
            (1, "by number, images counted one further"),
            (-1, "by number, images counted one less"),
        ] {
            if offset != 0 {
                out.push(Pairing::new(format!("number{offset:+}"), text, at(&stated, offset)));
            }
        }
    }
    for (offset, text) in [
        (i128::from(first_image), "by number, the first row being the first image"),
        (0, "by number, rows counted from 0"),
        (1, "by number, rows counted from 1"),
    ] {
        out.push(Pairing::new(format!("row{offset:+}"), text, at(&rows, offset)));
    }
    out
}

fn by_order(samples: &[Sample], images: &[ImageFile]) -> Vec<Pairing> {
    let (poses, count) = (samples.len(), images.len());
    let names: Vec<String> = images.iter().map(ImageFile::shown).collect();
    let (natural, letters) = (Order::ByNumber.sorted(&names), Order::ByLetters.sorted(&names));
    let in_order = |order: &[usize], further: isize| (0..poses).map(|pose| along(order, pose, further)).collect();
    let mut out = vec![Pairing::new("order", "in order, images counted as people count", in_order(&natural, 0))];
    if count != poses {
        let from_end = in_order(&natural, count as isize - poses as isize);
        out.push(Pairing::new("order_from_end", "in order from the last one back", from_end));
    }
    if letters != natural {
        let by_letters = in_order(&letters, 0);
        out.push(Pairing::new("letters", "in order, images sorted letter by letter (1, 10, 2)", by_letters));
        // The table was written in that order while the images were not.
        if poses == count {
            let ranks = Order::ByLetters.ranks(&names);
            let image_of = natural.iter().map(|image| natural.get(ranks[*image]).copied()).collect();
            out.push(Pairing::new("letters_of_rows", "in order, rows sorted letter by letter (1, 10, 2)", image_of));
        }
    }
    out
}

/// The pairing in order with gaps that was found by what fits.
pub(super) fn by_content(image_of: Vec<Option<usize>>) -> Pairing {
    let text = "in order, with gaps where the images show them";
    Pairing { is_by_content: true, ..Pairing::new("aligned", text, image_of) }
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;
    use std::sync::Arc;

    use super::*;
    use crate::recording::Numbers;
    use handeye_wording::text;

    fn images(names: &[&str]) -> Vec<ImageFile> {
        let number = |name: &str| name.chars().filter(char::is_ascii_digit).collect::<String>().parse().ok();
        names
            .iter()
            .map(|n| ImageFile { path: PathBuf::from(n), number: number(n), same_as: None, stamp_ns: None })
            .collect()
    }

    fn rows(count: usize) -> Vec<Sample> {
        let row = |i: usize| Sample {
            image: None,
            number: None,
            place: Arc::new(text!("{file}, row {row}", file = "poses.txt", row = i + 1)),
            numbers: Numbers::Angles([i as f64, 0.0, 0.0, 0.0, 0.0, 0.0]),
            joints: Vec::new(),
        };
        (0..count).map(row).collect()
    }

    fn of<'a>(all: &'a [Pairing], rule: &str) -> &'a [Option<usize>] {
        &all.iter().find(|p| p.rule == rule).unwrap_or_else(|| panic!("{rule} in {all:?}")).image_of
    }

    #[test]
    fn gaps_in_the_numbers_make_number_and_order_two_different_pairings() {
        let images = images(&["2.png", "3.png", "5.png", "6.png"]);
        let all = pairings(&rows(5), &images, 3);
        assert_eq!(of(&all, "row+2"), [Some(0), Some(1), None, Some(2), Some(3)]);
        assert_eq!(of(&all, "order"), [Some(0), Some(1), Some(2), Some(3), None]);
        assert_eq!(of(&all, "order_from_end"), [None, Some(0), Some(1), Some(2), Some(3)]);
    }

    #[test]
    fn what_is_the_same_under_two_rules_is_listed_once() {
        let all = pairings(&rows(3), &images(&["0.png", "1.png", "2.png"]), 3);
        assert_eq!(all.len(), 1, "{all:?}");
        assert!(all[0].text.contains(" = "), "{}", all[0].text);
    }

    #[test]
    fn a_name_in_the_table_is_found_whatever_folder_and_ending_it_had() {
        let mut samples = rows(3);
        for (sample, name) in samples.iter_mut().zip(["C:\\data\\B.PNG", "c", "sub/a.bmp"]) {
            sample.image = Some(name.into());
        }
        let all = pairings(&samples, &images(&["sub/a.png", "sub/b.png", "sub/c.png"]), 3);
        assert_eq!(of(&all, "name"), [Some(1), Some(2), Some(0)]);
    }

    #[test]
    fn an_image_that_two_different_poses_claim_belongs_to_neither() {
        let mut samples = rows(4);
        for (sample, name) in samples.iter_mut().zip(["a.png", "b.png", "a.png", "c.png"]) {
            sample.image = Some(name.into());
        }
        let all = pairings(&samples, &images(&["a.png", "b.png", "c.png"]), 2);
        assert_eq!(of(&all, "name"), [None, Some(1), None, Some(2)]);
        samples[2].numbers = samples[0].numbers;
        let all = pairings(&samples, &images(&["a.png", "b.png", "c.png"]), 2);
        assert_eq!(of(&all, "name"), [Some(0), Some(1), None, Some(2)], "the same pose twice");
    }
}
