//! Records of the clients: one per id, one per connection.

use std::collections::BTreeMap;
use std::time::Duration;

use super::plans::Plans;
use super::task::Task;

/// Clients with different ids that are remembered at a time.
pub const MAX_CLIENTS: usize = 64;

/// Most clients per connection: a client has one id, and a new one after a call that it gave up. More would let a
/// single program take all places.
pub const MAX_CLIENTS_PER_CONNECTION: usize = 4;

/// Calls of one connection that may be under way: a blocking one, and those that its callbacks make.
pub const MAX_CALLS: usize = 16;

/// How long a client whose last connection is gone keeps its stepping and its locks. A client that makes a new
/// socket after a time-out is back within milliseconds; one that was killed never is.
const GRACE: Duration = Duration::from_secs(2);

/// Name that the socket gives a connection.
pub type Peer = Vec<u8>;

/// Why a client is not served.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum ClientRefused {
    /// All places are taken by clients that hold something.
    #[error("the built-in cell serves {MAX_CLIENTS} clients at a time: close one and try again.")]
    Cell,
    /// All places of its connection are.
    #[error(
        "a connection may have {MAX_CLIENTS_PER_CONNECTION} clients with locks, stepping or calls under way: end one \
         and try again, or connect again."
    )]
    Connection,
}

/// A client, by the id that it sends with every request.
#[derive(Debug)]
pub struct Client {
    /// The connection of its last message.
    pub peer: Peer,
    /// Above zero, passes wait until it has asked for one.
    pub stepping_level: u32,
    /// Number of the pass that it wants to see begin.
    pub desired_step: u64,
    /// Above zero, passes wait.
    pub locks: u32,
    /// Idle time after which it is forgotten.
    pub idle_limit: Duration,
    /// Time of its last message.
    pub last_seen: Duration,
    /// Since when it has had no connection.
    pub gone_since: Option<Duration>,
    /// Motions that it steps itself.
    pub plans: Plans,
}

impl Client {
    fn new(peer: &Peer, idle_limit: Duration, now: Duration) -> Self {
        Self {
            peer: peer.clone(),
            stepping_level: 0,
            desired_step: 0,
            locks: 0,
            idle_limit,
            last_seen: now,
            gone_since: None,
            plans: Plans::default(),
        }
    }

    fn holds_anything(&self) -> bool {
        self.stepping_level > 0 || self.locks > 0
    }
}

/// What a call under way waits for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Waiting {
    /// Nothing: it goes on at once.
    Nothing,
    /// The end of the pass with this number.
    Pass(u64),
    /// The return of a callback.
    Callback,
    Time(Duration),
}

/// A call under way.
#[derive(Debug)]
pub struct Running {
    /// Who made it.
    pub uuid: String,
    /// Name of the function, for messages.
    pub func: String,
    /// What remains to be done.
    pub task: Box<dyn Task>,
    pub waiting: Waiting,
    /// Since when its client has been waiting for a message; `None` while it is the client's turn, to run a callback or
    /// to reply that it goes on waiting.
    pub owed_since: Option<Duration>,
}

/// One connection.
#[derive(Debug, Default)]
pub struct Connection {
    /// Id that it last used.
    pub uuid: String,
    /// Its calls, innermost last.
    pub calls: Vec<Running>,
}

impl Connection {
    /// Whether its client is busy with a callback, during which no pass may run.
    pub fn runs_callback(&self) -> bool {
        self.calls.last().is_some_and(|call| call.waiting == Waiting::Callback)
    }

    /// The innermost call whose client has something to answer.
    pub fn asked(&self) -> Option<usize> {
        self.calls.iter().rposition(|call| call.owed_since.is_none())
    }
}

/// All clients and connections.
#[derive(Debug, Default)]
pub struct Clients {
    pub(super) records: BTreeMap<String, Client>,
    connections: BTreeMap<Peer, Connection>,
}

impl Clients {
    /// Records a message of a client over a connection, and makes a record of it if it is new.
    ///
    /// # Errors
    /// [`ClientRefused`], when there are too many that must not be forgotten.
    pub fn meet(&mut self, peer: &Peer, uuid: &str, idle_limit: Duration, now: Duration) -> Result<(), ClientRefused> {
        if self.records.get(uuid).is_none_or(|client| client.peer != *peer) {
            let beside = self.records.values().filter(|client| client.peer == *peer).count();
            if beside >= MAX_CLIENTS_PER_CONNECTION && !self.forget_idlest(|client| client.peer == *peer) {
                return Err(ClientRefused::Connection);
            }
        }
        if !self.records.contains_key(uuid) && self.records.len() >= MAX_CLIENTS && !self.forget_idlest(|_| true) {
            return Err(ClientRefused::Cell);
        }
        let client = self.records.entry(uuid.to_owned()).or_insert_with(|| Client::new(peer, idle_limit, now));
        if client.peer != *peer {
            client.peer.clone_from(peer);
        }
        client.last_seen = now;
        client.gone_since = None;
        Ok(())
    }

    /// The record of a client that has one.
    pub fn record_mut(&mut self, uuid: &str) -> Option<&mut Client> {
        self.records.get_mut(uuid)
    }

    /// All records.
    pub fn records_mut(&mut self) -> impl Iterator<Item = &mut Client> {
        self.records.values_mut()
    }

    /// The connection, made if it is new, now used by `uuid`.
    pub fn connection(&mut self, peer: &Peer, uuid: &str) -> &mut Connection {
        let connection = self.connections.entry(peer.clone()).or_default();
        if connection.uuid != uuid {
            uuid.clone_into(&mut connection.uuid);
        }
        connection
    }

    /// The connection, if it is known.
    pub fn connection_mut(&mut self, peer: &Peer) -> Option<&mut Connection> {
        self.connections.get_mut(peer)
    }

    /// All connections.
    pub fn connections(&self) -> impl Iterator<Item = (&Peer, &Connection)> {
        self.connections.iter()
    }

    /// All connections, to change.
    pub fn connections_mut(&mut self) -> impl Iterator<Item = (&Peer, &mut Connection)> {
        self.connections.iter_mut()
    }

    /// Whether a pass has to wait for a client.
    pub fn hold_pass(&self, step: u64) -> bool {
        let waits_for_pass = |uuid: &str| {
            self.connections
                .values()
                .flat_map(|connection| &connection.calls)
                .any(|call| call.uuid == uuid && matches!(call.waiting, Waiting::Pass(_)))
        };
        self.connections.values().any(Connection::runs_callback)
            || self.records.iter().any(|(uuid, client)| {
                (client.stepping_level > 0 && client.desired_step <= step)
                    || (client.locks > 0 && !waits_for_pass(uuid))
            })
    }

    /// Forgets a connection and gives back its calls.
    pub fn disconnect(&mut self, peer: &Peer, now: Duration) -> Vec<Running> {
        let Some(connection) = self.connections.remove(peer) else { return Vec::new() };
        let connections = &self.connections;
        let is_elsewhere = |uuid: &str| connections.values().any(|connection| connection.uuid == uuid);
        for (uuid, client) in &mut self.records {
            if client.peer == *peer && !is_elsewhere(uuid) {
                client.gone_since = Some(now);
            }
        }
        connection.calls
    }

    /// Whether a client keeps passes from beginning.
    pub fn holds_anything(&self, uuid: &str) -> bool {
        self.records.get(uuid).is_some_and(Client::holds_anything)
    }

    /// Forgets a client and gives back its calls.
    pub fn forget(&mut self, uuid: &str) -> Vec<Running> {
        self.records.remove(uuid);
        let mut calls = Vec::new();
        for connection in self.connections.values_mut() {
            calls.extend(connection.calls.extract_if(.., |call| call.uuid == uuid));
        }
        calls
    }

    /// Clients that were silent for longer than they may be, or whose connections are all gone.
    pub fn expired(&self, now: Duration) -> Vec<String> {
        let expired = |(uuid, client): &(&String, &Client)| {
            let silent = now.saturating_sub(client.last_seen) > client.idle_limit && !self.is_working(uuid);
            silent || client.gone_since.is_some_and(|since| now.saturating_sub(since) > GRACE)
        };
        self.records.iter().filter(expired).map(|(uuid, _)| uuid.clone()).collect()
    }

    /// When [`Self::expired`] may next return clients.
    pub fn next_expiry(&self) -> Option<Duration> {
        // One past the limit: the limit itself is not exceeded.
        let past = Duration::from_millis(1);
        let of = |(uuid, client): (&String, &Client)| {
            let silent = (!self.is_working(uuid)).then(|| client.last_seen + client.idle_limit + past);
            let gone = client.gone_since.map(|since| since + GRACE + past);
            silent.into_iter().chain(gone).min()
        };
        self.records.iter().filter_map(of).min()
    }

    /// Whether calls of the client go on without it: its silence then means nothing.
    fn is_working(&self, uuid: &str) -> bool {
        let mut calls = self.connections.values().flat_map(|connection| &connection.calls);
        calls.any(|call| call.uuid == uuid && call.owed_since.is_some())
    }

    fn forget_idlest(&mut self, among: impl Fn(&Client) -> bool) -> bool {
        let idlest = self
            .records
            .iter()
            .filter(|(uuid, client)| {
                let has_calls = self.connections.values().any(|c| c.calls.iter().any(|call| call.uuid == **uuid));
                among(client) && !client.holds_anything() && !has_calls
            })
            .min_by_key(|(_, client)| client.last_seen)
            .map(|(uuid, _)| uuid.clone());
        match idlest {
            Some(uuid) => self.records.remove(&uuid).is_some(),
            None => false,
        }
    }
}
