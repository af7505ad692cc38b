//! The links of any arm as capsules, for those that draw it and those that keep it out of the way.
//!
//! A chain of joints says where axes are, not what hangs between them. So each link is taken for a tube from where its own
//! joint sits to where the next one does, or its shortest way around: an arm that runs beside its axes, as those of
//! Universal Robots do, is thicker and to one side of that. Of a prismatic joint the rail is not there.

use handeye_core::geometry::arm::Arm;
use nalgebra::{Isometry3, Point3};

/// Radius of the link at the base and of the one at the tip, metres: those of arms for some kilograms.
const RADII_M: [f64; 2] = [0.06, 0.04];
/// Joints closer together than this \[m\] are one body.
const SHORTEST_M: f64 = 1e-3;

/// A tube with round ends that moves with one link.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LinkCapsule {
    /// How many joints carry it.
    pub link: usize,
    /// One end, in the arm frame with all joints at zero.
    pub from: Point3<f64>,
    /// The other.
    pub to: Point3<f64>,
    /// Metres.
    pub radius_m: f64,
}

/// The capsules of an arm from its base to its connection; a link between two joints at one place has none.
pub fn capsules(arm: &Arm) -> Vec<LinkCapsule> {
    let bare = arm.clone().mounted(Isometry3::identity(), arm.flange_from_tip);
    let Some(at_zero) = Placed::of(&bare, &vec![0.0; bare.joint_count()]) else { return Vec::new() };
    let links = at_zero.places.windows(2).enumerate();
    let last = bare.joint_count() as f64;
    links
        .filter(|(_, ends)| (ends[1] - ends[0]).norm() > SHORTEST_M)
        .map(|(link, ends)| {
            let radius_m = RADII_M[0] + (RADII_M[1] - RADII_M[0]) * link as f64 / last;
            LinkCapsule { link, from: ends[0], to: ends[1], radius_m }
        })
        .collect()
}

/// What each link, counted from the base, has moved in the arm frame since all joints were at zero; `None` for values
/// that are not those of the arm.
pub fn motions(arm: &Arm, joints: &[f64]) -> Option<Vec<Isometry3<f64>>> {
    let bare = arm.clone().mounted(Isometry3::identity(), arm.flange_from_tip);
    let (now, at_zero) = (Placed::of(&bare, joints)?, Placed::of(&bare, &vec![0.0; bare.joint_count()])?);
    Some(now.links.iter().zip(&at_zero.links).map(|(now, zero)| now * zero.inverse()).collect())
}

/// Where links are, and the places along the chain between which they reach, in the arm frame.
struct Placed {
    links: Vec<Isometry3<f64>>,
    places: Vec<Point3<f64>>,
}

impl Placed {
    fn of(arm: &Arm, joints: &[f64]) -> Option<Self> {
        let frames = arm.frames(joints).ok()?;
        let origin = |pose: &Isometry3<f64>| Point3::from(pose.translation.vector);
        let tip = frames.base_from_flange * arm.flange_from_tip;
        let joints = frames.base_from_joint.iter().map(origin);
        let places = std::iter::once(Point3::origin()).chain(joints).chain([origin(&tip)]).collect();
        let links = std::iter::once(Isometry3::identity()).chain(frames.base_from_link).collect();
        Some(Self { links, places })
    }
}
