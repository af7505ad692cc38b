//! A pose with named keys, for `#[serde(with = "…")]`; the quaternion is kept bit for bit when it has unit length.

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use handeye_geometry::frames::Pose;

/// Largest deviation of a quaternion's length from 1.
const UNIT_TOLERANCE: f64 = 1e-6;

#[derive(Serialize, Deserialize)]
struct Record {
    translation_m: [f64; 3],
    rotation_xyzw: [f64; 4],
}

impl Record {
    fn of<Dst, Src>(pose: &Pose<Dst, Src>) -> Self {
        Self { translation_m: pose.translation().into(), rotation_xyzw: pose.xyzw() }
    }

    fn pose<Dst, Src, E: serde::de::Error>(self) -> Result<Pose<Dst, Src>, E> {
        let Self { translation_m, rotation_xyzw: [x, y, z, w] } = self;
        let q = Quaternion::new(w, x, y, z);
        // Written so that NaN is refused as well.
        if (q.norm() - 1.0).abs() <= UNIT_TOLERANCE {
            let rotation = UnitQuaternion::new_unchecked(q);
            return Ok(Pose::from_isometry(Isometry3::from_parts(Translation3::from(translation_m), rotation)));
        }
        Err(E::custom(format!("rotation_xyzw has length {} and is not a unit quaternion", q.norm())))
    }
}

/// Writes it.
///
/// # Errors
/// Errors of the serializer.
pub fn serialize<Dst, Src, S: Serializer>(pose: &Pose<Dst, Src>, serializer: S) -> Result<S::Ok, S::Error> {
    Record::of(pose).serialize(serializer)
}

/// Reads it.
///
/// # Errors
/// Errors of the deserializer, and a quaternion that is not of unit length.
pub fn deserialize<'de, Dst, Src, D: Deserializer<'de>>(deserializer: D) -> Result<Pose<Dst, Src>, D::Error> {
    Record::deserialize(deserializer)?.pose()
}

/// The same for a pose that may be missing.
pub mod optional {
    use super::{Deserialize, Deserializer, Pose, Record, Serialize, Serializer};

    /// Writes it.
    ///
    /// # Errors
    /// Errors of the serializer.
    pub fn serialize<Dst, Src, S: Serializer>(pose: &Option<Pose<Dst, Src>>, serializer: S) -> Result<S::Ok, S::Error> {
        pose.as_ref().map(Record::of).serialize(serializer)
    }

    /// Reads it.
    ///
    /// # Errors
    /// As [`super::deserialize`].
    pub fn deserialize<'de, Dst, Src, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<Option<Pose<Dst, Src>>, D::Error> {
        Option::<Record>::deserialize(deserializer)?.map(Record::pose).transpose()
    }
}
