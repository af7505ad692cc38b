//! A client of the remote API: connection, calls, and the typed part of `sim.*` that the workbench uses.
