//! Entries in, entities out, through a sink in memory.

use std::collections::{BTreeMap, BTreeSet};

use handeye_plan::{Obstacle, Surroundings};
use handeye_session::{CaptureId, Document};
use handeye_track::{Estimate, State, Update};
use nalgebra::{Isometry3, Matrix3, Matrix6, Vector3};
use rerun::RecordingStreamBuilder;
use rerun::log::{Chunk, LogMsg};

use super::*;
use handeye_workbench::model::{Model, Tracked};
use handeye_workbench::testing::sample;

/// What is in a recording, by entity.
#[derive(Debug, Default)]
struct Entity {
    components: BTreeSet<String>,
    timelines: BTreeSet<String>,
    rows: usize,
}

type Entities = BTreeMap<String, Entity>;

/// A writer at work, and what it has written since the last call.
struct Bench {
    writer: SceneWriter,
    rec: RecordingStream,
    storage: rerun::sink::MemorySinkStorage,
}

impl Bench {
    fn new() -> Self {
        let (rec, storage) = RecordingStreamBuilder::new("handeye-workbench").memory().expect("a recording");
        Self { writer: SceneWriter::new(), rec, storage }
    }

    fn begin(&mut self) -> Entities {
        SceneWriter::begin(&self.rec).expect("begun");
        self.written()
    }

    fn write(&mut self, entry: &Entry) -> Entities {
        self.writer.write(&self.rec, entry).expect("written");
        self.written()
    }

    fn written(&self) -> Entities {
        self.rec.flush_blocking().expect("flushed");
        let mut entities = Entities::new();
        for message in self.storage.take() {
            let LogMsg::ArrowMsg(_, message) = message else { continue };
            let chunk = Chunk::from_arrow_msg(&message).expect("a chunk");
            let entity = entities.entry(chunk.entity_path().to_string()).or_default();
            entity.rows += chunk.num_rows();
            entity.components.extend(chunk.components().keys().map(ToString::to_string));
            entity.timelines.extend(chunk.timelines().keys().map(ToString::to_string));
        }
        entities
    }
}

#[test]
fn planned_poses_are_drawn_where_the_camera_will_be_and_go_when_they_are_over() {
    let model = sample::solved();
    let mut bench = Bench::new();
    bench.begin();
    for entry in all(&model) {
        bench.write(&entry);
    }
    let solved = model.solve.solved.clone().expect("solved");
    bench.write(&Entry::Solved(solved));
    let tip = model.robot.as_ref().expect("connected").base_from_tip;
    let planned = bench.write(&Entry::Planned(vec![tip; 3]));
    let paths: Vec<&str> = planned.keys().map(String::as_str).collect();
    assert_eq!(paths, ["/base/planned/0", "/base/planned/1", "/base/planned/2"]);
    assert!(planned.values().all(|entity| entity.components.iter().any(|it| it.contains("strips"))), "{planned:?}");
    // One is left; the other two are written again, empty.
    assert_eq!(bench.write(&Entry::Planned(vec![tip])).len(), 3);
    assert_eq!(bench.write(&Entry::Planned(Vec::new())).len(), 1);
}

#[test]
fn boxes_to_keep_clear_of_are_drawn_with_their_names_and_go_with_them() {
    let mut bench = Bench::new();
    bench.begin();
    let post = Obstacle::new("post", Isometry3::translation(0.4, 0.0, 0.2), [0.1, 0.1, 0.4]);
    let scene_obstacles = Arc::new(Surroundings::of(vec![post.clone()]));
    let written = bench.write(&Entry::KeepOut {
        scene_obstacles: Arc::clone(&scene_obstacles),
        own: Arc::new(Surroundings::of(vec![post])),
    });
    let labels = |path: &str| written[path].components.iter().any(|it| it.contains("labels"));
    assert!(labels("/base/around/keep_out") && !labels("/base/around/scene"), "{written:?}");
    let none = bench.write(&Entry::KeepOut { scene_obstacles, own: Arc::default() });
    assert!(none.contains_key("/base/around/keep_out"), "written anew without a box: {none:?}");
}

fn document(model: &Model) -> Entry {
    // Without a folder no files are looked for.
    Entry::Document { folder: None, document: Arc::clone(&model.session.document) }
}

fn with_captures(model: &Model, numbers: &[u32]) -> Entry {
    let mut document = Document::clone(&model.session.document);
    document.captures.retain(|capture| numbers.contains(&capture.id.0));
    Entry::Document { folder: None, document: Arc::new(document) }
}

fn robot(model: &Model) -> Entry {
    let robot = model.robot.as_ref().expect("connected");
    Entry::Robot { sim_time_s: robot.sim_time_s, base_from_tip: robot.base_from_tip, joints_rad: robot.joints_rad }
}

fn all(model: &Model) -> Vec<Entry> {
    let frame = model.frame.as_ref().expect("an image");
    let mut entries = vec![
        Entry::Cell(Arc::new(model.cell.clone().expect("connected"))),
        robot(model),
        document(model),
        Entry::Image { info: Box::new(frame.info.clone()), images: Arc::clone(&frame.images) },
        Entry::Detection(Arc::new(model.detection.clone().expect("seen"))),
    ];
    for (id, observed) in &model.observed {
        entries.push(Entry::Observed { id: *id, observed: observed.clone().expect("read") });
    }
    entries.push(Entry::Solved(Arc::clone(model.solve.current().expect("solved"))));
    entries.push(Entry::Message { severity: Severity::Info, words: "solved".to_owned() });
    entries
}

fn strings(names: &[&str]) -> BTreeSet<String> {
    names.iter().map(ToString::to_string).collect()
}

#[test]
fn a_solved_session_is_at_the_documented_places_with_what_belongs_there() {
    let model = sample::solved();
    let mut bench = Bench::new();
    let mut there = bench.begin();
    for entry in all(&model) {
        for (path, entity) in bench.write(&entry) {
            let merged = there.entry(path).or_default();
            merged.components.extend(entity.components);
            merged.timelines.extend(entity.timelines);
            merged.rows += entity.rows;
        }
    }
    let expected = [
        ("/", "ViewCoordinates:xyz"),
        ("/base", "TransformAxes3D:axis_length"),
        ("/base/tip", "Transform3D:translation"),
        ("/base/trajectory/session/0", "LineStrips3D:strips"),
        ("/base/trajectory/since_connect/0", "LineStrips3D:strips"),
        ("/base/points", "Points3D:positions"),
        ("/base/tip/camera", "Transform3D:quaternion"),
        ("/base/tip/camera/lens", "Pinhole:image_from_camera"),
        ("/base/tip/camera/lens/image", "EncodedImage:blob"),
        ("/base/tip/camera/lens/depth", "EncodedDepthImage:blob"),
        ("/base/tip/camera/lens/corners", "Points2D:positions"),
        ("/base/tip/camera/lens/predicted", "Points2D:positions"),
        ("/base/tip/camera/seen_board", "Transform3D:translation"),
        ("/base/tip/camera/uncertainty_95_x100", "Ellipsoids3D:half_sizes"),
        ("/base/board", "Transform3D:translation"),
        ("/base/board/outline", "LineStrips3D:strips"),
        ("/base/board/corners", "Points3D:positions"),
        ("/base/board/uncertainty_95_x100", "Ellipsoids3D:half_sizes"),
        ("/truth/camera", "Transform3D:translation"),
        ("/truth/camera/lens", "Pinhole:image_from_camera"),
        ("/truth/board", "Transform3D:translation"),
        ("/truth/board/outline", "LineStrips3D:strips"),
        ("/plots/residual/fit", "Scalars:scalars"),
        ("/plots/residual/verification", "Scalars:scalars"),
        ("/plots/expected_error", "Scalars:scalars"),
        ("/plots/joints", "Scalars:scalars"),
        ("/plots/live/search", "Scalars:scalars"),
        ("/log", "TextLog:text"),
        ("/report", "TextDocument:text"),
        ("/result", "TextDocument:text"),
    ];
    for (path, component) in expected {
        let entity = there.get(path).unwrap_or_else(|| panic!("no {path}: {:?}", there.keys()));
        assert!(entity.components.contains(component), "{path}: {:?}", entity.components);
    }
    for id in 1..=sample::FITTED + sample::VERIFYING {
        for (child, component) in [
            ("", "Transform3D:translation"),
            ("/lens", "Pinhole:color"),
            ("/lens/corners", "Points2D:positions"),
            ("/lens/predicted", "Points2D:positions"),
            ("/lens/residuals_x50", "Arrows2D:vectors"),
            ("/seen_board", "Transform3D:translation"),
            ("/predicted_board", "Transform3D:translation"),
        ] {
            let path = format!("/base/captures/{id}{child}");
            let entity = there.get(&path).unwrap_or_else(|| panic!("no {path}"));
            assert!(entity.components.contains(component), "{path}: {:?}", entity.components);
        }
    }
    let lines: BTreeSet<String> = there.values().flat_map(|entity| entity.timelines.iter().cloned()).collect();
    assert_eq!(lines, strings(&["capture", "log_time", "sim_time"]));
}

#[test]
fn what_happens_between_captures_has_no_time_among_them() {
    let model = sample::captured();
    let mut bench = Bench::new();
    bench.begin();
    let live = bench.write(&robot(&model));
    assert_eq!(live["/base/tip"].timelines, strings(&["log_time", "sim_time"]));
    // Robot and camera are elsewhere in simulated time by now, but not among the captures.
    let captured = bench.write(&with_captures(&model, &[1]));
    assert_eq!(captured["/base/tip"].timelines, strings(&["capture", "log_time"]));
}

#[test]
fn only_captures_that_changed_are_written_and_deleted_ones_are_cleared() {
    let model = sample::captured();
    let mut bench = Bench::new();
    bench.begin();
    bench.write(&Entry::Cell(Arc::new(model.cell.clone().expect("connected"))));
    bench.write(&with_captures(&model, &[1, 2, 3]));
    let captures = |entities: &Entities| {
        let names = entities.keys().filter_map(|path| path.strip_prefix("/base/captures/"));
        names.map(|name| name.split('/').next().unwrap_or_default().to_owned()).collect::<BTreeSet<_>>()
    };
    assert!(captures(&bench.write(&with_captures(&model, &[1, 2, 3]))).is_empty());
    let fourth = bench.write(&with_captures(&model, &[1, 2, 3, 4]));
    assert_eq!(captures(&fourth), strings(&["4"]));
    assert_eq!(bench.writer.clock.captures, 4);

    let deleted = bench.write(&with_captures(&model, &[1, 3, 4]));
    assert_eq!(captures(&deleted), strings(&["2"]));
    assert!(deleted["/base/captures/2"].components.contains("Clear:is_recursive"));
    // Undone: it is there again, later than it was cleared.
    let back = bench.write(&with_captures(&model, &[1, 2, 3, 4]));
    assert!(back["/base/captures/2"].components.contains("Transform3D:translation"));
    assert_eq!(bench.writer.clock.captures, 5);

    let mut excluded = Document::clone(&model.session.document);
    excluded.captures.truncate(4);
    excluded.captures[2].excluded = true;
    let changed = bench.write(&Entry::Document { folder: None, document: Arc::new(excluded) });
    assert_eq!(captures(&changed), strings(&["3"]));
}

#[test]
fn another_session_takes_the_place_of_the_first() {
    let model = sample::captured();
    let mut bench = Bench::new();
    bench.begin();
    bench.write(&Entry::Cell(Arc::new(model.cell.clone().expect("connected"))));
    bench.write(&with_captures(&model, &[1, 2]));
    let mut other = Document::clone(&model.session.document);
    other.meta.created = "another day".to_owned();
    other.captures.truncate(1);
    let written = bench.write(&Entry::Document { folder: None, document: Arc::new(other) });
    assert!(written["/base/captures/2"].components.contains("Clear:is_recursive"));
    assert!(written["/base/captures/1"].components.contains("Clear:is_recursive"));
    assert!(written["/base/captures/1"].components.contains("Transform3D:translation"));
    assert_eq!(bench.writer.clock.captures, 3, "time never goes back");
}

#[test]
fn captures_keep_their_simulated_time_unless_they_are_of_a_session_that_was_opened() {
    let model = sample::captured();
    // The sample's captures are at 1 s, 2 s, …, its robot at 12.35 s.
    let times = |writer: &SceneWriter| {
        (1..=3)
            .map(|id| writer.captures.get(CaptureId(id)).and_then(|shown| shown.taken.sim_time_s))
            .collect::<Vec<_>>()
    };
    let mut bench = Bench::new();
    bench.write(&with_captures(&model, &[]));
    bench.write(&Entry::Robot { sim_time_s: 1.5, base_from_tip: Pose::identity(), joints_rad: [0.0; 6].into() });
    bench.write(&with_captures(&model, &[1, 2, 3]));
    assert_eq!(times(&bench.writer), [Some(1.0), Some(2.0), Some(3.0)]);

    let mut bench = Bench::new();
    bench.write(&Entry::Robot { sim_time_s: 1.5, base_from_tip: Pose::identity(), joints_rad: [0.0; 6].into() });
    bench.write(&with_captures(&model, &[1, 2, 3]));
    assert_eq!(times(&bench.writer), [Some(1.0), Some(1.5), Some(1.5)]);
}

#[test]
fn selecting_a_capture_changes_its_frustum_and_no_other() {
    let model = sample::solved();
    let mut bench = Bench::new();
    bench.begin();
    for entry in all(&model) {
        bench.write(&entry);
    }
    let frusta =
        |entities: Entities| entities.into_keys().filter(|path| path.ends_with("/lens")).collect::<BTreeSet<String>>();
    let selected = bench.write(&Entry::Selected(vec![CaptureId(2)]));
    assert!(selected["/selected/corners"].components.contains("Points2D:positions"));
    assert_eq!(frusta(selected), strings(&["/base/captures/2/lens"]));
    let both = bench.write(&Entry::Selected(vec![CaptureId(2), CaptureId(5)]));
    assert_eq!(frusta(both), strings(&["/base/captures/5/lens"]));
    let none = bench.write(&Entry::Selected(Vec::new()));
    assert!(none["/selected"].components.contains("Clear:is_recursive"));
    assert_eq!(frusta(none), strings(&["/base/captures/2/lens", "/base/captures/5/lens"]));
}

#[test]
fn an_image_that_is_gone_is_named_and_everything_else_is_recorded() {
    let model = sample::captured();
    let folder = tempfile::tempdir().expect("a folder");
    let mut bench = Bench::new();
    bench.begin();
    bench.write(&Entry::Cell(Arc::new(model.cell.clone().expect("connected"))));
    let entry =
        Entry::Document { folder: Some(folder.path().to_path_buf()), document: Arc::clone(&model.session.document) };
    let error = bench.writer.write(&bench.rec, &entry).expect_err("no files");
    assert!(matches!(error, RecordError::File { capture: 1, .. }), "{error}");
    let written = bench.written();
    for id in 1..=sample::FITTED + sample::VERIFYING {
        assert!(written.contains_key(&format!("/base/captures/{id}/lens")));
    }
}

#[test]
fn a_board_that_is_lost_is_no_longer_there() {
    let model = sample::solved();
    let mut bench = Bench::new();
    bench.begin();
    for entry in all(&model) {
        bench.write(&entry);
    }
    let base_from_target = model.cell.as_ref().and_then(|cell| cell.truth.as_ref()?.base_from_target).expect("known");
    let estimate = Estimate {
        time_s: 13.0,
        base_from_target,
        covariance: Matrix6::identity() * 1e-8,
        velocity_m_s: Vector3::new(0.03, 0.0, 0.04),
        angular_velocity_rad_s: Vector3::zeros(),
    };
    let tracked = |estimate: Option<Estimate>, time_s: f64| {
        let state = State::Lost { since_s: 12.0 };
        let update = Update { time_s, state, seen: None, with_depth: None, by_depth: None, estimate };
        Entry::Tracked(Arc::new(Tracked { frame: 2, update, latency_s: 0.02, rate_hz: 20.0, error: None, truth: None }))
    };
    let seen = bench.write(&tracked(Some(estimate), 13.0));
    assert!(seen["/base/track/board"].components.contains("Transform3D:translation"));
    assert!(seen["/base/track/board/uncertainty_95_x10"].components.contains("Ellipsoids3D:half_sizes"));
    assert!(seen["/plots/track/speed"].components.contains("Scalars:scalars"));
    let lost = bench.write(&tracked(None, 14.0));
    assert!(lost["/base/track/board"].components.contains("Clear:is_recursive"));
    assert!(!lost.contains_key("/plots/track/speed"));
}

#[test]
fn the_arm_has_its_solids_once_and_its_links_with_every_configuration() {
    let model = sample::tracking();
    let mut bench = Bench::new();
    bench.write(&Entry::Cell(Arc::new(model.cell.clone().expect("connected"))));
    let first = bench.write(&robot(&model));
    assert!(first["/base/arm"].components.contains("Transform3D:translation"));
    assert!(first.contains_key("/base/arm/link_2/housings") && first.contains_key("/base/arm/link_2/tubes"));
    let second = bench.write(&robot(&model));
    assert!(second.contains_key("/base/arm/link_6") && !second.contains_key("/base/arm/link_2/housings"));
    let other = CellFacts { arm: None, ..model.cell.clone().expect("connected") };
    bench.write(&Entry::Cell(Arc::new(other)));
    assert!(!bench.write(&robot(&model)).contains_key("/base/arm"), "an arm of another kind");
}

#[test]
fn a_way_is_written_in_blocks_and_jumps_leave_a_gap() {
    let bench = Bench::new();
    let pen = Pen::new(&bench.rec);
    let mut trail = Trail::new(paths::TRAJECTORY_SESSION, style::WAY);
    // Steps of a millimetre: every other one counts.
    for step in 0..1000 {
        trail.go(pen, &Vector3::new(f64::from(step) * 1.0001e-3, 0.0, 0.0)).expect("written");
    }
    trail.go(pen, &Vector3::new(0.0, 5.0, 0.0)).expect("written");
    let written = bench.written();
    let blocks: Vec<&String> = written.keys().filter(|path| path.starts_with("/base")).collect();
    // 100 points, then 99 new ones and the last of the block before; and one beyond the gap.
    assert_eq!(blocks.len(), 7, "{blocks:?}");
    let rows: usize = blocks.iter().map(|&path| written[path].rows).sum();
    assert_eq!(rows, 501);
}

#[test]
fn an_ellipsoid_has_the_axes_of_its_covariance() {
    let covariance = Matrix3::new(4.0, 1.0, 0.0, 1.0, 3.0, 0.5, 0.0, 0.5, 2.0) * 1e-8;
    let shape = convert::ellipsoid(&covariance, 1.0, style::ESTIMATED);
    let half = shape.half_sizes.expect("sizes").array;
    // 95 % of a Gaussian in space lie within 2.7955 standard deviations.
    let mut expected: Vec<f64> = covariance.symmetric_eigenvalues().iter().map(|v| 2.795_483 * v.sqrt()).collect();
    expected.sort_by(f64::total_cmp);
    let text = format!("{half:?}");
    for value in expected {
        let digits = format!("{:.4}", value as f32 * 1e3);
        let found = text.split(|c: char| !(c.is_ascii_digit() || c == '.' || c == 'e' || c == '-'));
        let numbers: Vec<String> =
            found.filter_map(|word| word.parse::<f32>().ok()).map(|v| format!("{:.4}", v * 1e3)).collect();
        assert!(numbers.contains(&digits), "{digits} in {text}");
    }
}

#[test]
fn names_say_how_much_larger_something_is_drawn() {
    for (name, factor) in [
        (paths::RESIDUALS, style::RESIDUAL_FACTOR),
        (paths::UNCERTAINTY, style::UNCERTAINTY_FACTOR),
        (paths::TRACK_UNCERTAINTY, style::TRACK_UNCERTAINTY_FACTOR),
    ] {
        assert!(name.ends_with(&format!("_x{factor}")), "{name}");
    }
}

#[test]
fn residuals_go_from_green_over_yellow_to_red() {
    let [good, middle, bad] = [0.0, 0.5, 1.0].map(|t| style::residual_colour(t).0.to_array());
    assert!(good[1] > good[0] && bad[0] > bad[1] && middle[0] > good[0] && middle[1] > bad[1]);
    assert_eq!(style::residual_colour(f64::NAN), style::residual_colour(7.0));
}
