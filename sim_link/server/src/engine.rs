//! The server without its socket: requests in, replies out, passes of the simulation in between.

use std::collections::BTreeSet;
use std::time::Duration;

use super::api::{Call, Effect, Registry};
use super::args::{ApiError, Args};
use super::cell::Cell;
use super::clients::{Client, Clients, MAX_CALLS, Peer, Running, Waiting};
use super::message::{self, BadRequest, Request};
use super::task::{Answer, Next, Task, Wake};
use handeye_cell::world::State;

/// Steps that calls may take in one turn before requests are handled again. A motion in a stopped simulation has no
/// pass to wait for and would otherwise keep all clients waiting until it is over.
const STEPS_PER_TURN: usize = 200;

/// Longest time without a message to a client whose call is under way. The vendor's Python clients of 4.9 and 4.10 give
/// up after 5 s of silence.
const SILENCE: Duration = Duration::from_secs(1);

/// How long a pass that need not keep to real time waits for further requests, for each client that has made one since
/// the last pass: a few calls in a row see the same instant, as they do in the simulator.
const REQUEST_GRACE: Duration = Duration::from_millis(2);

/// Prefix of the simulator's error messages: the line of its own script that made the call, which is this one in
/// version 4.10.
const ERROR_LINE: u32 = 354;

/// A reply and the connection that it goes to.
pub type Outgoing = (Peer, Vec<u8>);

fn no_module(name: &str, registry: &Registry) -> String {
    format!(
        "module '{name}' not found: the built-in cell has {}. Inverse kinematics is in sim.moveToPose with 'ik'.",
        registry.names().collect::<Vec<_>>().join(", ")
    )
}

/// When there is something to do without a request.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Due {
    /// At once.
    Now,
    /// At a time on the server's clock.
    At(Duration),
    Never,
}

/// World and clients.
#[derive(Debug)]
pub struct Engine {
    cell: Cell,
    clients: Clients,
    registry: Registry,
    /// Passes since the server was started.
    step: u64,
    /// When the next pass is due, where time is real.
    next_pass: Option<Duration>,
    /// When the first request since the last pass came, and who has made one.
    requests: Option<(Duration, BTreeSet<String>)>,
    /// Motions whose clients have vanished, on their way to rest.
    orphans: Vec<Box<dyn Task>>,
    outgoing: Vec<Outgoing>,
}

impl Engine {
    /// Serves a cell by some functions.
    pub fn new(cell: Cell, registry: Registry) -> Self {
        Self {
            cell,
            clients: Clients::default(),
            registry,
            step: 0,
            next_pass: None,
            requests: None,
            orphans: Vec::new(),
            outgoing: Vec::new(),
        }
    }

    /// The replies since the last time.
    pub fn take_outgoing(&mut self) -> Vec<Outgoing> {
        std::mem::take(&mut self.outgoing)
    }

    /// Takes in a request at a time on the server's clock.
    pub fn receive(&mut self, peer: &Peer, bytes: &[u8], now: Duration) {
        self.cell.now = now;
        match message::parse(bytes) {
            Err(error) => self.refuse(peer, &error),
            Ok(Request::WithoutId) => self.send(peer, message::version_mismatch()),
            Ok(Request::Nothing) => self.send(peer, message::empty()),
            Ok(Request::Eval) => {
                let text = "in eval: the built-in cell has no Lua interpreter: call its functions by name.";
                self.send(peer, message::failed(text));
            }
            Ok(Request::End { uuid }) => {
                self.forget(&uuid);
                self.send(peer, message::empty());
            }
            Ok(Request::Executed { uuid, values }) => self.executed(peer, &uuid, values),
            Ok(Request::Call { uuid, func, args, idle_limit }) => {
                match self.clients.meet(peer, &uuid, idle_limit, now) {
                    Ok(()) => {
                        self.heard(&uuid);
                        self.call(peer, uuid, func, &Args::new(args));
                    }
                    Err(crowded) => self.send(peer, message::failed(&crowded.to_string())),
                }
            }
        }
    }

    fn heard(&mut self, uuid: &str) {
        let (_, clients) = self.requests.get_or_insert_with(|| (self.cell.now, BTreeSet::new()));
        if !clients.contains(uuid) {
            clients.insert(uuid.to_owned());
        }
    }

    /// Until when the next pass waits for requests.
    fn grace_end(&self) -> Option<Duration> {
        let (since, clients) = self.requests.as_ref()?;
        let clients = u32::try_from(clients.len()).unwrap_or(u32::MAX);
        Some(since.saturating_add(REQUEST_GRACE.saturating_mul(clients)))
    }

    /// When the next pass is due, if no client holds it; `None` for at once.
    fn pass_time(&self) -> Option<Duration> {
        if self.cell.real_time { self.next_pass } else { self.grace_end() }
    }

    /// Answers a request that cannot be understood.
    pub fn refuse(&mut self, peer: &Peer, error: &BadRequest) {
        self.send(peer, message::failed(&error.to_string()));
    }

    /// A connection is gone.
    pub fn disconnected(&mut self, peer: &Peer, now: Duration) {
        self.cell.now = now;
        for call in self.clients.disconnect(peer, now) {
            self.adopt(call);
        }
    }

    /// When [`Self::turn`] has something to do.
    pub fn due(&self) -> Due {
        if self.next_call().is_some() {
            return Due::Now;
        }
        let calls = self.clients.connections().flat_map(|(_, connection)| &connection.calls);
        let times = calls.filter_map(|call| {
            let word = call.owed_since? + SILENCE;
            Some(match call.waiting {
                Waiting::Time(time) => time.min(word),
                _ => word,
            })
        });
        let mut next = times.chain(self.clients.next_expiry()).min();
        if self.cell.world.simulation().is_advancing() && !self.clients.hold_pass(self.step) {
            match self.pass_time() {
                None => return Due::Now,
                Some(time) => next = Some(next.map_or(time, |next| next.min(time))),
            }
        }
        next.map_or(Due::Never, Due::At)
    }

    /// Does what is due at a time on the server's clock: goes on with calls, runs at most one pass.
    pub fn turn(&mut self, now: Duration) {
        self.cell.now = now;
        for uuid in self.forget_silent(now) {
            tracing::info!(uuid, "a client that held the simulation is no longer heard of: it is released");
        }
        self.resume_calls();
        self.break_silence(now);
        if self.is_pass_due(now) {
            self.run_pass(now);
        }
    }

    /// Forgets the clients that have gone silent, and returns those that held the simulation: the others need no
    /// report, since an idle connection is silent for long.
    fn forget_silent(&mut self, now: Duration) -> Vec<String> {
        let (held, idle): (Vec<_>, Vec<_>) =
            self.clients.expired(now).into_iter().partition(|uuid| self.clients.holds_anything(uuid));
        for uuid in held.iter().chain(&idle) {
            self.forget(uuid);
        }
        held
    }

    fn is_pass_due(&self, now: Duration) -> bool {
        self.cell.world.simulation().is_advancing()
            && !self.clients.hold_pass(self.step)
            && self.pass_time().is_none_or(|time| time <= now)
    }

    /// Gives word to clients that have waited long for a call.
    fn break_silence(&mut self, now: Duration) {
        for (peer, connection) in self.clients.connections_mut() {
            for call in &mut connection.calls {
                if call.owed_since.is_some_and(|since| now.saturating_sub(since) >= SILENCE) {
                    call.owed_since = None;
                    self.outgoing.push((peer.clone(), message::wait()));
                }
            }
        }
    }

    fn run_pass(&mut self, now: Duration) {
        self.cell.world.run_pass();
        self.step += 1;
        self.requests = None;
        let seconds = self.cell.world.simulation().time_step_s() / self.cell.speed_factor;
        let length = Duration::try_from_secs_f64(seconds).unwrap_or_default();
        // A pass that was held for long is not made up for by a burst of others.
        let began = self.next_pass.map_or(now, |time| time.max(now.saturating_sub(length)));
        self.next_pass = self.cell.world.simulation().is_advancing().then(|| began + length);
        let mut orphans = std::mem::take(&mut self.orphans);
        orphans.retain_mut(|task| matches!(task.resume(&mut self.cell, Wake::PassOver), Ok(Next::Pass)));
        self.orphans = orphans;
        self.resume_calls();
    }

    /// Goes on with the calls that need not wait any longer.
    fn resume_calls(&mut self) {
        for _ in 0..STEPS_PER_TURN {
            let Some((peer, index, wake)) = self.next_call() else { return };
            let Some(connection) = self.clients.connection_mut(&peer) else { return };
            let call = connection.calls.remove(index);
            self.run(&peer, call, wake, index);
        }
    }

    fn next_call(&self) -> Option<(Peer, usize, Wake)> {
        let advancing = self.cell.world.simulation().is_advancing();
        let wake = |waiting: Waiting| match waiting {
            Waiting::Nothing => Some(Wake::Started),
            Waiting::Pass(step) => (step < self.step || !advancing).then_some(Wake::PassOver),
            Waiting::Time(time) => (time <= self.cell.now).then_some(Wake::TimeReached),
            Waiting::Callback => None,
        };
        self.clients.connections().find_map(|(peer, connection)| {
            connection
                .calls
                .iter()
                .enumerate()
                .filter(|(_, call)| call.owed_since.is_some())
                .find_map(|(index, call)| Some((peer.clone(), index, wake(call.waiting)?)))
        })
    }

    /// Goes on with a call that was taken out of its connection, and puts it back unless it is done.
    fn run(&mut self, peer: &Peer, mut call: Running, wake: Wake, index: usize) {
        match call.task.resume(&mut self.cell, wake) {
            Ok(Next::Return(values)) => return self.send(peer, message::returned(values)),
            Err(error) => return self.fail(peer, &call.func, &error),
            Ok(Next::Pass) => {
                call.waiting = Waiting::Pass(self.step);
                if let Some(client) = self.clients.record_mut(&call.uuid) {
                    client.desired_step = self.step + 1;
                }
            }
            Ok(Next::Time(time)) => call.waiting = Waiting::Time(time),
            Ok(Next::Callback { name, args }) => {
                call.waiting = Waiting::Callback;
                self.send(peer, message::callback(&name, args));
                call.owed_since = None;
            }
        }
        // As often as the simulator: in every pass.
        if call.owed_since.take().is_some() {
            self.send(peer, message::wait());
        }
        let uuid = call.uuid.clone();
        let calls = &mut self.clients.connection(peer, &uuid).calls;
        calls.insert(index.min(calls.len()), call);
    }

    fn executed(&mut self, peer: &Peer, uuid: &str, values: Vec<ciborium::Value>) {
        let now = self.cell.now;
        if let Some(client) = self.clients.record_mut(uuid) {
            client.last_seen = now;
            self.heard(uuid);
        }
        let asked = self.clients.connection_mut(peer).and_then(|connection| Some((connection.asked()?, connection)));
        let Some((index, connection)) = asked else {
            // As the simulator answers a client that it has forgotten.
            return self.send(peer, message::failed(&format!("No such function: {}", message::EXECUTED)));
        };
        if connection.calls[index].waiting == Waiting::Callback {
            let call = Running { owed_since: Some(now), ..connection.calls.remove(index) };
            self.run(peer, call, Wake::Executed(values), index);
        } else {
            connection.calls[index].owed_since = Some(now);
        }
        self.resume_calls();
    }

    fn call(&mut self, peer: &Peer, uuid: String, func: String, args: &Args) {
        if self.clients.connection(peer, &uuid).calls.len() >= MAX_CALLS {
            let text = format!("a connection may have {MAX_CALLS} calls under way: wait for one to return.");
            return self.send(peer, message::failed(&text));
        }
        let Some(function) = self.registry.function(&func) else {
            let error = self.registry.not_a_function(&func);
            return self.send(peer, message::failed(&error));
        };
        let Some(client) = self.clients.record_mut(&uuid) else { return };
        let mut call = Call { cell: &mut self.cell, client, args, step: self.step, effects: Vec::new() };
        let answer = function(&mut call);
        let effects = std::mem::take(&mut call.effects);
        for effect in effects {
            self.carry_out(effect);
        }
        match answer {
            Ok(Answer::Values(values)) => self.send(peer, message::returned(values)),
            Ok(Answer::Encoded(bytes)) => self.send(peer, bytes),
            Ok(Answer::Info(name)) => match self.registry.info(&name) {
                Some(info) => self.send(peer, message::returned(vec![info])),
                None => self.send(peer, message::failed(&no_module(&name, &self.registry))),
            },
            Ok(Answer::Require(name)) if self.registry.has(&name) => self.send(peer, message::returned(Vec::new())),
            Ok(Answer::Require(name)) => self.send(peer, message::failed(&no_module(&name, &self.registry))),
            Ok(Answer::Later(task)) => {
                let index = self.clients.connection(peer, &uuid).calls.len();
                let call = Running { uuid, func, task, waiting: Waiting::Nothing, owed_since: Some(self.cell.now) };
                self.run(peer, call, Wake::Started, index);
                self.resume_calls();
            }
            Err(error) => self.fail(peer, &func, &error),
        }
    }

    fn carry_out(&mut self, effect: Effect) {
        match effect {
            Effect::ReleaseEverybody => {
                for client in self.clients.records_mut() {
                    (client.stepping_level, client.locks) = (0, 0);
                }
            }
            Effect::Brake => {
                for (_, connection) in self.clients.connections_mut() {
                    for call in &mut connection.calls {
                        call.task.brake(&self.cell);
                    }
                }
                self.clients
                    .records_mut()
                    .flat_map(|client| client.plans.iter_mut())
                    .for_each(super::plans::Motion::brake);
                self.cell.world.brake_joints();
            }
        }
    }

    fn forget(&mut self, uuid: &str) {
        for call in self.clients.forget(uuid) {
            self.adopt(call);
        }
    }

    /// Brings what a vanished client was moving to rest.
    fn adopt(&mut self, mut call: Running) {
        let is_on_its_way =
            matches!(call.waiting, Waiting::Pass(_)) && self.cell.world.simulation().state() != State::Stopped;
        if call.task.is_moving() && is_on_its_way {
            tracing::warn!(uuid = call.uuid, func = call.func, "a client vanished during a motion: braking");
            call.task.brake(&self.cell);
            self.orphans.push(call.task);
        }
    }

    fn fail(&mut self, peer: &Peer, func: &str, error: &ApiError) {
        // The simulator reports this one under the name of its inner function.
        let name = if func == "sim.getObject" { "sim._getObject" } else { func };
        self.send(peer, message::failed(&format!("{ERROR_LINE}: in {name}: {error}")));
    }

    fn send(&mut self, peer: &Peer, bytes: Vec<u8>) {
        self.outgoing.push((peer.clone(), bytes));
    }
}

impl Client {
    /// Changes the stepping level as `sim.setStepping` does and gives the previous one.
    pub fn set_stepping(&mut self, enable: bool, step: u64) -> u32 {
        let previous = self.stepping_level;
        if enable {
            if previous == 0 {
                self.desired_step = step;
            }
            self.stepping_level = previous.saturating_add(1);
        } else {
            self.stepping_level = previous.saturating_sub(1);
        }
        previous
    }
}

#[cfg(test)]
#[path = "engine_tests/mod.rs"]
mod tests;
