//! Nothing: this package holds the tests in `tests/suite`, which need several of the crates in `sim_link`.
