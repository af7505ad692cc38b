//! Nothing: this package holds the tests in `tests/suite`, which need several of the libraries.
