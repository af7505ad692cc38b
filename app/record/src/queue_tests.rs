use std::sync::Arc;

use handeye_geometry::depth::DepthImage;
use handeye_geometry::frames::Pose;
use image::RgbImage;

use super::*;
use handeye_workbench::model::{ColouredDepth, FrameImages, FrameInfo, Severity};

const SOON: Duration = Duration::from_secs(20);
const AT_ONCE: Duration = Duration::from_millis(1);

fn rates(rate: Rate) -> Rates {
    Rates { robot: rate, image: rate, detection: rate, tracked: rate, waits: false }
}

fn robot(sim_time_s: f64) -> Entry {
    Entry::Robot { sim_time_s, base_from_tip: Pose::identity(), joints_rad: [0.0; 6].into() }
}

fn image(number: u64) -> Entry {
    let info = FrameInfo {
        number,
        sim_time_s: 0.0,
        image_age_s: 0.0,
        image_off_m: 0.0,
        no_pose: None,
        received_s: 0.0,
        rate_hz: 0.0,
        depth_range_m: [0.0, 1.0],
        far_plane_m: 1.0,
        base_from_tip: Some(Pose::identity()),
        joints_rad: [0.0; 6].into(),
        base_from_target_true: None,
        clocks: None,
    };
    let depth = DepthImage::new(1, 1, vec![1.0]).expect("an image");
    let images = FrameImages {
        rgb: RgbImage::new(1, 1),
        depth: Some(ColouredDepth { metres: depth, colours: RgbImage::new(1, 1) }),
    };
    Entry::Image { info: Box::new(info), images: Arc::new(images) }
}

fn reported(words: &str) -> Entry {
    Entry::Message { severity: Severity::Info, words: words.to_owned() }
}

fn number(next: Next) -> u64 {
    match next {
        Next::Live(Entry::Image { info, .. }) => info.number,
        other => panic!("no image but {other:?}"),
    }
}

#[test]
fn a_writer_that_never_writes_leaves_a_short_queue_with_everything_that_lasts() {
    let queue = Queue::new(&rates(Rate::newest_every(Duration::ZERO)));
    for round in 0..2000 {
        queue.put(image(round));
        queue.put(robot(round as f64));
        queue.put(Entry::Selected(Vec::new()));
    }
    queue.put(reported("the last words"));
    assert_eq!(queue.len(), 4, "an image, a state, a selection and a message");
    assert!(matches!(queue.next(SOON), Next::Lasting(Item::Entry(Entry::Selected(_)))));
    assert!(matches!(queue.next(SOON), Next::Lasting(Item::Entry(Entry::Message { .. }))));
    assert_eq!(number(queue.next(SOON)), 1999, "the newest image");
}

#[test]
fn a_command_that_ends_has_every_image_written_as_long_as_the_writer_keeps_up() {
    let queue = Queue::new(&rates(Rate::all(3)));
    for round in 0..5 {
        queue.put(image(round));
    }
    queue.end();
    assert_eq!([2, 3, 4].map(|_| number(queue.next(SOON))), [2, 3, 4]);
    assert!(matches!(queue.next(SOON), Next::End));
}

#[test]
fn images_that_come_too_often_are_thinned_and_not_counted_as_lost() {
    let queue = Queue::new(&rates(Rate::newest_every(Duration::from_hours(1))));
    queue.put(image(1));
    assert_eq!(number(queue.next(SOON)), 1);
    queue.put(image(2));
    queue.put(image(3));
    assert!(matches!(queue.next(AT_ONCE), Next::Idle), "it is not time yet");
    assert_eq!(queue.left_out(), 0);
    queue.end();
    assert_eq!(number(queue.next(SOON)), 3, "the end does not wait for its time");
}

#[test]
fn images_that_a_slow_writer_did_not_take_are_counted() {
    let began = Instant::now();
    let queue = Queue::new(&rates(Rate::newest_every(Duration::ZERO)));
    let mut put = 0;
    while queue.left_out() < 3 {
        queue.put(image(put));
        put += 1;
        std::thread::yield_now();
        assert!(began.elapsed() < SOON);
    }
    assert!(began.elapsed() >= SLOW);
}

#[test]
fn what_lasts_goes_before_what_is_live_and_a_waiting_writer_is_woken() {
    let queue = Arc::new(Queue::new(&rates(Rate::newest_every(Duration::ZERO))));
    queue.put(image(1));
    queue.put(reported("hello"));
    assert!(matches!(queue.next(SOON), Next::Lasting(_)));
    assert_eq!(number(queue.next(SOON)), 1);
    let waiting = Arc::clone(&queue);
    let writer = std::thread::spawn(move || matches!(waiting.next(SOON), Next::Lasting(_)));
    queue.put(reported("again"));
    assert!(writer.join().expect("no panic"));
}

#[test]
fn where_nothing_may_be_left_out_a_slow_writer_gets_every_entry_in_its_order() {
    let queue = Arc::new(Queue::new(&Rates { waits: true, ..rates(Rate::all(1)) }));
    let writer = std::thread::spawn({
        let queue = Arc::clone(&queue);
        move || {
            let mut taken = Vec::new();
            loop {
                match queue.next(Duration::from_mins(1)) {
                    Next::Live(Entry::Robot { sim_time_s, .. }) => taken.push(sim_time_s),
                    Next::Lasting(Item::Entry(Entry::Message { words, .. })) => {
                        taken.push(words.parse().expect("a number"));
                    }
                    Next::End => return taken,
                    other => panic!("{other:?}"),
                }
                std::thread::yield_now();
            }
        }
    });
    for number in 0..200 {
        queue.put(if number % 2 == 0 { robot(f64::from(number)) } else { reported(&number.to_string()) });
    }
    queue.end();
    let taken: Vec<f64> = writer.join().expect("no panic");
    assert_eq!(taken, (0..200).map(f64::from).collect::<Vec<_>>());
    assert_eq!(queue.left_out(), 0);
}
