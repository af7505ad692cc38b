//! The surroundings of an arm, in a file written by hand; its keys are in `docs/reference/surroundings.md`.

use std::error::Error;
use std::path::{Path, PathBuf};
use std::{fmt, fs};

use nalgebra::{Isometry3, Point3, Quaternion, Translation3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

use super::{Obstacle, SpeedLimits, Surroundings, WorkVolume};
use handeye_wording::text;
use handeye_wording::{English, Text};

/// Tolerance of the length of a quaternion, as in dataset folders.
const UNIT_TOLERANCE: f64 = 1e-3;
/// A longer length \[m\] is taken for millimetres: no supported arm reaches that far.
const FARTHEST_M: f64 = 10.0;
/// Faster \[m/s\] than any arm: millimetres per second.
const FASTEST_M_S: f64 = 20.0;

/// What is wrong with a file of surroundings, in one line.
#[derive(Debug, thiserror::Error, handeye_wording::Localized)]
#[non_exhaustive]
pub enum SurroundingsError {
    /// The file system cannot read it.
    #[error("{file} cannot be read: {source}", file = file.display())]
    Unreadable {
        /// The file that could not be read.
        file: PathBuf,
        /// The reason.
        source: std::io::Error,
    },
    /// Not TOML, or an unknown or missing key.
    #[error("{file}: {message}", file = file.display())]
    Syntax {
        /// The file.
        file: PathBuf,
        /// The parser's message, with the line.
        message: String,
    },
    /// A value that is not valid.
    #[error("{file}, {entry}", file = file.display(), entry = entry.with_fault(fault))]
    Entry {
        /// The file.
        file: PathBuf,
        /// The entry.
        entry: EntryName,
        /// What is wrong.
        fault: EntryFault,
    },
}

/// What is wrong with an entry.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum EntryFault {
    /// A number that is not finite.
    NotFinite {
        /// The key of the entry.
        key: &'static str,
    },
    /// An edge without a positive length.
    Size {
        /// The edge.
        value: f64,
    },
    /// Farther than any arm reaches.
    Millimetres {
        /// The key of the entry.
        key: &'static str,
        /// The number as written in the file.
        value: f64,
    },
    /// A quaternion of another length.
    NotUnit {
        /// Its length.
        norm: f64,
    },
    /// A box that has both `rotation_xyzw` and `yaw_deg`.
    TwoRotations,
    /// A volume without room.
    InsideOut {
        /// The axis whose limits are the wrong way round.
        axis: char,
    },
    /// A value that is not a valid speed.
    Speed {
        /// The key of the entry.
        key: &'static str,
        /// The number as written in the file.
        value: f64,
    },
    /// A tip faster than any arm.
    MillimetresPerSecond {
        /// The number as written in the file.
        value: f64,
    },
    /// An entry without a name.
    NoName,
    /// Two boxes of one name.
    SameName,
}

impl EntryFault {
    /// The fault in a sentence without its subject, with what to do.
    pub(crate) fn text(&self) -> Text {
        match self {
            Self::NotFinite { key } => text!("{key} is not finite", key = key),
            Self::Size { value } => {
                text!("size_m has the edge {value} m: give the whole length of each edge, above 0", value = value)
            }
            Self::Millimetres { key, value } => {
                text!(
                    "{key} has {value} m: lengths are metres here; divide millimetres by 1000",
                    key = key,
                    value = value
                )
            }
            Self::NotUnit { norm } => {
                text!("rotation_xyzw has the length {norm}: give a unit quaternion, x y z w", norm = norm)
            }
            Self::TwoRotations => text!("has both rotation_xyzw and yaw_deg: give one of them"),
            Self::InsideOut { axis } => text!(
                "min_m is not below max_m along {axis}: min_m is the corner with the smallest coordinates",
                axis = axis
            ),
            Self::Speed { key, value } => text!("{key} is {value}: give a speed above 0", key = key, value = value),
            Self::MillimetresPerSecond { value } => text!(
                "tip_speed_m_s is {value}: speeds of the tip are metres per second here; divide millimetres by 1000",
                value = value
            ),
            Self::NoName => text!("name is empty: it says in messages what is in the way"),
            Self::SameName => text!("an earlier box has the same name: names tell boxes apart in messages"),
        }
    }
}

impl fmt::Display for EntryFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text().in_language(English))
    }
}

impl Error for EntryFault {}

/// An entry of a file, as messages name it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum EntryName {
    /// A box of `[[box]]`.
    Box {
        /// Counted from 1.
        number: usize,
        /// Its name.
        name: String,
    },
    /// Any other table, by its name.
    Table(&'static str),
}

impl fmt::Display for EntryName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Box { number, name } => write!(f, "box {number} {name:?}"),
            Self::Table(table) => f.write_str(table),
        }
    }
}

impl EntryName {
    /// The entry and what is wrong with it, without the file.
    pub fn with_fault(&self, fault: &EntryFault) -> Text {
        match self {
            Self::Box { number, name } => {
                text!("Box {number} “{name}”: {fault}", number = number, name = name, fault = fault.text())
            }
            Self::Table(table) => text!("{table}: {fault}", table = table, fault = fault.text()),
        }
    }
}

/// The content of a file of surroundings, in its own units; [`Self::surroundings`] converts it.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KeepOutFile {
    /// What must not be touched.
    #[serde(default, rename = "box", skip_serializing_if = "Vec::is_empty")]
    pub boxes: Vec<KeepOutBox>,
    /// The volume in which tip and camera have to stay.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub volume: Option<KeepInVolume>,
    /// Limits of speed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub limits: Option<KeepBelow>,
}

/// A box of a file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KeepOutBox {
    /// Its name in messages, unique in the file.
    pub name: String,
    /// Its middle in the base, metres.
    pub centre_m: [f64; 3],
    /// Whole edges, metres.
    pub size_m: [f64; 3],
    /// Any rotation, a unit quaternion; not together with `yaw_deg`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rotation_xyzw: Option<[f64; 4]>,
    /// Rotation about z of the base, degrees.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub yaw_deg: Option<f64>,
}

/// The work volume of a file: a box along the axes of the base.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KeepInVolume {
    /// The corner with the smallest coordinates, metres.
    pub min_m: [f64; 3],
    /// The corner with the largest coordinates, metres.
    pub max_m: [f64; 3],
}

/// The limits of speed of a file.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KeepBelow {
    /// Largest speed of the tip, m/s.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tip_speed_m_s: Option<f64>,
    /// Largest speed of every revolute joint, degrees/s.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub joint_speed_deg_s: Option<f64>,
}

impl Surroundings {
    /// Reads a file.
    ///
    /// # Errors
    /// [`SurroundingsError`] names the file and the entry.
    pub fn read(file: &Path) -> Result<Self, SurroundingsError> {
        KeepOutFile::read(file)?.surroundings(file)
    }
}

impl KeepOutFile {
    /// Reads a file.
    ///
    /// # Errors
    /// [`SurroundingsError::Unreadable`] and [`SurroundingsError::Syntax`]; the values are not checked.
    pub fn read(file: &Path) -> Result<Self, SurroundingsError> {
        let text = fs::read_to_string(file)
            .map_err(|source| SurroundingsError::Unreadable { file: file.to_owned(), source })?;
        Self::parse(file, &text)
    }

    /// Parses the text of a file; its name is for messages.
    ///
    /// # Errors
    /// [`SurroundingsError::Syntax`].
    pub(crate) fn parse(file: &Path, text: &str) -> Result<Self, SurroundingsError> {
        toml::from_str(text).map_err(|error| SurroundingsError::Syntax {
            file: file.to_owned(),
            message: error.to_string().trim_end().to_owned(),
        })
    }

    /// The content as the text of a file.
    pub fn to_toml(&self) -> String {
        toml::to_string(self).expect("names and numbers can be written as TOML")
    }

    /// The surroundings that it describes; the name of the file is for messages.
    ///
    /// # Errors
    /// [`SurroundingsError::Entry`] for the first entry that is not valid.
    pub fn surroundings(&self, file: &Path) -> Result<Surroundings, SurroundingsError> {
        let at = |entry: EntryName| move |fault| SurroundingsError::Entry { file: file.to_owned(), entry, fault };
        let mut obstacles: Vec<Obstacle> = Vec::with_capacity(self.boxes.len());
        for (index, entry) in self.boxes.iter().enumerate() {
            let is_known = obstacles.iter().any(|earlier| earlier.name == entry.name);
            let read = if is_known { Err(EntryFault::SameName) } else { entry.obstacle() };
            let name = EntryName::Box { number: index + 1, name: entry.name.clone() };
            obstacles.push(read.map_err(at(name))?);
        }
        let volume = self.volume.map(|volume| volume.volume().map_err(at(EntryName::Table("[volume]")))).transpose()?;
        let limits = self.limits.map(|limits| limits.limits().map_err(at(EntryName::Table("[limits]")))).transpose()?;
        Ok(Surroundings { obstacles, volume, limits: limits.unwrap_or_default() })
    }
}

impl KeepOutFile {
    /// The surroundings by all entries that are valid on their own; a box without a name is included.
    pub fn sensible(&self) -> Surroundings {
        let named = |entry: &KeepOutBox| {
            let name = if entry.name.trim().is_empty() { "box".to_owned() } else { entry.name.clone() };
            KeepOutBox { name, ..entry.clone() }.obstacle().ok()
        };
        Surroundings {
            obstacles: self.boxes.iter().filter_map(named).collect(),
            volume: self.volume.and_then(|volume| volume.volume().ok()),
            limits: self.limits.and_then(|limits| limits.limits().ok()).unwrap_or_default(),
        }
    }
}

impl KeepOutBox {
    /// The obstacle that it describes.
    ///
    /// # Errors
    /// [`EntryFault`] states which value is not valid.
    pub(crate) fn obstacle(&self) -> Result<Obstacle, EntryFault> {
        if self.name.trim().is_empty() {
            return Err(EntryFault::NoName);
        }
        metres("centre_m", &self.centre_m)?;
        metres("size_m", &self.size_m)?;
        if let Some(&value) = self.size_m.iter().find(|edge_m| **edge_m <= 0.0) {
            return Err(EntryFault::Size { value });
        }
        let rotation = match (self.rotation_xyzw, self.yaw_deg) {
            (None, None) => UnitQuaternion::identity(),
            (Some([x, y, z, w]), None) => {
                let rotation = Quaternion::new(w, x, y, z);
                let norm = finite("rotation_xyzw", &[x, y, z, w]).map(|()| rotation.norm())?;
                if (norm - 1.0).abs() > UNIT_TOLERANCE {
                    return Err(EntryFault::NotUnit { norm });
                }
                UnitQuaternion::from_quaternion(rotation)
            }
            (None, Some(yaw_deg)) => {
                finite("yaw_deg", &[yaw_deg])?;
                UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw_deg.to_radians())
            }
            (Some(_), Some(_)) => return Err(EntryFault::TwoRotations),
        };
        let centre = Isometry3::from_parts(Translation3::from(self.centre_m), rotation);
        Ok(Obstacle::new(self.name.clone(), centre, self.size_m))
    }
}

impl KeepInVolume {
    fn volume(&self) -> Result<WorkVolume, EntryFault> {
        metres("min_m", &self.min_m)?;
        metres("max_m", &self.max_m)?;
        match (0..3).find(|&axis| self.min_m[axis] >= self.max_m[axis]) {
            Some(axis) => Err(EntryFault::InsideOut { axis: ['x', 'y', 'z'][axis] }),
            None => Ok(WorkVolume { min_m: Point3::from(self.min_m), max_m: Point3::from(self.max_m) }),
        }
    }
}

impl KeepBelow {
    fn limits(&self) -> Result<SpeedLimits, EntryFault> {
        let speeds = [("tip_speed_m_s", self.tip_speed_m_s), ("joint_speed_deg_s", self.joint_speed_deg_s)];
        for (key, value) in speeds.into_iter().filter_map(|(key, value)| Some((key, value?))) {
            finite(key, &[value])?;
            if value <= 0.0 {
                return Err(EntryFault::Speed { key, value });
            }
        }
        if let Some(value) = self.tip_speed_m_s.filter(|value| *value > FASTEST_M_S) {
            return Err(EntryFault::MillimetresPerSecond { value });
        }
        Ok(SpeedLimits { tip_m_s: self.tip_speed_m_s, joint_rad_s: self.joint_speed_deg_s.map(f64::to_radians) })
    }
}

fn finite(key: &'static str, values: &[f64]) -> Result<(), EntryFault> {
    if values.iter().all(|value| value.is_finite()) { Ok(()) } else { Err(EntryFault::NotFinite { key }) }
}

fn metres(key: &'static str, values: &[f64]) -> Result<(), EntryFault> {
    finite(key, values)?;
    match values.iter().find(|value| value.abs() > FARTHEST_M) {
        Some(&value) => Err(EntryFault::Millimetres { key, value }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GOOD: &str = r#"
[[box]]
name = "fixture"
centre_m = [0.4, 0.1, 0.1]
size_m = [0.2, 0.3, 0.2]
yaw_deg = 90.0

[[box]]
name = "rack"
centre_m = [-0.5, 0, 0.5]
size_m = [0.1, 0.1, 1]
rotation_xyzw = [0, 0, 0, 1]

[volume]
min_m = [-1, -1, 0]
max_m = [1, 1, 1.2]

[limits]
tip_speed_m_s = 0.25
joint_speed_deg_s = 30.0
"#;

    fn parse(text: &str) -> Result<Surroundings, SurroundingsError> {
        let file = Path::new("keep_out.toml");
        KeepOutFile::parse(file, text)?.surroundings(file)
    }

    #[test]
    fn a_file_gives_boxes_volume_and_limits_in_metres_and_radians() {
        let read = parse(GOOD).expect("a good file");
        assert_eq!(read.obstacles.len(), 2);
        // Its edge of 0.3 m lies along x after the quarter turn.
        assert!((read.obstacles[0].distance_to(&Point3::new(0.6, 0.1, 0.1)) - 0.05).abs() < 1e-12);
        assert_eq!(read.volume.expect("a volume").max_m.z, 1.2);
        assert!((read.limits.joint(10.0) - 30_f64.to_radians()).abs() < 1e-12 && read.limits.tip(1.0) == 0.25);
        assert_eq!(parse("").expect("nothing is nothing"), Surroundings::default());
    }

    #[test]
    fn what_is_written_reads_as_it_was() {
        let file = Path::new("keep_out.toml");
        for text in [GOOD, ""] {
            let read = KeepOutFile::parse(file, text).expect("a good file");
            assert_eq!(KeepOutFile::parse(file, &read.to_toml()).expect("as good"), read);
        }
    }

    #[test]
    fn what_makes_no_sense_is_refused_with_file_entry_and_what_to_do() {
        let cases = [
            ("size_m = [0.2, 0.3, 0.2]", "size_m = [0.2, -0.3, 0.2]", "Box 1 “fixture”", "above 0"),
            ("size_m = [0.2, 0.3, 0.2]", "size_m = [200, 300, 200]", "Box 1 “fixture”", "divide millimetres"),
            ("centre_m = [0.4, 0.1, 0.1]", "centre_m = [nan, 0.1, 0.1]", "Box 1 “fixture”", "centre_m is not finite"),
            ("rotation_xyzw = [0, 0, 0, 1]", "rotation_xyzw = [0, 0, 0, 2]", "Box 2 “rack”", "unit quaternion"),
            (
                "rotation_xyzw = [0, 0, 0, 1]",
                "rotation_xyzw = [0, 0, 0, 1]\nyaw_deg = 1",
                "Box 2 “rack”",
                "one of them",
            ),
            ("name = \"rack\"", "name = \"fixture\"", "Box 2 “fixture”", "same name"),
            ("name = \"rack\"", "name = \" \"", "Box 2", "name is empty"),
            ("min_m = [-1, -1, 0]", "min_m = [-1, 2, 0]", "[volume]", "along y"),
            ("tip_speed_m_s = 0.25", "tip_speed_m_s = 250", "[limits]", "divide millimetres"),
            ("joint_speed_deg_s = 30.0", "joint_speed_deg_s = 0", "[limits]", "above 0"),
            ("joint_speed_deg_s", "joint_speed", "keep_out.toml", "unknown field"),
            ("yaw_deg = 90.0", "yaw = 90.0", "keep_out.toml", "unknown field"),
        ];
        for (good, bad, entry, says) in cases {
            assert!(GOOD.contains(good), "{good}");
            let message = parse(&GOOD.replacen(good, bad, 1)).expect_err(bad).to_string();
            assert!(
                message.starts_with("keep_out.toml") && message.contains(entry) && message.contains(says),
                "{message}"
            );
        }
        let none = Surroundings::read(Path::new("no such file.toml")).expect_err("there is none").to_string();
        assert!(none.contains("no such file.toml"), "{none}");
    }
}
