//! Nothing: this package holds the studies, each an example.
