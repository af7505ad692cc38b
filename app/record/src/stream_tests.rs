use std::sync::Mutex;

use handeye_estimate::handeye::Mode;
use rerun::log::Chunk;
use rerun::sink::CallbackSink;

use super::*;
use handeye_workbench::model::Model;
use handeye_workbench::testing::sample;

/// A stream for viewers, and what viewers receive of it.
struct Bench {
    stream: Stream,
    sent: Arc<Mutex<Vec<LogMsg>>>,
}

impl Bench {
    fn new() -> Self {
        let sent = Arc::new(Mutex::new(Vec::new()));
        let taken = Arc::clone(&sent);
        let sink = CallbackSink::new(move |batch: &[LogMsg]| taken.lock().expect("whole").extend_from_slice(batch));
        let sink = SharedSink(Arc::new(sink));
        let target = Target::Viewers { lasting: sink.clone(), live: sink };
        let recording = Recording { id: "a".to_owned(), name: "a".to_owned(), folder: None };
        let mut stream = Stream::open(&target, &recording).expect("a stream");
        stream.begin().expect("begun");
        Self { stream, sent }
    }

    fn lasting(&mut self, entry: &Entry) {
        self.stream.write_lasting(entry).expect("written");
    }

    fn live(&mut self, entry: &Entry) {
        self.stream.write_live(entry).expect("written");
    }

    /// Each point that the eye was set to look at since the last call.
    fn looked_at(&self) -> Vec<[f32; 3]> {
        self.stream.flush().expect("flushed");
        let sent = std::mem::take(&mut *self.sent.lock().expect("whole"));
        let of_layouts = sent.iter().filter_map(|message| match message {
            LogMsg::ArrowMsg(store, message) if store.is_blueprint() => Chunk::from_arrow_msg(message).ok(),
            _ => None,
        });
        let targets = |chunk: Chunk| -> Vec<[f32; 3]> {
            chunk.iter_slices::<[f32; 3]>("EyeControls3D:look_target".into()).flatten().copied().collect()
        };
        of_layouts.flat_map(targets).collect()
    }
}

fn robot(model: &Model, joints_rad: [f64; 6]) -> Entry {
    let arm = model.cell.as_ref().and_then(|cell| cell.arm.clone()).expect("it has an arm");
    Entry::Robot { sim_time_s: 1.0, base_from_tip: arm.tip(&joints_rad), joints_rad: joints_rad.into() }
}

fn cell(model: &Model, shift_m: f64) -> Entry {
    let mut facts = model.cell.clone().expect("connected");
    let arm = facts.arm.take().expect("it has an arm");
    let elsewhere = nalgebra::Isometry3::translation(shift_m, 0.0, 0.0) * arm.base_from_arm();
    facts.arm = Some(handeye_coppeliasim::cell::ArmKinematics::new(arm.arm().clone(), elsewhere));
    facts.truth = None;
    Entry::Cell(Arc::new(facts))
}

#[test]
fn viewers_look_at_the_whole_cell_live_and_again_after_another_cell_and_are_else_left_as_they_were_turned() {
    let model = sample::connected();
    let mut bench = Bench::new();
    bench.lasting(&Entry::Step(Step::Capture));
    bench.lasting(&cell(&model, 0.0));
    assert!(bench.looked_at().is_empty(), "nobody knows where the arm is");
    bench.live(&robot(&model, [0.0, 0.5, -1.0, 0.0, 1.5, 0.0]));
    let first = bench.looked_at();
    let [[x, _, z]] = first[..] else { panic!("{first:?}") };
    assert!(x.abs() < 0.6 && (0.1..0.8).contains(&z), "{first:?}");
    bench.live(&robot(&model, [0.3, 0.4, -1.1, 0.0, 1.5, 0.0]));
    assert!(bench.looked_at().is_empty(), "the arm moved in sight");
    let far = cell(&model, 3.0);
    bench.lasting(&far);
    let Entry::Cell(facts) = &far else { panic!("a cell") };
    bench.live(&robot(&Model { cell: Some((**facts).clone()), ..model }, [0.0, 0.5, -1.0, 0.0, 1.5, 0.0]));
    let second = bench.looked_at();
    let [[x, ..]] = second[..] else { panic!("{second:?}") };
    assert!((2.0..4.0).contains(&x), "{second:?}");
}

#[test]
fn a_recording_without_a_live_cell_looks_at_its_captures() {
    let model = sample::solved();
    let mut bench = Bench::new();
    bench.lasting(&Entry::Step(Step::Solve));
    bench.lasting(&Entry::Document { folder: None, document: Arc::new(model.document().clone()) });
    let looked_at = bench.looked_at();
    let last = looked_at.last().expect("it looks somewhere");
    // The camera looked at the board, at (0.4, 0.1), from around 0.3 m above it.
    assert!((last[0] - 0.45).abs() < 0.3 && (last[1] - 0.1).abs() < 0.3 && (0.0..0.6).contains(&last[2]), "{last:?}");
}

#[test]
fn the_image_of_a_camera_beside_the_robot_is_the_one_in_front() {
    let mut document = sample::solved().document().clone();
    document.meta.mode = Mode::EyeToHand;
    let mut bench = Bench::new();
    bench.lasting(&Entry::Step(Step::Capture));
    assert!(!bench.stream.shown.expect("shown").arranged.is_eye_to_hand);
    bench.lasting(&Entry::Document { folder: None, document: Arc::new(document) });
    assert!(bench.stream.shown.expect("shown").arranged.is_eye_to_hand);
}
