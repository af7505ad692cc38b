//! A view in the fit in which the target was found.

use handeye_geometry::targets::observation::Corners;

/// A view in the fit in which the target was found.
pub(super) struct DetectedView<'a> {
    /// Its index among all views.
    pub(super) index: usize,
    pub(super) view: &'a super::ObservedView,
    pub(super) corners: &'a Corners,
}

impl<'a> DetectedView<'a> {
    pub(super) fn new((index, view): (usize, &'a super::ObservedView)) -> Option<Self> {
        Some(Self { index, view, corners: view.corners.as_ref().filter(|_| view.in_fit)? })
    }
}
