//! The binary `handeye`: arguments, logging, exit code.

use std::process::ExitCode;

/// Replies that wait for slow clients, and what recordings hold, come and go by tens of megabytes. This one gives them
/// back to the system; that of glibc keeps what it once had.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() -> ExitCode {
    handeye_app::main()
}
