use nalgebra::Vector2;

use super::*;
use crate::tests::{meta, record};
use crate::{CaptureRecord, Role};
use handeye_geometry::targets::observation::{Corner, Corners};

/// A corner that encodes its capture.
fn corner_of(id: CaptureId) -> Corners {
    vec![Corner::new(0, Vector2::new(f64::from(id.0), 0.0))].into()
}

#[test]
fn exclusions_and_verification_captures_are_known_by_their_number_wherever_they_stand() {
    // The order of the document is not that of the numbers: deleted captures come back in their place by undo.
    let of = |id, role, excluded| CaptureRecord { role, excluded, ..record(id) };
    let captures = vec![
        of(4, Role::Verification, false),
        of(9, Role::Calibration, true),
        of(2, Role::Calibration, false),
        of(7, Role::Verification, true),
        of(3, Role::Verification, false),
        of(1, Role::Calibration, true),
        of(8, Role::Calibration, false),
    ];
    let document = Document { captures, ..Document::new(meta()) };
    let unseen = CaptureId(3);
    let seen =
        document.observations((24, 16), |id| (id != unseen).then(|| Sight { corners: corner_of(id), depth: None }));

    let ids = |ids: &[CaptureId]| ids.iter().map(|id| id.0).collect::<Vec<_>>();
    assert_eq!(ids(&seen.captures), [9, 2, 1, 8]);
    let views: Vec<_> = seen.observations.views.iter().map(|view| (view.name.as_str(), view.in_fit)).collect();
    assert_eq!(
        views,
        [("images/0009.png", false), ("images/0002.png", true), ("images/0001.png", false), ("images/0008.png", true)]
    );
    for (id, view) in seen.captures.iter().zip(&seen.observations.views) {
        assert_eq!(view.corners, Some(corner_of(*id)), "{} has the corners of another capture", view.name);
        assert_eq!(view.base_from_tip, record(id.0).base_from_tip);
    }
    // Excluded, or without the target, it verifies nothing.
    let verification: Vec<_> = seen.verification.iter().map(|(id, view)| (id.0, view.name.as_str())).collect();
    assert_eq!(verification, [(4, "images/0004.png")]);
    assert_eq!(seen.verification[0].1.corners, corner_of(CaptureId(4)));
    assert_eq!((seen.observations.mode, seen.observations.image_size), (Some(meta().mode), (24, 16)));
}
