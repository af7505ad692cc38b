//! How an arm really moves: its errors, drawn without any model of the estimator.

use handeye_simulate::links::normal;
use nalgebra::{Isometry3, Matrix3, Translation3, UnitQuaternion, Vector3};
use rand::RngExt as _;
use rand_chacha::ChaCha8Rng;

use crate::chain::{Chain, Model};

/// Stiffness of the joints up to the third and of those of the wrist, N·m per radian, the median: half to twice of it.
const STIFF: [f64; 2] = [5e4, 1.5e4];
const GRAVITY: f64 = 9.81;

/// What is wrong with an arm.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Nothing.
    Exact,
    /// Half of [`Self::Links`].
    HalfLinks,
    /// Zeros of 0.05°, places of 0.2 mm, tilts of 0.03°.
    Links,
    /// Twice of [`Self::Links`].
    TwiceLinks,
    /// [`Self::Links`] with zeros of 1°: a cheap arm.
    Zeros,
    /// One link 2 mm longer.
    LongLink,
    /// Joints yield under their load, without and with 2 kg at the tip.
    Elastic,
    Loaded,
    /// Gears that are eccentric by 0.01 to 0.03°.
    Gears,
    /// Links, joints with 2 kg and gears.
    All,
    /// The tip has an error that grows with its place, in the axes of the base: 2 mm and 0.1° per metre.
    Affine,
    /// It repeats to 0.1 mm and 0.02°.
    White,
    /// It is another arm of its maker, or one whose first links are 5 % longer and the others 5 % shorter.
    Another,
}

impl Kind {
    pub const ALL: [Self; 13] = [
        Self::Exact,
        Self::HalfLinks,
        Self::Links,
        Self::TwiceLinks,
        Self::Zeros,
        Self::LongLink,
        Self::Elastic,
        Self::Loaded,
        Self::Gears,
        Self::All,
        Self::Affine,
        Self::White,
        Self::Another,
    ];

    pub fn name(self) -> &'static str {
        match self {
            Self::Exact => "exact",
            Self::HalfLinks => "links × ½",
            Self::Links => "links",
            Self::TwiceLinks => "links × 2",
            Self::Zeros => "zeros of 1°",
            Self::LongLink => "a link of 2 mm",
            Self::Elastic => "elastic",
            Self::Loaded => "elastic, 2 kg",
            Self::Gears => "gears",
            Self::All => "all, 2 kg",
            Self::Affine => "affine in the base",
            Self::White => "white",
            Self::Another => "another arm",
        }
    }

    /// Whether the chain of its links is the only error.
    pub fn is_of_links(self) -> bool {
        matches!(
            self,
            Self::Exact
                | Self::HalfLinks
                | Self::Links
                | Self::TwiceLinks
                | Self::Zeros
                | Self::LongLink
                | Self::White
                | Self::Another
        )
    }

    /// Repeatability in metres and radians.
    pub fn repeats(self) -> [f64; 2] {
        match self {
            Self::White => [1e-4, 0.02_f64.to_radians()],
            _ => [2e-5, 0.005_f64.to_radians()],
        }
    }
}

/// The true arm.
pub struct Real {
    pub chain: Chain,
    /// Amplitude \[rad\], turns per turn and phase of the error of a gear, for every joint.
    gears: Vec<[f64; 3]>,
    /// Masses after each joint and at the tip, kilograms; empty if no joint yields.
    masses_kg: Vec<f64>,
    /// N·m per radian.
    stiffness: Vec<f64>,
    /// Metres and radians per metre, and about which place.
    affine: Option<(Matrix3<f64>, Matrix3<f64>, Vector3<f64>)>,
}

impl Real {
    /// An arm whose links are these, with nothing else wrong.
    pub fn of_links(chain: Chain) -> Self {
        Self { chain, gears: Vec::new(), masses_kg: Vec::new(), stiffness: Vec::new(), affine: None }
    }

    /// The same with joints that yield under 2 kg, and gears.
    pub fn with_joints(self, model: &Model, rng: &mut ChaCha8Rng) -> Self {
        Self { gears: gears(self.chain.links.len(), rng), ..self.elastic(model, 2.0, rng) }
    }

    fn elastic(self, model: &Model, load_kg: f64, rng: &mut ChaCha8Rng) -> Self {
        let masses_kg = model.masses_kg.iter().copied().chain([0.2 + load_kg]).collect();
        let stiff = |j: usize| STIFF[usize::from(j > 2)] * rng.random_range(-1.0_f64..1.0).exp2();
        Self { stiffness: (0..self.chain.links.len()).map(stiff).collect(), masses_kg, ..self }
    }

    pub fn draw(kind: Kind, model: &Model, rng: &mut ChaCha8Rng) -> Self {
        let nominal = model.believed.clone();
        let links = |scale: f64, zeros_deg: f64, rng: &mut ChaCha8Rng| {
            let mut chain = nominal.clone();
            for link in &mut chain.links {
                let tilts = 0.03_f64.to_radians() * scale;
                let turn = Vector3::new(tilts * normal(rng), tilts * normal(rng), zeros_deg.to_radians() * normal(rng));
                let place = Vector3::from_fn(|_, _| 2e-4 * scale * normal(rng));
                let fixed = UnitQuaternion::from_euler_angles(link.turn.x, link.turn.y, link.turn.z);
                let (roll, pitch, yaw) = (fixed * UnitQuaternion::from_scaled_axis(turn)).euler_angles();
                link.place += place;
                link.turn = Vector3::new(roll, pitch, yaw);
            }
            Self::of_links(chain)
        };
        match kind {
            Kind::Exact | Kind::White => Self::of_links(nominal.clone()),
            Kind::Another => Self::of_links(model.other.clone()),
            Kind::HalfLinks => links(0.5, 0.025, rng),
            Kind::Links => links(1.0, 0.05, rng),
            Kind::TwiceLinks => links(2.0, 0.1, rng),
            Kind::Zeros => links(1.0, 1.0, rng),
            Kind::LongLink => {
                let mut chain = nominal.clone();
                // The forearm, or its counterpart, along its direction.
                let forearm = chain.links.len() / 2;
                let place = chain.links[forearm].place;
                chain.links[forearm].place += place.normalize() * 2e-3;
                Self::of_links(chain)
            }
            Kind::Elastic => Self::of_links(nominal.clone()).elastic(model, 0.0, rng),
            Kind::Loaded => Self::of_links(nominal.clone()).elastic(model, 2.0, rng),
            Kind::Gears => Self { gears: gears(nominal.links.len(), rng), ..Self::of_links(nominal.clone()) },
            Kind::All => links(1.0, 0.05, rng).with_joints(model, rng),
            Kind::Affine => {
                let mut slopes = |a_metre: f64| Matrix3::from_fn(|_, _| a_metre * normal(rng));
                let about = nominal.forward(&model.start).translation.vector;
                let affine = Some((slopes(2e-3), slopes(0.1_f64.to_radians()), about));
                Self { affine, ..Self::of_links(nominal.clone()) }
            }
        }
    }

    /// Where the tip is when the joints are reported there, in the base.
    pub fn tip(&self, joints: &[f64]) -> Isometry3<f64> {
        let mut really = joints.to_vec();
        for (angle, [amplitude, turns, phase]) in really.iter_mut().zip(&self.gears) {
            *angle += amplitude * (turns * *angle + phase).sin();
        }
        if !self.masses_kg.is_empty() {
            let given_way = self.given_way(&really);
            really.iter_mut().zip(given_way).for_each(|(angle, by)| *angle += by);
        }
        let tip = self.chain.forward(&really);
        let Some((shift, turn, about)) = self.affine else { return tip };
        let place = tip.translation.vector - about;
        let turn = UnitQuaternion::from_scaled_axis(turn * place);
        Isometry3::from_parts(Translation3::from(tip.translation.vector + shift * place), turn * tip.rotation)
    }

    /// The deflection of each joint, radians, under masses in the middle of each link and at the tip.
    fn given_way(&self, joints: &[f64]) -> Vec<f64> {
        let frames = self.chain.frames(joints);
        let mut places: Vec<Vector3<f64>> = frames.iter().map(|frame| frame.translation.vector).collect();
        places.push(self.chain.forward(joints).translation.vector);
        let weights: Vec<(Vector3<f64>, f64)> = (0..frames.len())
            .map(|j| ((places[j] + places[j + 1]) * 0.5, self.masses_kg[j]))
            .chain([(places[frames.len()], self.masses_kg[frames.len()])])
            .collect();
        let give_way = |(j, frame): (usize, &Isometry3<f64>)| {
            let axis = frame.rotation * Vector3::z();
            let behind = weights.iter().skip(j);
            let torque: f64 = behind
                .map(|(place, mass)| (place - places[j]).cross(&(Vector3::z() * -GRAVITY * *mass)).dot(&axis))
                .sum();
            torque / self.stiffness[j]
        };
        frames.iter().enumerate().map(give_way).collect()
    }
}

fn gears(joints: usize, rng: &mut ChaCha8Rng) -> Vec<[f64; 3]> {
    let gear = |rng: &mut ChaCha8Rng| {
        let turns = if rng.random::<bool>() { 1.0 } else { 2.0 };
        [rng.random_range(0.01_f64..0.03).to_radians(), turns, rng.random_range(0.0..std::f64::consts::TAU)]
    };
    (0..joints).map(|_| gear(rng)).collect()
}
