//! A sparse SQP for any nonlinear program. It has never heard of ODEs, pilots or FMI.
