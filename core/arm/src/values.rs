//! A value for each joint of an arm, for any number of joints.

use std::fmt;
use std::ops::{Deref, DerefMut};

use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::{ArmError, MAX_JOINTS};

/// A number for each joint from the base to the tip: a position in radians, or in metres for a prismatic joint. It is
/// as cheap to copy as an array, and has as many numbers as the arm has joints, 0 to [`MAX_JOINTS`].
#[derive(Clone, Copy)]
pub struct JointValues {
    count: usize,
    /// Those from `count` on are zero.
    values: [f64; MAX_JOINTS],
}

impl JointValues {
    /// The values by a function of the joint, counted from 0. For more than [`MAX_JOINTS`] joints, only the first ones.
    pub fn from_fn(count: usize, mut value: impl FnMut(usize) -> f64) -> Self {
        let count = count.min(MAX_JOINTS);
        Self { count, values: std::array::from_fn(|i| if i < count { value(i) } else { 0.0 }) }
    }

    /// The given values, where a constant is needed.
    pub const fn of<const N: usize>(given: [f64; N]) -> Self {
        const { assert!(N <= MAX_JOINTS, "no arm has so many joints") };
        let mut values = [0.0; MAX_JOINTS];
        let mut i = 0;
        while i < N {
            values[i] = given[i];
            i += 1;
        }
        Self { count: N, values }
    }

    /// All zero.
    pub fn zeros(count: usize) -> Self {
        Self::from_fn(count, |_| 0.0)
    }

    /// The result of a function of each value.
    #[must_use]
    pub fn map(self, mut change: impl FnMut(f64) -> f64) -> Self {
        Self::from_fn(self.count, |i| change(self.values[i]))
    }
}

impl Deref for JointValues {
    type Target = [f64];

    fn deref(&self) -> &[f64] {
        &self.values[..self.count]
    }
}

impl DerefMut for JointValues {
    fn deref_mut(&mut self) -> &mut [f64] {
        &mut self.values[..self.count]
    }
}

impl<'a> IntoIterator for &'a JointValues {
    type Item = &'a f64;
    type IntoIter = std::slice::Iter<'a, f64>;

    fn into_iter(self) -> Self::IntoIter {
        self.iter()
    }
}

impl<const N: usize> From<[f64; N]> for JointValues {
    fn from(values: [f64; N]) -> Self {
        Self::of(values)
    }
}

impl TryFrom<&[f64]> for JointValues {
    type Error = ArmError;

    /// [`ArmError::JointCount`] for more values than an arm has joints.
    fn try_from(values: &[f64]) -> Result<Self, ArmError> {
        if values.len() > MAX_JOINTS {
            return Err(ArmError::JointCount { got: values.len() });
        }
        Ok(Self::from_fn(values.len(), |i| values[i]))
    }
}

impl PartialEq for JointValues {
    fn eq(&self, other: &Self) -> bool {
        **self == **other
    }
}

impl fmt::Debug for JointValues {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        (**self).fmt(f)
    }
}

impl Serialize for JointValues {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self[..].serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for JointValues {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let values = Vec::<f64>::deserialize(deserializer)?;
        Self::try_from(&values[..]).map_err(serde::de::Error::custom)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_have_as_many_numbers_as_were_given_and_more_than_an_arm_has_are_refused() {
        let values = JointValues::from([0.5, -1.0, 2.0]);
        assert_eq!((values.len(), &values[..]), (3, &[0.5, -1.0, 2.0][..]));
        assert_eq!(values.map(|v| 2.0 * v), JointValues::from([1.0, -2.0, 4.0]));
        assert_ne!(values, JointValues::from([0.5, -1.0, 2.0, 0.0]), "a joint at zero is a joint");
        assert_eq!(JointValues::try_from(&[0.0; 13][..]), Err(ArmError::JointCount { got: 13 }));
        let text = serde_json::to_string(&values).expect("numbers");
        assert_eq!(serde_json::from_str::<JointValues>(&text).expect("the same"), values);
        assert!(serde_json::from_str::<JointValues>("[0,0,0,0,0,0,0,0,0,0,0,0,0]").is_err());
    }
}
