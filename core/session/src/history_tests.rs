use super::*;
use crate::document::Role;
use crate::tests::{meta, record};

fn history(captures: u32) -> History {
    let captures = (1..=captures).map(record).collect();
    History::new(Document { captures, ..Document::new(meta()) })
}

fn exclude(id: u32, excluded: bool) -> Edit {
    Edit::SetExcluded { ids: vec![CaptureId(id)], excluded }
}

#[test]
fn undo_takes_back_and_redo_makes_again_in_order() {
    let mut history = history(3);
    let start = history.document().clone();
    let edits = [
        exclude(1, true),
        Edit::DeleteCaptures(vec![CaptureId(2)]),
        Edit::SetRole { ids: vec![CaptureId(3)], role: Role::Verification },
    ];
    let mut states = vec![start];
    for edit in &edits {
        history.apply(edit.clone()).expect("apply");
        states.push(history.document().clone());
    }
    let whole = history.clone();
    for (edit, state) in edits.iter().zip(&states).rev() {
        assert_eq!(history.undo_edit(), Some(edit));
        history.undo().expect("undo");
        assert_eq!((history.document(), history.redo_edit()), (state, Some(edit)));
    }
    assert_eq!((history.undo(), history.undo_edit()), (Err(EditError::NothingToUndo), None));
    for _ in &edits {
        history.redo().expect("redo");
    }
    assert_eq!(history.redo(), Err(EditError::NothingToRedo));
    assert_eq!(history, whole);
}

#[test]
fn a_new_change_ends_what_could_be_redone_and_a_refused_one_does_not() {
    let mut history = history(2);
    history.apply(exclude(1, true)).expect("apply");
    history.undo().expect("undo");
    let before = history.clone();
    assert_eq!(history.apply(exclude(9, true)), Err(EditError::UnknownCapture(CaptureId(9))));
    assert_eq!(history, before);
    history.apply(exclude(2, true)).expect("apply");
    assert_eq!(history.redo_edit(), None);
}

#[test]
fn a_number_is_never_used_again() {
    let add = |id| Edit::AddCapture(Box::new(record(id)));
    let mut history = history(2);
    history.apply(Edit::DeleteCaptures(vec![CaptureId(2)])).expect("delete");
    assert_eq!(history.next_capture_id(), Ok(CaptureId(3)));
    assert_eq!(history.apply(add(2)), Err(EditError::UsedNumber(CaptureId(2))));
    history.apply(add(3)).expect("add");
    history.undo().expect("undo");
    assert_eq!(history.next_capture_id(), Ok(CaptureId(4)));
    assert_eq!(history.apply(add(3)), Err(EditError::UsedNumber(CaptureId(3))));
    history.apply(add(u32::MAX)).expect("add");
    assert_eq!(history.next_capture_id(), Err(EditError::NoNumberLeft));
}

#[test]
fn the_past_is_as_long_as_it_may_be_and_no_longer() {
    let mut history = history(1);
    let mut kept = None;
    for step in 0..UNDO_STEPS + 5 {
        if step == 5 {
            kept = Some(history.document().clone());
        }
        history.apply(exclude(1, step % 2 == 0)).expect("apply");
    }
    for _ in 0..UNDO_STEPS {
        history.undo().expect("undo");
    }
    assert_eq!(history.undo(), Err(EditError::NothingToUndo));
    assert_eq!(Some(history.document()), kept.as_ref());
}
