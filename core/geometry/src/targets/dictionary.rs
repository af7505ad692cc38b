//! The families of square markers that are known by name.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Deserializer, Serialize, Serializer, de};

/// A family of square black markers: its codes and their number of bits.
///
/// They are the predefined dictionaries of OpenCV's `aruco`, among them four families of `AprilTag`. The codes
/// themselves are in OpenCV.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Dictionary(u8);

/// Name, bits along a side, number of markers; in the order of OpenCV's numbers.
const ALL: [(&str, usize, usize); 21] = [
    ("4x4_50", 4, 50),
    ("4x4_100", 4, 100),
    ("4x4_250", 4, 250),
    ("4x4_1000", 4, 1000),
    ("5x5_50", 5, 50),
    ("5x5_100", 5, 100),
    ("5x5_250", 5, 250),
    ("5x5_1000", 5, 1000),
    ("6x6_50", 6, 50),
    ("6x6_100", 6, 100),
    ("6x6_250", 6, 250),
    ("6x6_1000", 6, 1000),
    ("7x7_50", 7, 50),
    ("7x7_100", 7, 100),
    ("7x7_250", 7, 250),
    ("7x7_1000", 7, 1000),
    ("aruco_original", 5, 1024),
    ("apriltag_16h5", 4, 30),
    ("apriltag_25h9", 5, 35),
    ("apriltag_36h10", 6, 2320),
    ("apriltag_36h11", 6, 587),
];

impl Dictionary {
    /// The family that most `AprilTag` boards use.
    pub const APRILTAG_36H11: Self = Self(20);

    /// A family with markers enough for a board on A4.
    pub const ARUCO_5X5_100: Self = Self(5);

    /// All families.
    pub fn all() -> impl Iterator<Item = Self> {
        (0..ALL.len() as u8).map(Self)
    }

    fn entry(self) -> &'static (&'static str, usize, usize) {
        // Only numbers of the table are ever made.
        &ALL[usize::from(self.0)]
    }

    /// Its name in files.
    pub fn name(self) -> &'static str {
        self.entry().0
    }

    /// Bits along a side of the code, without the black border.
    pub fn bits(self) -> usize {
        self.entry().1
    }

    /// Number of markers; they are numbered from 0.
    pub fn markers(self) -> usize {
        self.entry().2
    }

    /// Whether it is a family of the `AprilTag` project.
    pub fn is_apriltag(self) -> bool {
        self.name().starts_with("apriltag")
    }

    /// The number of `cv::aruco::PredefinedDictionaryType`.
    pub fn opencv_number(self) -> i32 {
        i32::from(self.0)
    }
}

/// The name of a family that is not known.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error, handeye_wording::Localized)]
#[error("marker family {0:?} is not known: it is one of {list}", list = names())]
pub struct UnknownDictionary(pub String);

fn names() -> String {
    ALL.map(|(name, ..)| name).join(", ")
}

impl FromStr for Dictionary {
    type Err = UnknownDictionary;

    /// `4x4_50`, and other names for the same: `DICT_4X4_50`, `36h11`, `tag36h11`, `t36h11`, `DICT_APRILTAG_36h11`.
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let lower = text.to_ascii_lowercase();
        let name = lower.strip_prefix("dict_").unwrap_or(&lower);
        let family = ["apriltag_", "apriltag", "tag", "t"].iter().find_map(|p| name.strip_prefix(p)).unwrap_or(name);
        Self::all()
            .find(|d| d.name() == name || d.name().strip_prefix("apriltag_") == Some(family))
            .ok_or_else(|| UnknownDictionary(text.to_owned()))
    }
}

impl fmt::Display for Dictionary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl Serialize for Dictionary {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

impl<'de> Deserialize<'de> for Dictionary {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        String::deserialize(deserializer)?.parse().map_err(de::Error::custom)
    }
}
