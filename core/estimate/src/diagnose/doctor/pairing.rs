//! How images may have been paired with the wrong rows of the pose table.

use super::views::SessionViews;
use crate::diagnose::hypotheses::pairing::{Order, along};
use crate::diagnose::hypotheses::steps::{self, Step};

/// Which row of the table an image belongs to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Pairing {
    /// Its own row.
    AsGiven,
    /// The row this many rows further.
    Shifted(isize),
    /// The row this many rows further, differently before a view (by its place among those seen) and from it on.
    Stepped(Step),
    /// Images and poses were listed in different orders: the poses in this one, the images in the other.
    Listed(Order),
}

impl Pairing {
    /// The row of every view; `None` where the table has none.
    pub fn rows(self, sight: &SessionViews) -> Vec<Option<usize>> {
        let order = match self {
            Self::Listed(order) => ranks(sight, order),
            _ => (0..sight.table.len()).collect(),
        };
        let further = |view: usize| match self {
            Self::Shifted(by) => by,
            Self::Stepped(step) => step.further(view),
            Self::AsGiven | Self::Listed(_) => 0,
        };
        sight.views.iter().enumerate().map(|(view, it)| along(&order, it.row, further(view))).collect()
    }

    /// The changes of the whole table.
    pub fn all(sight: &SessionViews) -> Vec<Self> {
        let differs = |order: &Order| !ranks(sight, *order).iter().copied().eq(0..sight.table.len());
        let listed = [Order::ByNumber, Order::ByLetters].into_iter().filter(differs).map(Self::Listed);
        steps::SHIFTS.map(Self::Shifted).into_iter().chain(listed).collect()
    }
}

/// The place of the image of every row, in an order of their names.
fn ranks(sight: &SessionViews, order: Order) -> Vec<usize> {
    let names: Vec<&str> = sight.table.iter().map(|row| row.name.as_str()).collect();
    order.ranks(&names)
}
