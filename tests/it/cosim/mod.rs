//! The master, with components made for the purpose.

mod algorithms;
mod allocations;
mod arrays;
mod blocks;
mod components;
mod discrete;
mod endings;
mod errors;
mod events;
mod failures;
mod initialization;
mod joint;
mod kinds;
mod small;
mod sources;
mod stiff;
mod strong;
mod wiring;
