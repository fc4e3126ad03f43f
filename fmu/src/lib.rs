//! The shared library inside every FMU that pilotage exports: FMI 2.0 and FMI 3.0, co-simulation and
//! model exchange.
//!
//! One library serves every model: which one, and with which start values, stands in the FMU's
//! `resources/model.toml`, which may be a user's model file, so that exporting needs no compiler. All else is [`pilotage_sdk`]'s.

pilotage_sdk::export!(
    pilotage_models::AnyModel,
    pilotage_models::AnyModel::from_resources
);
