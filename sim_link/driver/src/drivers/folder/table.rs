//! A pose table that grows.

use std::path::{Path, PathBuf};
use std::time::SystemTime;

use handeye_dataset::{PoseFormat, PoseOfImage};

/// A last line without an end counts once the file has been left alone for so long.
const REST_S: f64 = 1.0;
/// Longest table that is read.
const MOST_BYTES: u64 = 16 << 20;

/// The table as it was last read.
#[derive(Debug)]
pub(super) struct GrowingTable {
    path: PathBuf,
    stamp: Option<(u64, SystemTime)>,
    since_s: f64,
    is_read: bool,
    rows: Vec<PoseOfImage>,
}

impl GrowingTable {
    pub fn new(path: PathBuf) -> Self {
        Self { path, stamp: None, since_s: 0.0, is_read: false, rows: Vec::new() }
    }

    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Rows that are whole.
    pub fn rows(&self) -> &[PoseOfImage] {
        &self.rows
    }

    /// Reads it anew if it has changed.
    ///
    /// # Errors
    /// What is wrong with it, once for each change; the rows stay as they were.
    pub fn look(&mut self, format: &PoseFormat, now_s: f64) -> Result<(), String> {
        let Ok(metadata) = self.path.metadata() else { return Ok(()) };
        let stamp = metadata.modified().ok().map(|modified| (metadata.len(), modified));
        if stamp != self.stamp {
            (self.stamp, self.since_s, self.is_read) = (stamp, now_s, false);
        }
        let rests = now_s - self.since_s >= REST_S;
        // Once while it grows, and once when it rests: then its last line is whole, too.
        if self.is_read && !(rests && self.since_s.is_finite()) {
            return Ok(());
        }
        if rests {
            self.since_s = f64::INFINITY;
        }
        self.is_read = true;
        let fail = |why: String| format!("{}: {why}", self.path.display());
        if metadata.len() > MOST_BYTES {
            return Err(fail(format!("{} bytes, at most {MOST_BYTES} are read", metadata.len())));
        }
        let text = std::fs::read_to_string(&self.path).map_err(|error| fail(error.to_string()))?;
        let whole = if rests { text.len() } else { text.rfind('\n').map_or(0, |end| end + 1) };
        let text = &text[..whole];
        if text.lines().filter(|line| !line.trim().is_empty()).count() < 2 {
            self.rows.clear();
            return Ok(());
        }
        self.rows = format.rows(&self.path, text).map_err(|error| error.to_string())?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::io::Write as _;

    use super::*;

    #[test]
    fn a_row_counts_when_its_line_has_ended_or_the_table_rests() {
        let keys = "poses = \"poses.csv\"\nlength_unit = \"m\"\nrotation = \"rpy\"\nangle_unit = \"rad\"\npose = \"base_from_tip\"";
        let format = PoseFormat::parse(Path::new("options"), keys).expect("a format");
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("poses.csv");
        let mut table = GrowingTable::new(path.clone());
        let mut count = |now_s: f64| {
            table.look(&format, now_s).expect("a table");
            table.rows().len()
        };
        assert_eq!(count(0.0), 0, "there is none yet");
        let mut file = std::fs::File::create(&path).expect("a file");
        file.write_all(b"image,x,y,z,roll,pitch,yaw\n").expect("written");
        assert_eq!(count(1.0), 0);
        file.write_all(b"a.png,1,2,3,0,0,0\nb.png,1,2,3,0,0,1").expect("written");
        assert_eq!(count(1.1), 1, "the line of b.png may go on");
        file.write_all(b".5\n").expect("written");
        assert_eq!(count(1.2), 2);
        file.write_all(b"c.png,1,2,3,0,0,0").expect("written");
        assert_eq!(count(1.3), 2);
        assert_eq!(count(2.4), 3, "nobody has added to it for a second");
        file.write_all(b"\nd.png,1,2,three,0,0,0\n").expect("written");
        assert!(table.look(&format, 3.0).expect_err("no number").contains("three"));
        assert_eq!(table.look(&format, 3.1), Ok(()), "said once");
        assert_eq!(table.rows().len(), 3);
    }
}
