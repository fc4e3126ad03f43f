//! System files: what they say and what arguments say is one system; mistakes in them; wires between types.

mod mistakes;
mod mutations;
mod same;
mod types;
