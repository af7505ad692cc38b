//! Which captures are selected after a click or a key.

use egui::Modifiers;
use handeye_session::CaptureId;

/// The selection after a click on a row. `order` is that of the rows on the screen; the last one selected is the one
/// that is shown. With Shift the rows from `anchor` to the clicked one are selected, with Ctrl one is added or removed.
pub fn clicked(
    order: &[CaptureId],
    selection: &[CaptureId],
    anchor: Option<CaptureId>,
    id: CaptureId,
    modifiers: Modifiers,
) -> Vec<CaptureId> {
    if modifiers.command {
        let mut next: Vec<CaptureId> = selection.iter().copied().filter(|&other| other != id).collect();
        if next.len() == selection.len() {
            next.push(id);
        }
        return next;
    }
    let place = |id| order.iter().position(|&other| other == id);
    match (anchor.and_then(place), place(id)) {
        (Some(from), Some(to)) if modifiers.shift && from <= to => order[from..=to].to_vec(),
        (Some(from), Some(to)) if modifiers.shift => order[to..=from].iter().rev().copied().collect(),
        _ => vec![id],
    }
}

/// The row above or below the one that is shown; the first or last one when none is.
pub fn neighbour(order: &[CaptureId], current: Option<CaptureId>, down: bool) -> Option<CaptureId> {
    let at = current.and_then(|id| order.iter().position(|&other| other == id));
    match (at, down) {
        (Some(at), true) => order.get((at + 1).min(order.len() - 1)),
        (Some(at), false) => order.get(at.saturating_sub(1)),
        (None, true) => order.first(),
        (None, false) => order.last(),
    }
    .copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ids(numbers: &[u32]) -> Vec<CaptureId> {
        numbers.iter().map(|&number| CaptureId(number)).collect()
    }

    #[test]
    fn ctrl_adds_and_takes_away_one_and_shift_selects_a_range_as_the_rows_stand() {
        let order = ids(&[5, 3, 1, 4]);
        let select = |selection: &[u32], anchor: u32, id, modifiers| {
            clicked(&order, &ids(selection), Some(CaptureId(anchor)), CaptureId(id), modifiers)
        };
        assert_eq!(select(&[5, 3], 5, 4, Modifiers::NONE), ids(&[4]));
        assert_eq!(select(&[5], 5, 1, Modifiers::COMMAND), ids(&[5, 1]));
        assert_eq!(select(&[5, 1], 5, 5, Modifiers::COMMAND), ids(&[1]));
        assert_eq!(select(&[3], 3, 4, Modifiers::SHIFT), ids(&[3, 1, 4]));
        assert_eq!(select(&[1], 1, 5, Modifiers::SHIFT), ids(&[1, 3, 5]), "the clicked one is looked at");
        assert_eq!(select(&[], 9, 3, Modifiers::SHIFT), ids(&[3]), "an anchor that is gone is none");
    }

    #[test]
    fn keys_stop_at_the_ends() {
        let order = ids(&[5, 3, 1]);
        let step = |current: Option<u32>, down| neighbour(&order, current.map(CaptureId), down).map(|id| id.0);
        assert_eq!((step(Some(5), true), step(Some(1), true)), (Some(3), Some(1)));
        assert_eq!((step(Some(5), false), step(None, true), step(None, false)), (Some(5), Some(5), Some(1)));
        assert_eq!(neighbour(&[], Some(CaptureId(1)), true), None);
    }
}
