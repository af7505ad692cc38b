use std::path::{Path, PathBuf};

use egui::Ui;
use egui::accesskit::Role;
use egui_kittest::kittest::Queryable as _;
use handeye_estimate::handeye::Mode;
use handeye_geometry::progress::CancelToken;
use handeye_import::{
    self as import, AngleUnit, Direction, Fit, ImageFile, Judgement, LengthUnit, Numbers, Pairing, Reading, Recording,
    Role as TrackRole, RotationForm, Sample, Settings, Sights, Stated, Track,
};
use nalgebra::{Isometry3, Vector3};

use super::*;
use crate::testing::driven::Driven;
use handeye_workbench::command::Command;
use handeye_workbench::model::Dialog;
use handeye_workbench::shell;
use handeye_workbench::testing::sample;

fn shown_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    ui.set_max_width(680.0);
    import_ui(ui, model, outbox);
}

fn hypothesis(mode: Mode, direction: Direction, contradictions: &[Text]) -> Hypothesis {
    let reading = Reading { length: LengthUnit::Metre, angle: AngleUnit::Radian, rotation: RotationForm::Xyzw };
    let image_of = (0..4).map(Some).collect();
    Hypothesis {
        source: Source::Stream(0),
        robot: 0,
        pairing: Pairing { rule: "order".into(), text: "in order".into(), image_of, is_by_content: false },
        reading,
        direction,
        target_reading: None,
        mode,
        fit: Some(Fit {
            median_m: 3.5e-4,
            relative: 1e-3,
            median_rad: 1e-3,
            views: 4,
            disagreeing: Vec::new(),
            camera_at_m: 0.08,
            target_at_m: 0.5,
        }),
        same_as: Vec::new(),
        contradictions: contradictions.to_vec(),
    }
}

fn found(hypotheses: Vec<Hypothesis>, verdict: Verdict) -> Found {
    let sample = |k: usize| Sample {
        image: None,
        number: None,
        place: Arc::new(text!("{file}, row {row}", file = "poses.txt", row = k + 1)),
        numbers: Numbers::Quaternion([0.4, 0.1 * k as f64, 0.3, 0.0, 0.0, 0.0, 1.0]),
        joints: Vec::new(),
    };
    let image = |k: usize| ImageFile {
        path: format!("image{k}.png").into(),
        number: Some(k as u64),
        same_as: None,
        stamp_ns: None,
    };
    let stream = Stream {
        name: "image#.png".into(),
        images: (0..4).map(image).collect(),
        size: (640, 480),
        is_depth: false,
        points: None,
    };
    let track = Track {
        name: "poses.txt".into(),
        role: TrackRole::Robot,
        reading_of: None,
        stated: Stated::default(),
        samples: (0..4).map(sample).collect(),
    };
    let recording = Recording {
        root: "/data/tuesday".into(),
        beliefs: vec![stream.text(), track.text()],
        streams: vec![stream],
        tracks: vec![track],
        warnings: vec![Text::verbatim("image7.png is a copy of image3.png, byte by byte")],
        ..Recording::default()
    };
    found_in(recording, Judgement { hypotheses, tried: 912, untried: 0, sources_untried: 0, distance_m: 0.4, verdict })
}

fn found_in(recording: Recording, judgement: Judgement) -> Found {
    let recording = Arc::new(recording);
    Found {
        opened: Arc::clone(&recording),
        recording,
        looked: None,
        given: None,
        settings: Settings::default(),
        judgement: Some(judgement),
        previews: Arc::new(vec![vec![Arc::new(RgbImage::new(16, 12)); 4]]),
    }
}

fn driven(found: Option<Found>, chosen: Option<usize>) -> Driven {
    let mut model = sample::captured();
    model.dialog = Some(Dialog::Import);
    model.import = Some(Box::new(ImportState {
        time: std::time::Duration::from_secs(20),
        path: PathBuf::from("/data/tuesday"),
        number: 1,
        target: String::new(),
        fixed: std::collections::BTreeMap::new(),
        work: None,
        found: found.map(Arc::new),
        trouble: None,
        chosen,
    }));
    let mut driven = Driven::new(shown_ui, model);
    driven.widen(720.0);
    driven.commands();
    driven
}

fn two() -> Found {
    let hypotheses = vec![
        hypothesis(Mode::EyeInHand, Direction::Forward, &[]),
        hypothesis(Mode::EyeToHand, Direction::Inverse, &[]),
    ];
    found(hypotheses, Verdict::Ambiguous(2))
}

#[test]
fn what_the_data_do_not_tell_waits_for_a_person() {
    let mut pane = driven(Some(two()), None);
    assert!(pane.sees("4 images image#.png of 640×480 px, image0.png to image3.png"));
    assert!(pane.sees("4 poses in poses.txt: translation and quaternion"));
    assert!(pane.sees("image7.png is a copy of image3.png, byte by byte"));
    assert!(!pane.is_enabled("Import"), "nothing is taken in silence");
    let second = "2.  0.35 mm  0.057°  eye_to_hand  tip_from_base";
    assert_eq!(pane.click(second), [Command::Import(handeye_workbench::import::Command::ChooseHypothesis(1))]);
    pane.model().import.as_deref_mut().expect("open").chosen = Some(1);
    pane.steps();
    assert!(pane.sees("0 views disagree"));
    assert_eq!(pane.click("Import"), [Command::Import(handeye_workbench::import::Command::ConvertRecording)]);
}

#[test]
fn the_camera_alone_is_calibrated_once_the_target_is_named() {
    let pane = driven(Some(without_meaning(None)), None);
    assert!(pane.sees("The camera alone can be calibrated with these images."));
    assert!(!pane.is_enabled("Calibrate the camera alone"));
    let given = handeye_workbench::arguments::of_text("10x7x15").expect("a target");
    let mut pane = driven(Some(without_meaning(Some(given))), None);
    assert_eq!(
        pane.click("Calibrate the camera alone"),
        [Command::Import(handeye_workbench::import::Command::ConvertImages)]
    );
}

fn without_meaning(given: Option<handeye_geometry::targets::TargetSpec>) -> Found {
    Found { judgement: None, given, ..two() }
}

#[test]
fn what_is_known_is_fixed_and_given_back_to_the_data() {
    let mut pane = driven(Some(two()), None);
    pane.harness.get_by_role_and_label(Role::ComboBox, "Where the camera sits").click();
    pane.steps();
    let value = Some("eye_to_hand".to_owned());
    assert_eq!(
        pane.click("eye_to_hand"),
        [Command::Import(handeye_workbench::import::Command::FixConvention { key: "mode".to_owned(), value })]
    );
}

/// The command line names the option; a user at the window needs a field.
#[test]
fn the_size_of_images_that_no_file_tells_is_typed() {
    let corners = |size: (u32, u32)| {
        let name = "corners.json".to_owned();
        let points = Some(vec![Some(vec![[1.0, 2.0]]); 4]);
        let recording = Recording {
            streams: vec![Stream { name, images: Vec::new(), size, is_depth: false, points }],
            ..Recording::default()
        };
        let trouble = import::size_of_points(&recording.streams[0], None).err();
        let found = found_in(recording, two().judgement.expect("judged"));
        let mut pane = driven(Some(Found { judgement: None, previews: Arc::default(), ..found }), None);
        pane.model().import.as_deref_mut().expect("open").trouble = trouble;
        pane.steps();
        pane
    };
    let reported = "width and height of the images in pixels";
    assert!(!corners((640, 480)).sees(reported));
    let mut pane = corners((0, 0));
    assert!(pane.sees(reported) && pane.sees("no file says how large the images were"));
    pane.harness.get_by_role_and_label(Role::TextInput, "Image size").click();
    pane.steps();
    pane.harness.get_by_role_and_label(Role::TextInput, "Image size").type_text("1280x720");
    pane.steps();
    let value = Some("1280x720".to_owned());
    assert_eq!(
        pane.press(egui::Key::Enter),
        [Command::Import(handeye_workbench::import::Command::FixConvention { key: "image_size".to_owned(), value })]
    );
    pane.model().view.language = Language::Chinese;
    pane.steps();
    assert!(pane.sees("没有文件说明图像的大小"));
}

#[test]
fn what_was_typed_is_not_offered_as_a_choice_as_well() {
    let mut pane = driven(Some(two()), None);
    for (key, value) in [("image_size", "640x480"), ("arm", "ur5e")] {
        pane.model().import.as_deref_mut().expect("open").fixed.insert(key.to_owned(), value.to_owned());
        pane.steps();
        assert!(!pane.sees("Convention") && !pane.sees(value), "{key}");
    }
}

#[test]
fn a_recording_that_is_contradicted_or_not_read_says_why() {
    let why = Text::verbatim("image2.png fits the pose of poses.txt, row 3");
    let wrong = hypothesis(Mode::EyeInHand, Direction::Forward, &[why]);
    let mut pane = driven(Some(found(vec![wrong], Verdict::Unexplained)), Some(0));
    assert!(pane.sees("None of 912 explains the recording"));
    assert!(pane.sees("image2.png fits the pose of poses.txt, row 3"));
    pane.model().import.as_deref_mut().expect("open").trouble = Some(Text::verbatim("poses.txt: cannot be read"));
    pane.steps();
    assert!(pane.sees("poses.txt: cannot be read"));
}

/// An image that was copied, and two poses of the target that were exchanged.
fn spoilt(folder: &Path) {
    const VIEWS: usize = 12;
    for (k, shade) in [10, 20, 30, 10].into_iter().enumerate() {
        let image = RgbImage::from_pixel(8, 6, image::Rgb([shade; 3]));
        image.save(folder.join(format!("image{k}.png"))).expect("written");
    }
    let base_from_tip = |k: usize| {
        let of = |rate: f64, phase: f64| (rate * k as f64 + phase).sin();
        let at = Vector3::new(0.4 + 0.1 * of(0.7, 0.0), 0.1 * of(1.1, 1.0), 0.5 + 0.1 * of(1.7, 2.0));
        Isometry3::new(at, 0.5 * Vector3::new(of(1.3, 0.5), of(0.9, 2.0), of(2.1, 1.0)))
    };
    let tip_from_camera = Isometry3::new(Vector3::new(0.03, -0.05, 0.08), Vector3::new(0.2, -0.3, 1.5));
    let base_from_target = Isometry3::new(Vector3::new(0.9, 0.1, 0.1), Vector3::new(1.0, 2.0, 0.5));
    let camera_from_target = |k: usize| (base_from_tip(k) * tip_from_camera).inverse() * base_from_target;
    let mut order: Vec<usize> = (0..VIEWS).collect();
    order.swap(2, 8);
    let row = |pose: Isometry3<f64>| {
        let (t, q) = (pose.translation.vector, pose.rotation.coords);
        format!("{} {} {} {} {} {} {}\n", t.x, t.y, t.z, q.x, q.y, q.z, q.w)
    };
    let put = |name: &str, rows: Vec<String>| std::fs::write(folder.join(name), rows.concat()).expect("written");
    put("poses.txt", (0..VIEWS).map(|k| row(base_from_tip(k))).collect());
    put("target_poses.txt", order.iter().map(|k| row(camera_from_target(*k))).collect());
}

#[test]
fn what_is_wrong_with_a_recording_is_said_in_chinese_to_its_end() {
    let folder = tempfile::tempdir().expect("a folder");
    spoilt(folder.path());
    let recording = import::open(folder.path()).expect("a recording");
    let mut settings = Settings::default();
    for known in ["mode=eye_in_hand", "pose=base_from_tip", "length_unit=m", "poses=poses.txt"] {
        settings.set(known).expect("a choice");
    }
    let judgement =
        import::judge(&recording, &Sights::default(), &settings, &CancelToken::default()).expect("hypotheses");
    let chosen = judgement.hypotheses.iter().position(|h| !h.contradictions.is_empty()).expect("one is contradicted");
    let [warnings, contradictions] = [&recording.warnings, &judgement.hypotheses[chosen].contradictions]
        .map(|reported| reported.iter().map(|text| text.in_language(Language::Chinese)).collect::<Vec<_>>());
    let mut pane = driven(Some(found_in(recording, judgement)), Some(chosen));
    pane.model().view.language = Language::Chinese;
    pane.steps();
    assert!(!warnings.is_empty() && !contradictions.is_empty());
    for reported in warnings.iter().chain(&contradictions) {
        assert!(pane.sees(reported), "{reported}");
        let names = ["image3.png", "image0.png", "target_poses.txt", "poses.txt", "mm"];
        let words = names.iter().fold(reported.clone(), |words, name| words.replace(name, ""));
        assert!(!words.contains(|letter: char| letter.is_ascii_alphabetic()), "{reported}");
    }
    assert!(contradictions[0].contains("poses.txt，第 3 行"), "{contradictions:?}");
}

#[test]
fn progress_is_shown_and_can_be_ended() {
    let mut pane = driven(None, None);
    pane.model().import.as_deref_mut().expect("open").work = Some(ImportWork::Looking(3, 20));
    pane.steps();
    assert!(pane.sees("3 of 20 images looked at"));
    assert!(!pane.is_enabled("Import"));
    assert_eq!(pane.click("Cancel"), [Command::Shell(shell::Command::SetDialog(None))]);
}

#[test]
fn nothing_is_cut_off_in_both_languages() {
    for language in Language::ALL {
        let mut pane = driven(Some(two()), Some(0));
        pane.model().view.language = language;
        pane.steps();
        assert!(pane.nothing_is_cut_off(), "{language:?}");
    }
}
