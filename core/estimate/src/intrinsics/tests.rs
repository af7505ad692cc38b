use nalgebra::{Isometry3, Matrix2, Vector2, Vector3};

use super::*;
use handeye_geometry::planar_pose::PoseError;
use handeye_geometry::planar_pose::mirror::mirrored;
use handeye_geometry::planar_pose::refine::refine;
use handeye_geometry::targets::Grid;
use handeye_geometry::targets::observation::Corner;
use handeye_geometry::view_equations::Whitener;
use handeye_simulate::BoardViews;

const SIZE: (u32, u32) = (640, 480);
const BROWN: Distortion = Distortion::BrownConrady([-0.21, 0.12, 0.001, -0.002, -0.02]);

fn camera(distortion: Distortion) -> Intrinsics {
    Intrinsics { distortion, fy: 575.0, cx: 322.4, cy: 236.1, ..Intrinsics::pinhole(640, 480, 581.0) }
}

const GRID: Grid = Grid { columns: 10, rows: 7, square_m: 0.03 };
const TARGET: TargetSpec = TargetSpec::Chessboard(GRID);

fn board() -> BoardPoints {
    BoardPoints::new(&TARGET.points())
}

/// Views over most of the image.
fn scene(camera: Intrinsics, noise_px: f64) -> BoardViews {
    let offset_px = (0.15 * camera.fx, 0.1 * camera.fy);
    BoardViews { offset_px, ..BoardViews::new(camera, GRID, noise_px) }
}

fn solved(views: &[Vec<Corner>], options: &Options) -> Result<Found, IntrinsicsError> {
    let seen: Vec<SeenView<'_>> = views.iter().map(|v| SeenView::unweighted(v)).collect();
    solve(&seen, &TARGET, SIZE, options, &CancelToken::default())
}

/// The largest distance of a parameter in units of its standard deviation.
fn off_in_sigmas(a: &Found, b: &Found) -> f64 {
    let (pa, pb, covariance) = (a.intrinsics.parameters(), b.intrinsics.parameters(), a.covariance());
    (0..pa.len()).map(|i| (pa[i] - pb[i]).abs() / covariance[(i, i)].sqrt()).fold(0.0, f64::max)
}

#[test]
fn the_order_of_the_views_changes_nothing_but_rounding() {
    for distortion in [BROWN, Distortion::Fisheye([-0.02, 0.004, -0.003, 0.0005])] {
        let mut views = scene(camera(distortion), 0.1).corners(12, 3);
        let a = solved(&views, &Options::new(distortion)).expect("solves");
        assert_eq!(a, solved(&views, &Options::new(distortion)).expect("solves"), "the same input gives the same bits");
        views.reverse();
        views.rotate_left(5);
        let b = solved(&views, &Options::new(distortion)).expect("solves");
        assert!((b.cost / a.cost - 1.0).abs() < 1e-12, "{} {}", a.cost, b.cost);
        assert!(off_in_sigmas(&a, &b) < 1e-5, "{}", off_in_sigmas(&a, &b));
    }
}

#[test]
fn where_it_starts_does_not_matter() {
    // From three views and from many, with noise enough to make the homographies poor.
    for (count, noise_px) in [(3, 0.1), (4, 0.5), (8, 0.5)] {
        for seed in 0..10 {
            let views = scene(camera(Distortion::None), noise_px).corners(count, 100 + seed);
            let blind = solved(&views, &Options::new(Distortion::None)).expect("solves");
            let guided = Options { start: Some(camera(Distortion::None)), ..Options::new(Distortion::None) };
            let guided = solved(&views, &guided).expect("solves");
            assert!((blind.cost / guided.cost - 1.0).abs() < 1e-9, "{count} {seed}: {} {}", blind.cost, guided.cost);
        }
    }
}

#[test]
fn a_wide_fisheye_is_found_without_a_start() {
    // 150° of view along the diagonal, with the target out to its rim.
    let distortion = Distortion::Fisheye([0.05, -0.01, 0.004, -0.001]);
    let truth = Intrinsics { fx: 300.0, fy: 300.0, ..camera(distortion) };
    let mut scene = scene(camera(distortion), 0.1);
    (scene.camera, scene.distance_m) = (truth, (0.15, 0.3));
    let found = solved(&scene.corners(20, 5), &Options::new(distortion)).expect("solves");
    let covariance = found.covariance();
    for (i, (got, want)) in found.intrinsics.parameters().iter().zip(truth.parameters()).enumerate() {
        let sigma = covariance[(i, i)].sqrt();
        assert!((got - want).abs() < 4.0 * sigma, "parameter {i}: {got} for {want} ± {sigma}");
    }
    assert!((found.sigma - 0.1).abs() < 0.01, "{}", found.sigma);
}

#[test]
fn a_bent_target_misleads_a_flat_model_and_not_one_that_is_free_to_bend() {
    let mut scene = scene(camera(BROWN), 0.1);
    scene.shape = BoardShape { warp_m: [0.002, -0.001], scale: 1.0 };
    let views = scene.corners(20, 7);
    let options = Options { bend: Bend::Always, ..Options::new(BROWN) };
    let (flat, bent) = (solved(&views, &Options::new(BROWN)).expect("flat"), solved(&views, &options).expect("bent"));
    assert!(flat.cost > 1.5 * bent.cost, "{} {}", flat.cost, bent.cost);
    assert_eq!(flat.shape, BoardShape::default());
    assert!((bent.sigma - 0.1).abs() < 0.01, "{}", bent.sigma);
    let covariance = bent.covariance();
    assert_eq!(covariance.shape(), (11, 11));
    let truth = [camera(BROWN).parameters(), scene.shape.warp_m.to_vec()].concat();
    let found = [bent.intrinsics.parameters(), bent.shape.warp_m.to_vec()].concat();
    for (i, (got, want)) in found.iter().zip(&truth).enumerate() {
        let sigma = covariance[(i, i)].sqrt();
        assert!((got - want).abs() < 4.0 * sigma, "unknown {i}: {got} for {want} ± {sigma}");
    }
    assert!(covariance[(9, 9)].sqrt() < 1e-4, "a tenth of a millimetre is seen");
}

#[test]
fn what_a_bend_would_do_is_known_without_a_fit_that_has_it() {
    let mut scene = scene(camera(BROWN), 0.1);
    scene.shape = BoardShape { warp_m: [0.0002, -0.0001], scale: 1.0 };
    let views = scene.corners(12, 21);
    let flat = solved(&views, &Options::new(BROWN)).expect("flat");
    let bent = solved(&views, &Options { bend: Bend::Always, ..Options::new(BROWN) }).expect("bent");
    let seen: Vec<SeenView<'_>> = views.iter().map(|v| SeenView::unweighted(v)).collect();
    let (board, cancel) = (board(), CancelToken::default());
    let free = FreeParameters { lens: true, ..FreeParameters::default() };
    let problem = Problem { views: &seen, board: &board, free, cancel: &cancel };
    let poses: Vec<Isometry3<f64>> = flat.camera_from_target.iter().map(|p| *p.isometry()).collect();
    let estimate = Estimate { intrinsics: flat.intrinsics, shape: flat.shape, poses, mirrored: Vec::new() };
    let columns = FreeParameters { warp: true, ..free };
    let evidence = Evidence::new(&problem, &estimate, columns).expect("in front");
    let covariance = bent.covariance();
    let (from, to) = (flat.intrinsics.parameters(), bent.intrinsics.parameters());
    for i in 0..4 {
        // The nonlinear part for a fifth of a millimetre is small against the noise.
        let off = evidence.left_out(i) - (to[i] - from[i]);
        assert!(off.abs() < 0.05 * covariance[(i, i)].sqrt(), "{i}: {off}");
    }
    assert!(evidence.left_out(0).abs() > 0.5 * covariance[(0, 0)].sqrt(), "it would move the lens");
    let deflection = evidence.deflection(&problem, &estimate);
    for i in 0..2 {
        let sigma = covariance[(9 + i, 9 + i)].sqrt();
        let off = deflection.warp_m[i] - bent.shape.warp_m[i];
        assert!(off.abs() < 0.05 * sigma, "{i}: {off} ± {sigma}");
    }
}

#[test]
fn independent_corners_scatter_as_much_as_expected() {
    const SESSIONS: u64 = 20;
    let (mut ratio, mut freedom) = (0.0, 0.0);
    for seed in 0..SESSIONS {
        let views = scene(camera(BROWN), 0.1).corners(8, 60 + seed);
        let found = solved(&views, &Options { bend: Bend::IfShown, ..Options::new(BROWN) }).expect("solves");
        assert_eq!(found.shape, BoardShape::FLAT);
        ratio += found.stated.ratio / SESSIONS as f64;
        freedom += found.stated.degrees_of_freedom / SESSIONS as f64;
    }
    // Four numbers of eight views, less those that the fit uses up.
    assert!((8.0..28.0).contains(&freedom), "{freedom}");
    let deviation = (2.0 / freedom / SESSIONS as f64).sqrt();
    assert!((ratio - 1.0).abs() < 3.5 * deviation, "{ratio} ± {deviation}");
}

#[test]
fn corners_seen_in_part_of_the_views_are_enough() {
    let mut views = scene(camera(BROWN), 0.1).corners(15, 8);
    for (i, view) in views.iter_mut().enumerate() {
        view.retain(|c| (c.index + i) % 3 != 0 && c.index % 10 < 4 + i % 7);
    }
    views[2].truncate(4);
    views[2] = vec![views[3][0], views[3][1], views[3][views[3].len() - 1], views[3][views[3].len() - 2]];
    let found = solved(&views, &Options::new(BROWN)).expect("solves");
    for (i, (got, want)) in found.intrinsics.parameters().iter().zip(camera(BROWN).parameters()).enumerate() {
        let sigma = found.covariance()[(i, i)].sqrt();
        assert!((got - want).abs() < 4.5 * sigma, "parameter {i}: {got} for {want} ± {sigma}");
    }
}

#[test]
fn a_corner_of_little_weight_counts_little_and_one_of_none_not_at_all() {
    let mut views = scene(camera(Distortion::None), 0.1).corners(8, 9);
    let options = Options::new(Distortion::None);
    let without: Vec<Vec<Corner>> = views.iter().map(|v| v[1..].to_vec()).collect();
    for view in &mut views {
        view[0].px += Vector2::new(30.0, -20.0);
    }
    let mut each = vec![Matrix2::identity(); 70];
    each[0] = Matrix2::zeros();
    let whitener = Whitener::Each(each);
    let seen: Vec<SeenView<'_>> = views.iter().map(|v| SeenView { corners: v, whitener: &whitener }).collect();
    let weighted = solve(&seen, &TARGET, SIZE, &options, &CancelToken::default()).expect("solves");
    let without = solved(&without, &options).expect("solves");
    assert!((weighted.cost / without.cost - 1.0).abs() < 1e-9, "{} {}", weighted.cost, without.cost);
    assert!(off_in_sigmas(&without, &weighted) < 1e-4);
    assert!(weighted.rms_px[0] > 1.0, "residuals are told without weights");
}

#[test]
fn a_pose_that_began_as_its_mirror_image_is_turned_round() {
    let mut scene = scene(camera(Distortion::None), 0.2);
    scene.distance_m = (1.5, 2.0);
    let views = scene.corners(10, 10);
    let found = solved(&views, &Options::new(Distortion::None)).expect("solves");
    let seen: Vec<SeenView<'_>> = views.iter().map(|v| SeenView::unweighted(v)).collect();
    let (board, cancel) = (board(), CancelToken::default());
    let free = FreeParameters { lens: true, ..FreeParameters::default() };
    let problem = Problem { views: &seen, board: &board, free, cancel: &cancel };
    let poses: Vec<Isometry3<f64>> = found.camera_from_target.iter().map(|p| *p.isometry()).collect();
    let (intrinsics, shape) = (found.intrinsics, found.shape);
    let mut estimate = Estimate { intrinsics, shape, poses: poses.clone(), mirrored: Vec::new() };
    assert!(
        !adjust::mirror_poses(&problem, &mut estimate).expect("not cancelled"),
        "the optimum is the better of both"
    );
    // Its mirror image, descended to its minimum.
    let middle = Vector3::new(0.135, 0.09, 0.0);
    let start = mirrored(&poses[4], &middle).expect("it is tilted");
    let wrong = refine(&adjust::seen(&seen[4], &board, &found.shape, &found.intrinsics), &start, 50).expect("in front");
    assert!(wrong.pose.rotation.angle_to(&poses[4].rotation) > 0.1, "there are two minima");
    assert!(wrong.squared_px > 70.0 * found.rms_px[4].powi(2));
    estimate.poses[4] = wrong.pose;
    assert!(adjust::mirror_poses(&problem, &mut estimate).expect("not cancelled"));
    assert!(estimate.poses[4].rotation.angle_to(&poses[4].rotation) < 1e-6);
    let other = estimate.mirrored[4].expect("two minima are known");
    assert!(other.rotation.angle_to(&wrong.pose.rotation) < 1e-6, "the other one is where it came from");
}

#[test]
fn unusable_input_is_refused_by_name() {
    let views = scene(camera(Distortion::None), 0.1).corners(5, 11);
    let options = Options::new(Distortion::None);
    assert_eq!(solved(&views[..2], &options), Err(IntrinsicsError::TooFewViews { got: 2, need: 3 }));
    let with = |change: &dyn Fn(&mut Vec<Corner>)| {
        let mut views = views.clone();
        change(&mut views[3]);
        solved(&views, &options)
    };
    assert_eq!(with(&|v| v.truncate(3)), Err(PoseError::TooFewCorners { view: 3, got: 3, need: 4 }.into()));
    assert!(matches!(with(&|v| v[0].index = 70), Err(IntrinsicsError::Corners(PoseError::BadCorner { view: 3, .. }))));
    assert!(matches!(
        with(&|v| v[0].px.x = f64::NAN),
        Err(IntrinsicsError::Corners(PoseError::BadCorner { view: 3, .. }))
    ));
    let row = Err(PoseError::CollinearCorners { view: 3 }.into());
    assert_eq!(with(&|v| v.truncate(6)), row, "six corners of one row fix no pose");
    let bad = Options { start: Some(Intrinsics::pinhole(640, 480, -1.0)), ..options };
    assert!(matches!(solved(&views, &bad), Err(IntrinsicsError::BadStart { .. })));
    let cancel = CancelToken::default();
    cancel.cancel();
    let seen: Vec<SeenView<'_>> = views.iter().map(|v| SeenView::unweighted(v)).collect();
    assert_eq!(solve(&seen, &TARGET, SIZE, &options, &cancel), Err(IntrinsicsError::Cancelled));
    let whitener = Whitener::Each(vec![Matrix2::identity()]);
    let uneven = vec![SeenView { corners: &views[0], whitener: &whitener }; 3];
    let error = solve(&uneven, &TARGET, SIZE, &options, &CancelToken::default());
    assert_eq!(error, Err(IntrinsicsError::BadWeights { view: 0, weights: 1, corners: 70 }));
}
