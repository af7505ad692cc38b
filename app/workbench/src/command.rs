//! What the user wants and what the workers report, as plain data that can be logged and replayed.
//!
//! Each feature defines next to its code its commands and what it reports; this is one list of the features for each.

use std::panic::Location;

use serde::{Deserialize, Serialize};

/// An enum with a variant for each feature; the feature's own enums convert to it with `From`.
macro_rules! of_features {
    ($(#[$meta:meta])* enum $name:ident { $($variant:ident($feature:ident),)* } $($others:tt)*) => {
        $(#[$meta])*
        pub enum $name {
            $(
                #[doc = concat!("Of [`crate::", stringify!($feature), "`].")]
                $variant(crate::$feature::command::$name),
            )*
            $($others)*
        }

        $(
            impl From<crate::$feature::command::$name> for $name {
                fn from(own: crate::$feature::command::$name) -> Self {
                    Self::$variant(own)
                }
            }
        )*
    };
}

/// The features that accept commands.
macro_rules! commands {
    ($($variant:ident($feature:ident),)*) => {
        of_features! {
            /// What the user wants.
            #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
            enum Command { $($variant($feature),)* }
        }

        /// A command without its values.
        #[cfg(feature = "testing")]
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
        pub enum CommandKind {
            $(
                #[doc = concat!("Of [`crate::", stringify!($feature), "`].")]
                $variant(crate::$feature::command::CommandKind),
            )*
        }

        #[cfg(feature = "testing")]
        impl CommandKind {
            /// Every kind that there is.
            pub fn all() -> Vec<Self> {
                use strum::IntoEnumIterator as _;

                let mut all = Vec::new();
                $(all.extend(crate::$feature::command::CommandKind::iter().map(Self::$variant));)*
                all
            }
        }

        #[cfg(feature = "testing")]
        impl From<&Command> for CommandKind {
            fn from(command: &Command) -> Self {
                match command {
                    $(Command::$variant(own) => Self::$variant(own.into()),)*
                }
            }
        }
    };
}

commands! {
    ByHand(by_hand),
    Capture(capture),
    Connect(connect),
    Export(export),
    Guided(guided),
    Import(import),
    KeepOut(keep_out),
    Live(live),
    Messages(messages),
    Motion(motion),
    Recording(recording),
    Scene(scene),
    Session(session),
    Shell(shell),
    Solve(solve),
    Target(target),
    Taught(taught),
    Track(track),
}

of_features! {
    /// What happened outside the thread of the window.
    #[derive(Debug, Clone, Serialize, Deserialize)]
    enum Event {
        ByHand(by_hand),
        Capture(capture),
        Connect(connect),
        Export(export),
        Guided(guided),
        Import(import),
        KeepOut(keep_out),
        Live(live),
        Messages(messages),
        Motion(motion),
        Recording(recording),
        Session(session),
        Solve(solve),
        Taught(taught),
        Track(track),
    }
    /// Time has passed.
    Tick {
        /// The present time.
        now_s: f64,
    },
}

/// Collects the commands of one frame of the window. They are applied after it is drawn.
#[derive(Debug, Default)]
pub struct Outbox {
    commands: Vec<(Command, &'static Location<'static>)>,
}

impl Outbox {
    /// Asks for a command, which remembers the place in the code that asked.
    #[track_caller]
    pub fn send(&mut self, command: impl Into<Command>) {
        self.commands.push((command.into(), Location::caller()));
    }

    /// Whether there are no commands.
    pub fn is_empty(&self) -> bool {
        self.commands.is_empty()
    }

    /// The commands in the order in which they were sent.
    pub fn drain(&mut self) -> impl Iterator<Item = (Command, &'static Location<'static>)> + '_ {
        self.commands.drain(..)
    }
}
