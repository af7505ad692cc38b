//! The binary `handeye`: arguments, logging, exit code.

use std::process::ExitCode;

/// Replies that wait for slow clients, and what recordings hold, come and go by tens of megabytes. This allocator
/// returns them to the system; that of glibc keeps them.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() -> ExitCode {
    handeye_app::main()
}
