use proptest::prelude::{any, proptest};

use super::motions::to_pose;
use super::*;

#[test]
fn twenty_thousand_mutated_requests_break_nothing() {
    use rand::{Rng as _, SeedableRng as _};
    use rand_chacha::ChaCha8Rng;
    let mut bench = Bench::new();
    bench.call(A, "sim.startSimulation", vec![]);
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let params = to_pose(&mut bench, &[0.1, -0.1, 0.8, 0.0, 0.0, 0.0, 1.0], vec![]);
    let options = wire::map([("index", Value::from(3)), ("proxy", Value::from(16))]);
    let seeds = [
        request(A, "sim.getObject", vec![Value::from("/UR5/joint[0]{2}"), options]),
        request(A, "sim.setObjectPose", vec![Value::from(16), floats(&[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])]),
        request(A, "sim.setObjectParent", vec![Value::from(18), Value::from(20), Value::from(true)]),
        request(A, "sim.moveToConfig", vec![to_config(&bench, GOAL, 1.0)]),
        request(A, "sim.moveToPose", vec![params]),
        request(
            A,
            "sim.getVisionSensorImg",
            vec![Value::from(15), Value::from(3), Value::from(0.5), floats(&[0.0, 1.0]), floats(&[9.0, 9.0])],
        ),
        request(A, "sim.removeObjects", vec![wire::integers([15, 16, 17])]),
        request(A, "sim.createDummy", vec![Value::from(0.01)]),
        request(A, "sim.setJointTargetPosition", vec![Value::from(16), Value::from(1.0), floats(&[1.0, 1.0, 1.0])]),
        request(A, "sim.testCB", vec![Value::from(1), Value::from("f@func"), Value::from(2), Value::from(3)]),
        request(A, "_*executed*_", vec![Value::from(1)]),
        request(A, "sim.wait", vec![Value::from(1.0), Value::from(false)]),
        request(A, "sim.setStepping", vec![Value::from(true)]),
    ];
    for round in 0..20_000_u64 {
        let mut bytes = seeds[(rng.next_u32() as usize) % seeds.len()].clone();
        for _ in 0..=rng.next_u32() % 4 {
            let at = (rng.next_u32() as usize) % bytes.len();
            match rng.next_u32() % 4 {
                0 => bytes[at] = rng.next_u32() as u8,
                1 => bytes[at] ^= 1 << (rng.next_u32() % 8),
                2 => bytes.truncate(at.max(1)),
                _ => bytes.insert(at, rng.next_u32() as u8),
            }
        }
        bench.now += Duration::from_millis(1);
        let socket = vec![(round % 7) as u8];
        bench.engine.receive(&socket, &bytes, bench.now);
        if round % 50 == 0 {
            bench.engine.turn(bench.now);
            bench.engine.disconnected(&socket, bench.now);
        }
        bench.engine.take_outgoing();
    }
    bench.now += Duration::from_secs(100_000);
    bench.engine.turn(bench.now);
    assert_eq!(bench.call("fresh client", "sim.getSimulationState", vec![]).list().map(<[Value]>::len), Some(1));
}

proptest! {
    #[test]
    fn no_bytes_at_all_make_the_engine_panic(bytes in proptest::collection::vec(any::<u8>(), 0..200)) {
        let mut bench = Bench::new();
        bench.engine.receive(&peer(A), &bytes, Duration::ZERO);
        assert!(bench.reply(A).is_some());
    }
}
