//! Recordings of other projects with known conventions: which hypothesis comes first, and its residual.

use std::fs;
use std::path::{Path, PathBuf};

use tempfile::TempDir;

use super::*;
use handeye_detect::detect;
use handeye_estimate::CameraKnowledge;
use handeye_geometry::progress::CancelToken;
use handeye_geometry::targets::{Charuco, Grid, TargetSpec};
use handeye_geometry::testing::data_folder;
use handeye_wording::Text;

/// A recording, and what is known of it.
struct Sample {
    files: &'static [&'static str],
    target: Option<TargetSpec>,
    settings: &'static [&'static str],
    /// Conventions of the first hypothesis.
    first: &'static [(&'static str, &'static str)],
    /// Largest error of the result, millimetres.
    limit_mm: f64,
    verdict: Verdict,
}

const fn board(columns: usize, rows: usize, square_m: f64) -> TargetSpec {
    TargetSpec::Chessboard(Grid { columns, rows, square_m })
}

fn samples() -> Vec<Sample> {
    let charuco = Charuco {
        columns: 4,
        rows: 6,
        square_m: 0.033,
        marker_m: 0.02,
        dictionary: "6x6_250".parse().expect("known"),
        layout: None,
    };
    let decided =
        |files: &'static [&'static str],
         target: Option<TargetSpec>,
         settings: &'static [&'static str],
         first: &'static [(&'static str, &'static str)],
         limit_mm: f64| Sample { files, target, settings, first, limit_mm, verdict: Verdict::Decided };
    vec![
        decided(
            &["importers/table_eye_in_hand"],
            Some(board(11, 8, 0.02)),
            &["mode=eye_in_hand"],
            &[("rotation", "euler_zyx_321"), ("pose", "base_from_tip"), ("length_unit", "m"), ("angle_unit", "rad")],
            4.0,
        ),
        decided(
            &["importers/json_per_pose_rgbd/Hand-Eye-Data"],
            Some(TargetSpec::Charuco(charuco)),
            &["mode=eye_in_hand"],
            &[("rotation", "rotation_vector"), ("pose", "base_from_tip"), ("length_unit", "m"), ("pairing", "file")],
            4.0,
        ),
        decided(
            &[
                "importers/easy_handeye2/easy_handeye2_demo_eih.samples",
                "importers/easy_handeye2/easy_handeye2_demo_eih.calib",
            ],
            None,
            &[],
            &[("mode", "eye_in_hand"), ("pose", "base_from_tip")],
            2.0,
        ),
        decided(
            &[
                "importers/easy_handeye2/easy_handeye2_demo_eob.samples",
                "importers/easy_handeye2/easy_handeye2_demo_eob.calib",
            ],
            None,
            &[],
            &[("mode", "eye_to_hand"), ("pose", "tip_from_base")],
            2.0,
        ),
        decided(
            &["moveit_pose_samples/pose_samples.json"],
            None,
            &[],
            &[("mode", "eye_to_hand"), ("pose", "base_from_tip")],
            10.0,
        ),
        decided(
            &["visp_franka_eye_in_hand"],
            None,
            &[],
            &[("mode", "eye_in_hand"), ("pose", "base_from_tip"), ("rotation", "rotation_vector")],
            10.0,
        ),
        decided(
            &["caliban_no_curv/images", "caliban_no_curv/robot_cali.txt"],
            Some(board(14, 9, 0.0121)),
            &["mode=eye_in_hand"],
            &[("pose", "tip_from_base"), ("length_unit", "mm"), ("pairing", "row+0")],
            0.2,
        ),
        // Where the place of the camera is not given, both are listed. No data distinguish them; this rendered board is
        // nearer to the base than the camera to the tip, unlike any real one, so the more likely one is wrong.
        Sample {
            files: &["caliban_no_curv/images", "caliban_no_curv/robot_cali.txt"],
            target: Some(board(14, 9, 0.0121)),
            settings: &[],
            first: &[("length_unit", "mm"), ("pairing", "row+0")],
            limit_mm: 0.2,
            verdict: Verdict::Ambiguous(2),
        },
        Sample {
            files: &["importers/table_eye_in_hand"],
            target: Some(board(11, 8, 0.02)),
            settings: &[],
            first: &[("mode", "eye_in_hand"), ("pose", "base_from_tip"), ("rotation", "euler_zyx_321")],
            limit_mm: 4.0,
            verdict: Verdict::Ambiguous(2),
        },
    ]
}

/// The sample without what this project has added to it.
fn copied(data: &Path, files: &[&str]) -> (TempDir, PathBuf) {
    let home = tempfile::tempdir().expect("a folder");
    let folder = home.path().join("recording");
    fs::create_dir(&folder).expect("made");
    for file in files {
        let from = data.join(file);
        let members: Vec<PathBuf> = if from.is_dir() {
            fs::read_dir(&from).expect("listed").map(|entry| entry.expect("entry").path()).collect()
        } else {
            vec![from]
        };
        for member in members.into_iter().filter(|member| member.is_file()) {
            let name = member.file_name().expect("a name").to_string_lossy().into_owned();
            let is_ours = ["dataset.toml", "poses.csv", "corners.csv", "points.csv", "views.json", "README.md"];
            if !is_ours.contains(&&*name) {
                fs::copy(&member, folder.join(name)).expect("copied");
            }
        }
    }
    (home, folder)
}

mod slow {
    use super::*;

    #[test]
    fn of_recordings_whose_conventions_are_known_the_right_hypothesis_comes_first() {
        let Some(data) = data_folder() else { return };
        for sample in samples() {
            let (_home, folder) = copied(&data, sample.files);
            let recording = open(&folder).unwrap_or_else(|e| panic!("{e}"));
            let mut settings = Settings::default();
            sample.settings.iter().for_each(|s| settings.set(s).expect("a choice"));
            let target = sample.target.or_else(|| recording.targets.first().map(|found| found.target));
            let sight = |stream: &Stream| {
                let target = target.filter(|_| !stream.is_depth)?;
                let look = |image: &ImageFile| {
                    let image = handeye_images::load_gray(&recording.root.join(&image.path)).expect("an image");
                    detect(&image, &target).expect("looked")
                };
                let corners: Vec<_> = stream.images.iter().map(look).collect();
                let (camera, _) = chosen_camera(&recording, stream.size, &settings).expect("a choice");
                let camera = camera.map_or(CameraKnowledge::NOTHING, |c| CameraKnowledge::Fixed(c.intrinsics));
                Sight::of_corners(target, stream.size, camera, &corners).ok()
            };
            let sights = Sights { streams: recording.streams.iter().map(sight).collect(), target };
            let judgement = judge(&recording, &sights, &settings, &CancelToken::default())
                .unwrap_or_else(|e| panic!("{e}: {:#?}", recording.beliefs));
            let best = &judgement.hypotheses[0];
            let conventions = best.conventions(&recording);
            let shown: Vec<String> = judgement
                .hypotheses
                .iter()
                .take(4)
                .map(|h| {
                    let of: Vec<String> =
                        h.conventions(&recording).iter().map(|c| format!("{}={}", c.key, c.value)).collect();
                    let fit = h.fit.as_ref().map_or(f64::NAN, |fit| fit.median_m * 1e3);
                    let why: Vec<String> = h.contradictions.iter().map(Text::to_string).collect();
                    format!("{fit:.2} mm {} {why:?}", of.join(" "))
                })
                .collect();
            let what = format!("{:?} {:?}\n{}", sample.files, sample.settings, shown.join("\n"));
            println!("{what}\n{:?} of {}", judgement.verdict, judgement.tried);
            for (key, value) in sample.first {
                let got = conventions.iter().find(|c| c.key == *key).map(|c| c.value.as_str());
                assert_eq!(got, Some(*value), "{key} of {what}");
            }
            let fit = best.fit.as_ref().expect("a fit");
            assert!(fit.median_m * 1e3 < sample.limit_mm, "{what}");
            assert_eq!(judgement.verdict, sample.verdict, "{what}");
        }
    }
}
