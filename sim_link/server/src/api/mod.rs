//! The functions and constants that clients can reach, by namespace.

mod absent;
mod constants;
mod handeye;
mod joints;
mod matrices;
mod move_to_config;
mod move_to_pose;
mod objects;
mod params;
mod poses;
mod remote;
mod sensors;
mod shapes;
mod signals;
mod simulation;

use std::collections::BTreeMap;

use ciborium::Value;

use super::args::{ApiError, Args};
use super::cell::Cell;
use super::clients::Client;
use super::task::Answer;
use handeye_wire as wire;

/// A call of a function.
#[derive(Debug)]
pub struct Call<'a> {
    pub cell: &'a mut Cell,
    /// Who calls.
    pub client: &'a mut Client,
    pub args: &'a Args,
    /// Passes since the server was started.
    pub step: u64,
    /// What is to happen to the other clients after the call.
    pub effects: Vec<Effect>,
}

/// What a function does beyond the cell and its own client.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Effect {
    /// Ends all stepping and all locks.
    ReleaseEverybody,
    /// Brings every motion to rest.
    Brake,
}

/// Result of a function.
pub type Outcome = Result<Answer, ApiError>;

/// A function of the API.
pub type Function = fn(&mut Call<'_>) -> Outcome;

/// Functions of one topic with the names that they have in their namespace.
type Table = &'static [(&'static str, Function)];

const SIM: &[Table] = &[
    absent::FUNCTIONS,
    objects::FUNCTIONS,
    poses::FUNCTIONS,
    matrices::FUNCTIONS,
    sensors::FUNCTIONS,
    shapes::FUNCTIONS,
    joints::FUNCTIONS,
    simulation::FUNCTIONS,
    params::FUNCTIONS,
    signals::FUNCTIONS,
    move_to_config::FUNCTIONS,
    move_to_pose::FUNCTIONS,
];

#[derive(Debug, Default)]
struct Namespace {
    functions: BTreeMap<&'static str, Function>,
    constants: BTreeMap<&'static str, i64>,
}

/// Every namespace.
#[derive(Debug)]
pub struct Registry {
    namespaces: BTreeMap<&'static str, Namespace>,
}

impl Registry {
    /// All that the cell serves.
    pub fn new() -> Self {
        let sim = Namespace {
            functions: SIM.iter().flat_map(|table| table.iter().copied()).collect(),
            constants: constants::CONSTANTS.iter().copied().collect(),
        };
        let functions = |table: Table| Namespace { functions: table.iter().copied().collect(), ..Namespace::default() };
        let namespaces = BTreeMap::from([
            ("sim", sim),
            ("handeye", functions(handeye::FUNCTIONS)),
            ("zmqRemoteApi", functions(remote::FUNCTIONS)),
        ]);
        Self { namespaces }
    }

    /// Functions that CoppeliaSim has, too.
    pub fn coppeliasim_only() -> Self {
        let mut registry = Self::new();
        registry.namespaces.remove("handeye");
        registry
    }

    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.namespaces.keys().copied()
    }

    /// The function with a dotted name.
    pub fn function(&self, name: &str) -> Option<Function> {
        let (namespace, name) = name.split_once('.')?;
        self.namespaces.get(namespace)?.functions.get(name).copied()
    }

    /// The simulator's error for a call of an unknown function.
    pub fn not_a_function(&self, name: &str) -> String {
        let constant = name.split_once('.').is_some_and(|(namespace, name)| {
            self.namespaces.get(namespace).is_some_and(|namespace| namespace.constants.contains_key(name))
        });
        if constant {
            "attempt to call a number value (upvalue 'func')".to_owned()
        } else {
            format!("No such function: {name} (functions of the built-in cell: docs/reference/cell.md)")
        }
    }

    /// Whether there is a namespace of this name.
    pub fn has(&self, name: &str) -> bool {
        self.namespaces.contains_key(name)
    }

    /// The functions of a namespace, in the form from which clients build their objects.
    pub fn info(&self, name: &str) -> Option<Value> {
        let Namespace { functions, constants } = self.namespaces.get(name)?;
        let functions = functions.keys().map(|&name| (name, wire::map([("func", Value::Map(Vec::new()))])));
        let constants = constants.iter().map(|(&name, &value)| (name, wire::map([("const", Value::from(value))])));
        Some(wire::map(functions.chain(constants)))
    }
}

#[expect(clippy::unnecessary_wraps, reason = "it stands at the end of functions that return an outcome")]
fn nothing() -> Outcome {
    Ok(Answer::Values(Vec::new()))
}

/// One value.
#[expect(clippy::unnecessary_wraps, reason = "it stands at the end of functions that return an outcome")]
fn one(value: impl Into<Value>) -> Outcome {
    Ok(Answer::Values(vec![value.into()]))
}

/// Several values.
#[expect(clippy::unnecessary_wraps, reason = "it stands at the end of functions that return an outcome")]
fn several(values: impl IntoIterator<Item = Value>) -> Outcome {
    Ok(Answer::Values(values.into_iter().collect()))
}
