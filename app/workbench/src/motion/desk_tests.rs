use std::collections::BTreeMap;

use super::*;
use crate::model::Jog;
use crate::text::Language;

fn desk() -> MotionQueue {
    let desk = MotionQueue::new(Arc::default(), Arc::new(|| {}));
    desk.connected();
    desk
}

fn free() -> StopLine {
    StopLine::default()
}

/// A stop is pending.
fn pressed() -> StopLine {
    let stop = StopLine::default();
    stop.press();
    stop
}

fn task(id: u64) -> MotionTask {
    MotionTask::Move(MotionRequest {
        id: MotionId(id),
        goal: MotionGoal::Joints([0.0; 6].into()),
        speed: 1.0,
        correction: None,
    })
}

fn button(index: usize) -> JogRequest {
    JogRequest { jog: Jog::Joint { index, forward: true }, tip_from_camera: None, speed: 0.5 }
}

fn reported(desk: &MotionQueue) -> Vec<(u64, String)> {
    desk.take_messages()
        .into_iter()
        .map(|event| match event {
            Event::Moved { id, outcome: MotionOutcome::Refused(why) } => (id.0, why.in_language(Language::English)),
            Event::Moved { id, outcome } => (id.0, format!("{outcome:?}")),
            Event::JogEnded { why } => {
                (0, why.map_or_else(|| "released".to_owned(), |why| why.in_language(Language::English)))
            }
            Event::Stopped => panic!("nobody stopped the arm"),
        })
        .collect()
}

#[test]
fn what_comes_while_something_moves_is_refused_with_what_moves() {
    let desk = desk();
    desk.ask(task(1), &free());
    desk.ask(task(2), &free());
    assert!(matches!(desk.take(0.0), Work::Motion(MotionTask::Move(request), _) if request.id == MotionId(1)));
    desk.ask(task(3), &free());
    desk.hold(button(0), &free(), 0.0);
    let reason = "a motion of the joints is still under way".to_owned();
    assert_eq!(reported(&desk), [(2, reason.clone()), (3, reason.clone()), (0, reason)]);
    desk.done();
    desk.hold(button(0), &free(), 0.1);
    assert!(matches!(desk.take(0.1), Work::Nothing), "the press that was refused does not begin later");
    desk.release();
    assert_eq!(reported(&desk), [(0, "released".to_owned())], "it was held after its end was told");
    desk.hold(button(0), &free(), 0.3);
    assert!(matches!(desk.take(0.3), Work::Jog(_)));
    desk.ask(task(4), &free());
    assert_eq!(reported(&desk), [(4, "The arm is being jogged".to_owned())]);
}

#[test]
fn a_stop_leaves_nothing_that_could_begin_later() {
    let desk = desk();
    desk.ask(task(1), &free());
    desk.cancel(0.0);
    assert_eq!(reported(&desk), [(1, "Stopped".to_owned())]);
    assert!(matches!(desk.take(0.0), Work::Nothing));
    desk.ask(task(2), &pressed());
    desk.hold(button(0), &pressed(), 0.0);
    let reason = "The arm is being stopped".to_owned();
    assert_eq!(reported(&desk), [(2, reason.clone()), (0, reason)]);
    assert!(matches!(desk.take(0.0), Work::Nothing));
    desk.release();
    desk.hold(button(0), &free(), 0.2);
    desk.cancel(0.2);
    assert_eq!(reported(&desk), [(0, "The arm was stopped".to_owned())]);
    assert!(matches!(desk.take(0.2), Work::Nothing));
}

#[test]
fn a_stop_cancels_the_motion_under_way() {
    let desk = desk();
    desk.ask(task(1), &free());
    let Work::Motion(_, cancel) = desk.take(0.0) else { panic!("no motion") };
    assert!(!cancel.is_cancelled());
    desk.cancel(0.0);
    assert!(cancel.is_cancelled());
    assert!(reported(&desk).is_empty(), "the worker tells when it stands");
}

#[test]
fn a_jog_is_told_to_have_ended_once_and_with_its_reason() {
    let desk = desk();
    desk.hold(button(0), &free(), 0.0);
    assert!(matches!(desk.take(0.0), Work::Jog(_)));
    desk.cancel(0.1);
    assert_eq!(desk.is_held(&button(0), 0.1), Held::Released);
    let Some(Event::JogEnded { why: Some(why) }) = desk.end_jog(&button(0), None, None, 0.2) else { panic!("no word") };
    assert_eq!(why.in_language(Language::English), "The arm was stopped");
    desk.hold(button(0), &free(), 0.25);
    assert!(matches!(desk.take(0.25), Work::Nothing), "it has been held all the time");

    desk.release();
    reported(&desk);
    desk.hold(button(0), &free(), 0.4);
    desk.release();
    assert_eq!(reported(&desk), [(0, "released".to_owned())], "also when the worker was not quick enough to see it");
    desk.hold(button(1), &free(), 1.0);
    assert!(matches!(desk.take(1.0), Work::Jog(_)));
    desk.hold(button(2), &free(), 1.1);
    assert_eq!(desk.is_held(&button(1), 1.1), Held::Released);
    assert!(desk.end_jog(&button(1), None, None, 1.1).is_none(), "the next one goes on");
    assert!(matches!(desk.take(1.1), Work::Jog(request) if request == button(2)));
    let end = desk.end_jog(&button(2), None, Some(0.3), 2.0);
    assert!(matches!(end, Some(Event::JogEnded { why: Some(_) })), "the window fell silent");
}

#[test]
fn a_connection_that_goes_takes_what_was_not_begun_with_it() {
    let desk = desk();
    desk.ask(task(1), &free());
    desk.disconnected(0.0);
    desk.ask(task(2), &free());
    let reason = "There is no connection that moves the arm".to_owned();
    assert_eq!(reported(&desk), [(1, reason.clone()), (2, reason)]);
    desk.connected();
    assert!(matches!(desk.take(0.0), Work::Nothing));
}

/// Every order of a few presses, with the worker anywhere in between.
#[test]
fn every_motion_has_one_end_in_every_order_of_events() {
    for order in 0..4_u32.pow(6) {
        let desk = desk();
        let mut ends = BTreeMap::<u64, u32>::new();
        let mut running: Option<u64> = None;
        let mut asked = 0;
        for step in 0..6 {
            match order / 4_u32.pow(step) % 4 {
                0 => {
                    asked += 1;
                    desk.ask(task(asked), &free());
                }
                1 => desk.cancel(0.0),
                2 if running.is_none() => {
                    if let Work::Motion(task, _) = desk.take(0.0) {
                        running = Some(task.id().0);
                    }
                }
                3 => {
                    if let Some(id) = running.take() {
                        desk.done();
                        *ends.entry(id).or_default() += 1;
                    }
                }
                _ => {}
            }
            for (id, _) in reported(&desk) {
                *ends.entry(id).or_default() += 1;
            }
        }
        if let Work::Motion(task, _) = desk.take(0.0) {
            *ends.entry(task.id().0).or_default() += 1;
        } else if let Some(id) = running {
            *ends.entry(id).or_default() += 1;
        }
        let expected: BTreeMap<u64, u32> = (1..=asked).map(|id| (id, 1)).collect();
        assert_eq!(ends, expected, "order {order}");
    }
}

#[test]
fn what_the_arm_keeps_out_of_is_told_once_for_each_change_and_each_connection() {
    let queue = MotionQueue::new(Arc::default(), Arc::new(|| {}));
    assert!(queue.take_keep_out().is_none(), "there is nothing to keep out of and nobody to tell");
    let keep_out = Arc::new(Surroundings::default());
    queue.keep_out(Arc::clone(&keep_out));
    assert!(queue.take_keep_out().is_some_and(|stated| Arc::ptr_eq(&stated, &keep_out)));
    assert!(queue.take_keep_out().is_none());
    queue.disconnected(0.0);
    queue.connected();
    assert!(queue.take_keep_out().is_some_and(|stated| Arc::ptr_eq(&stated, &keep_out)));
}
