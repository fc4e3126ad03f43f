//! The shared library inside every FMU that pilotage exports: FMI 2.0 and FMI 3.0, co-simulation and
//! model exchange.
//!
//! One library serves every model: which one, and with which start values, stands in the FMU's
//! `resources/model.toml`, so that exporting needs no compiler. All else is [`pilotage_kit`]'s.

pilotage_kit::export!(
    pilotage_models::Model,
    pilotage_models::Model::from_resources
);
