//! The recorded sample that comes with the program (assets/samples/README.md), embedded in the binary, so that it is always
//! available.

use std::path::Path;
use std::{fs, io};

/// Name of the session that is made from the sample.
pub const NAME: &str = "sample";

macro_rules! files {
    ($($name:literal),* $(,)?) => {
        &[$(($name, include_bytes!(concat!("../../../assets/samples/ur5/", $name)))),*]
    };
}

/// The files of its data set folder.
const FILES: &[(&str, &[u8])] = files![
    "dataset.toml",
    "poses.csv",
    "images/01.jpg",
    "images/02.jpg",
    "images/03.jpg",
    "images/04.jpg",
    "images/05.jpg",
    "images/06.jpg",
    "images/07.jpg",
    "images/08.jpg",
    "images/09.jpg",
    "images/10.jpg",
    "images/11.jpg",
    "images/12.jpg",
];

/// Writes it as a data set folder.
///
/// # Errors
/// When a folder or a file cannot be written.
pub fn write(folder: &Path) -> io::Result<()> {
    fs::create_dir_all(folder.join("images"))?;
    FILES.iter().try_for_each(|(name, bytes)| fs::write(folder.join(name), bytes))
}

#[cfg(test)]
mod tests {
    use handeye_dataset::Dataset;
    use handeye_files::bounds::Bounds;

    use super::*;

    #[test]
    fn all_that_the_sample_names_is_in_the_program() {
        let home = tempfile::tempdir().expect("a folder");
        write(home.path()).expect("written");
        let dataset = Dataset::read_within(home.path(), &Bounds::within(home.path())).expect("a data set");
        assert_eq!(dataset.entries.len(), 12);
        for entry in &dataset.entries {
            assert!(entry.base_from_tip.is_some(), "{}", entry.name);
            let image = dataset.load_rgb(entry).expect("an image");
            assert_eq!(image.dimensions(), (640, 480), "{}", entry.name);
        }
        let kept =
            fs::read_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/../../assets/samples/ur5/images")).expect("images");
        assert_eq!(kept.count(), 12, "no image is there that nobody is given");
    }
}
