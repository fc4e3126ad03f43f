//! The master, with slaves made for the purpose.

mod algorithms;
mod allocations;
mod arrays;
mod blocks;
mod discrete;
mod endings;
mod errors;
mod events;
mod failures;
mod initialization;
mod joint;
mod kinds;
mod slaves;
mod sources;
mod stiff;
mod strong;
mod wiring;
