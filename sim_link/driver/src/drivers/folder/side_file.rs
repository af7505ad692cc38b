//! A pose in a file beside its image: of the same name, ending in `.json`, `.csv` or `.txt`.

use std::path::{Path, PathBuf};

use handeye_dataset::{PoseFormat, PoseOfImage};
use serde_json::Value;

/// Endings, in the order in which they are looked for.
const ENDINGS: [&str; 3] = ["json", "csv", "txt"];
/// A pose is short; this is no pose.
const MOST_BYTES: u64 = 1 << 20;

/// The file beside an image, if there is one.
pub(super) fn beside(image: &Path) -> Option<PathBuf> {
    ENDINGS.iter().map(|ending| image.with_extension(ending)).find(|path| path.is_file())
}

/// The pose in it.
///
/// # Errors
/// What is wrong with it, naming the file.
pub(super) fn read(path: &Path, format: &PoseFormat) -> Result<PoseOfImage, String> {
    let fail = |why: String| format!("{}: {why}", path.display());
    let length = path.metadata().map_err(|error| fail(error.to_string()))?.len();
    if length > MOST_BYTES {
        return Err(fail(format!("{length} bytes, more than a pose has")));
    }
    let text = std::fs::read_to_string(path).map_err(|error| fail(error.to_string()))?;
    let columns = format.columns();
    let columns = columns.get(1..).unwrap_or_default();
    let cells = if path.extension().is_some_and(|ending| ending == "json") {
        of_json(&text, columns)
    } else {
        of_text(&text, columns)
    }
    .map_err(fail)?;
    // The same reader as for tables, so that there is one place that knows conventions.
    let table = format!("image,{}\nimage,{}\n", columns.join(","), cells.join(","));
    let mut rows = format.rows(path, &table).map_err(|error| error.to_string())?;
    rows.pop().ok_or_else(|| fail("it has no pose".into()))
}

/// A list of numbers in the order of the columns, or an object with the columns as keys.
fn of_json(text: &str, columns: &[&str]) -> Result<Vec<String>, String> {
    let value: Value = serde_json::from_str(text).map_err(|error| error.to_string())?;
    let cells: Vec<&Value> = match &value {
        Value::Array(list) if list.len() == columns.len() => list.iter().collect(),
        Value::Array(list) => return Err(wrong_count(list.len(), columns)),
        Value::Object(object) => {
            let cell = |column: &&str| {
                object.get(*column).ok_or_else(|| format!("it has no {column:?}; needed are {}", columns.join(", ")))
            };
            columns.iter().map(cell).collect::<Result<_, _>>()?
        }
        _ => return Err("neither a list of numbers nor an object".into()),
    };
    let number =
        |cell: &Value| cell.as_f64().map(|number| number.to_string()).ok_or_else(|| format!("{cell} is not a number"));
    cells.into_iter().map(number).collect()
}

/// One row of numbers between commas, semicolons or spaces, with the columns above it or without.
fn of_text(text: &str, columns: &[&str]) -> Result<Vec<String>, String> {
    let split = |line: &str| -> Vec<String> {
        let cells = line.split(|c: char| c == ',' || c == ';' || c.is_whitespace());
        cells.filter(|cell| !cell.is_empty()).map(str::to_owned).collect()
    };
    let lines: Vec<_> = text.lines().map(split).filter(|cells| !cells.is_empty()).collect();
    let row = match lines.as_slice() {
        [row] => row,
        [header, row] if header.iter().map(String::as_str).eq(columns.iter().copied()) => row,
        [header, _] => return Err(format!("its columns are {}, needed are {}", header.join(", "), columns.join(", "))),
        lines => return Err(format!("{} rows, where one pose is needed", lines.len())),
    };
    if row.len() == columns.len() { Ok(row.clone()) } else { Err(wrong_count(row.len(), columns)) }
}

fn wrong_count(got: usize, columns: &[&str]) -> String {
    format!("{got} numbers, where {} are needed: {}", columns.len(), columns.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn format() -> PoseFormat {
        let keys =
            "poses = \"poses.csv\"\nlength_unit = \"m\"\nrotation = \"quaternion_xyzw\"\npose = \"base_from_tip\"";
        PoseFormat::parse(Path::new("options"), keys).expect("a format")
    }

    #[test]
    fn a_pose_is_read_from_each_kind_of_file_and_a_wrong_one_is_named() {
        let folder = tempfile::tempdir().expect("a folder");
        let read_text = |name: &str, text: &str| {
            let path = folder.path().join(name);
            std::fs::write(&path, text).expect("written");
            read(&path, &format())
        };
        for (name, text) in [
            ("a.json", "[0.1, 0.2, 0.3, 0, 0, 0, 1]"),
            ("b.json", r#"{"x":0.1,"y":0.2,"z":0.3,"qx":0,"qy":0,"qz":0,"qw":1,"note":"by hand"}"#),
            ("c.txt", "0.1 0.2 0.3 0 0 0 1\n"),
            ("d.csv", "x,y,z,qx,qy,qz,qw\n0.1,0.2,0.3,0,0,0,1\n"),
        ] {
            let pose = read_text(name, text).unwrap_or_else(|why| panic!("{name}: {why}")).base_from_tip;
            assert_eq!(pose.translation().as_slice(), [0.1, 0.2, 0.3], "{name}");
        }
        for (name, text, expected) in [
            ("e.json", "[0.1, 0.2, 0.3, 0, 0, 1]", "6 numbers, where 7 are needed: x, y, z, qx, qy, qz, qw"),
            ("f.json", r#"{"x":0.1}"#, "it has no \"y\""),
            ("g.txt", "0.1 0.2 0.3 0 0 0 2\n", "length"),
            ("h.csv", "x,y,z,qw,qx,qy,qz\n0.1,0.2,0.3,1,0,0,0\n", "its columns are x, y, z, qw"),
            ("i.txt", "", "0 rows"),
        ] {
            let why = read_text(name, text).expect_err(name);
            assert!(why.contains(expected) && why.contains(name), "{why}");
        }
        assert_eq!(beside(&folder.path().join("c.png")), Some(folder.path().join("c.txt")));
        assert_eq!(beside(&folder.path().join("z.png")), None);
    }
}
