use super::*;

const MOVING: [BoardPath; 3] = [BoardPath::Circle, BoardPath::FigureEight, BoardPath::RandomWalk];

fn spec(path: BoardPath) -> BoardMotionSpec {
    BoardMotionSpec { path, ..BoardMotionSpec::default() }
}

/// Places every hundredth of a second.
fn places(course: &Course, from_s: f64, seconds: f64) -> Vec<Vector3<f64>> {
    let count = (seconds * 100.0) as usize;
    (0..=count).map(|i| course.offset(from_s + i as f64 * 0.01).translation.vector).collect()
}

#[test]
fn paths_have_the_mean_speed_that_was_asked_for() {
    for path in MOVING {
        for (speed_m_s, size_m) in [(0.1, 0.04), (0.02, 0.1), (0.3, 0.03)] {
            let course = Course::new(&BoardMotionSpec { speed_m_s, size_m, ..spec(path) }, 5);
            let seconds = (100.0 * TAU * size_m / speed_m_s).round();
            let places = places(&course, course.ease_s, seconds);
            let length: f64 = places.windows(2).map(|pair| (pair[1] - pair[0]).norm()).sum();
            let speed = length / seconds;
            assert!((speed / speed_m_s - 1.0).abs() < 0.02, "{path}: {speed} m/s instead of {speed_m_s} m/s");
        }
    }
}

#[test]
fn a_circle_is_as_large_and_as_fast_as_asked_at_every_instant() {
    let course = Course::new(&spec(BoardPath::Circle), 1);
    let places = places(&course, 2.0, 5.0);
    for pair in places.windows(2) {
        assert!((pair[0].norm() - 0.04).abs() < 1e-12 && pair[0].z == 0.0);
        let speed = (pair[1] - pair[0]).norm() / 0.01;
        assert!((speed - 0.1).abs() < 2e-4, "{speed}");
    }
}

#[test]
fn paths_begin_at_rest_and_go_on_without_jumps_in_position_velocity_or_turn() {
    for path in MOVING {
        for seed in 0..20 {
            let course = Course::new(&spec(path), seed);
            assert_eq!(course.offset(0.0), Isometry3::identity());
            let poses: Vec<Isometry3<f64>> = (0..3000).map(|i| course.offset(f64::from(i) * 0.01)).collect();
            let steps: Vec<Vector3<f64>> =
                poses.windows(2).map(|pair| (pair[1].translation.vector - pair[0].translation.vector) / 0.01).collect();
            assert!(steps[0].norm() < 0.001, "{path}: {} m/s in the first hundredth of a second", steps[0].norm());
            let fastest = steps.iter().map(Vector3::norm).fold(0.0, f64::max);
            assert!(fastest < 0.1 * 3.0, "{path}: {fastest} m/s");
            for pair in steps.windows(2) {
                let acceleration = (pair[1] - pair[0]).norm() / 0.01;
                // Twice the band's highest frequency on every axis at once.
                assert!(acceleration < 2.5, "{path}: {acceleration} m/s²");
            }
            for pair in poses.windows(2) {
                let turned_deg = pair[0].rotation.angle_to(&pair[1].rotation).to_degrees();
                assert!(turned_deg < 0.3, "{path}: {turned_deg}° in a hundredth of a second");
            }
        }
    }
}

#[test]
fn paths_stay_within_their_size_and_tilt() {
    for path in BoardPath::ALL {
        for seed in 0..20 {
            let course = Course::new(&spec(path), seed);
            let poses = (0..3000).map(|i| course.offset(f64::from(i) * 0.05));
            let (mut farthest, mut most_turned) = ([0.0_f64; 3], 0.0_f64);
            for pose in poses {
                for (most, value) in farthest.iter_mut().zip(pose.translation.vector.iter()) {
                    *most = most.max(value.abs());
                }
                most_turned = most_turned.max(pose.rotation.angle().to_degrees());
            }
            assert!(farthest[0] <= 0.04 + 1e-12 && farthest[1] <= 0.04 + 1e-12 && farthest[2] <= 0.02 + 1e-12);
            assert!(most_turned <= 3.0 + 1e-9, "{path}: {most_turned}°");
            if path == BoardPath::Still {
                assert_eq!((farthest, most_turned), ([0.0; 3], 0.0));
            } else {
                assert!(farthest[0] > 0.02 && most_turned > 0.5, "{path} moves: {farthest:?} m, {most_turned}°");
            }
            if path == BoardPath::RandomWalk {
                assert!(farthest[2] > 0.01, "out of the plane too");
            }
        }
    }
}

#[test]
fn a_seed_decides_the_walk_and_no_tilt_means_none() {
    let flat = BoardMotionSpec { tilt_deg: 0.0, ..spec(BoardPath::RandomWalk) };
    assert_eq!(Course::new(&flat, 3).offset(7.7), Course::new(&flat, 3).offset(7.7));
    assert_ne!(Course::new(&flat, 3).offset(7.7), Course::new(&flat, 4).offset(7.7));
    assert_eq!(Course::new(&flat, 3).offset(7.7).rotation.angle(), 0.0);
}

#[test]
fn a_stepping_board_stands_for_two_seconds_and_then_jumps_far() {
    let course = Course::new(&spec(BoardPath::Step), 1);
    let at = |seconds: f64| course.offset(seconds).translation.vector;
    assert_eq!(at(1.99), Vector3::zeros());
    for jump in 1..12 {
        let time = 2.0 * f64::from(jump);
        assert_eq!(at(time), at(time + 1.99));
        assert!((at(time).norm() - 0.04).abs() < 1e-12);
        let distance = (at(time) - at(time - 0.01)).norm();
        assert!(distance > 0.039, "jump {jump} goes {distance} m");
    }
}

/// The motion of a seed is part of every recorded run, so it must not change between versions or machines.
#[test]
fn the_walk_of_a_seed_is_pinned() {
    let place = Course::new(&spec(BoardPath::RandomWalk), 1).offset(10.0).translation.vector;
    let pinned = Vector3::new(-0.012917389997603975, -0.018785937260937843, 0.0045150330920131964);
    assert!((place - pinned).norm() < 1e-9, "{place:?}");
}

#[test]
fn something_that_brakes_goes_on_for_half_its_braking_time() {
    assert_eq!((braked(0.0), braked(1.0), braked(7.0)), (0.0, 0.5, 0.5));
    let speed = |x: f64| (braked(x + 1e-6) - braked(x)) / 1e-6;
    assert!((speed(0.0) - 1.0).abs() < 1e-5 && (speed(0.5) - 0.5).abs() < 1e-5 && speed(0.999).abs() < 1e-5);
}
