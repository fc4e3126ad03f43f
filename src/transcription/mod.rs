//! From an ODE and a mesh to a nonlinear program, by collocation.
